"""When a thing happened: other machines' clocks, and pictures against motion samples."""
