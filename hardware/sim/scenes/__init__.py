"""The vision benchmark: rendered scenes with their own truth."""
