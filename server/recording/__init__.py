"""MCAP recordings: written, read, begun and ended."""
