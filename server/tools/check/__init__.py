"""`lightleash check`: what a recording tells of the phone that made it."""
