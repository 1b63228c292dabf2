"""Commands for users: calibrate, doctor, led_layout, locate, survey, tune."""
