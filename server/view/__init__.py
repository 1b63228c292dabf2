"""The 3D view: viser at a unix socket, behind a proxy."""
