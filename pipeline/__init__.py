"""From LED spots to thrusts, as pure functions and small classes: no clock, no I/O, no threads.

The method is the one of Arpa Perozo, Niddam, Cuvillon, Durand and Gangloff, "Teleoperation of a
Suspended Aerial Manipulator Using a Handheld Camera with an IMU", IEEE Robotics and Automation
Letters, 2025 (hal-04784281). "Eq. (8)." at the end of a docstring means Eq. (8) of that paper.
"""
