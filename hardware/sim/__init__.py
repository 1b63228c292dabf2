"""The simulated robot, phone and hand."""
