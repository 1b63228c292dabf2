"""Estimate → virtual camera, pose error, PID, thrusts, and whether to fly at all. Eq. (14)-(24)."""
