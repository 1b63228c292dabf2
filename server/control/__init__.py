"""The 200 Hz process: the controller, its schedule, its datagrams from and to the server."""
