"""`lightleash calibrate`: a camera's lens, its readout time, and how its motion sensors sit."""
