"""What every room may use: clock, settings, options, processes, access."""
