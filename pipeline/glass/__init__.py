"""A robot of light: LEDs shown on a screen as through a window, for whoever films it."""
