"""The simulated robot's body, and what it may touch."""
