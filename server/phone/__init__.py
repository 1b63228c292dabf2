"""The session of the leading phone: its records, its frames, its calibration."""
