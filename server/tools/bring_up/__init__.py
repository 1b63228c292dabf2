"""`lightleash robot bring-up`: what a robot is, by what it feels of each thruster alone."""
