"""The estimation benchmark: hand and robot by their statistics, with their truth."""
