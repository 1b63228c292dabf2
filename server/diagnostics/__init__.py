"""What the server observes of itself, of its links and of the camera."""
