"""What the paper says its AMES did: section V of hal-04784281, page 7 and 8 of the preprint."""

from __future__ import annotations

from typing import Final

SOURCE: Final = (
    "Arpa Perozo, Niddam, Cuvillon, Durand, Gangloff: Teleoperation of a Suspended Aerial "
    "Manipulator Using a Handheld Camera with an IMU, IEEE RA-L 2025, hal-04784281v1, Sec. V"
)
TABLE_I: Final = {
    "without EKF": {"x": 7.11, "y": 5.76, "z": 4.54},
    "with EKF": {"x": 3.65, "y": 4.31, "z": 4.09},
}
"""RMS of the controller's error [mm], the camera moved by 3 cm in 0.3 s along each axis."""
TABLE_IV: Final = {
    "without VCI": {"y": 32.92, "yaw": 0.84},
    "with VCI": {"y": 4.34, "yaw": 0.21},
}
"""The same [mm], [°], the camera turned by 3° in 0.3 s about z_c at 2.5 m."""
BACK_S: Final = (2.0, 4.0)
"""Fig. 9: after the push at 5.6 s the fast part of the motion is over by about 9 s, 3.4 s later."""
PUSH_AT_S: Final = 5.6
MOVE_AT_S: Final = 1.0
"""On the time axis of Fig. 9."""
PUSH_N: Final = -4.0
"""Along y_b, given by the thrusters."""
SETTLED: Final = 0.1
"""Of the move's amplitude: the dashed lines of Fig. 6."""
TABLE_III: Final = {
    "without EKF": {"1": 34.93, "2": 18.51},
    "with EKF": {"1": 21.89, "2": 13.89},
}
"""Mean times [s] of two operators for the task of Sec. V-B.2."""
TUBE_BORE_M: Final = 0.030
TUBE_TILT_DEG: Final = 15.0
"""Of the tube's axis from the vertical."""
HELD_S: Final = 3.0
"""The beam has to be held through the tube for so long ..."""
LIMIT_S: Final = 60.0
"""... within this, or the attempt has failed."""
REPETITIONS: Final = 5
"""Of each operator with each flavour of the controller."""
