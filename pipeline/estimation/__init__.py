"""Rays of LEDs and two IMUs → where the body is and how it moves. Eq. (5)-(13)."""
