"""The server: the only place with an event loop, a clock, sockets, threads and files."""

__version__ = "0.1.0"
