"""HTTP and websockets: the pages, the session manager, the status."""
