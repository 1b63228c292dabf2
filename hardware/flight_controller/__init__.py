"""A robot's own computer between our link and a flight controller that turns its motors."""
