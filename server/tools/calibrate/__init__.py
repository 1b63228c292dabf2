"""`lightleash calibrate`: a camera file from a film of a board."""
