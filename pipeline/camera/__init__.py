"""A camera: its lens, its rows, its exposure; and whether it still is the one calibrated."""
