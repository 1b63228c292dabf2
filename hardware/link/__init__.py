"""Our link to a robot: its datagrams, both ends sans-I/O, and UDP."""
