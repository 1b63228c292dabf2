"""Which code the robot is to blink: one while it is not found, another one now and then.

A code is drawn by the time, so that a replay draws it again. Who is tracked shines.
"""

from __future__ import annotations

import numpy as np

from pipeline.vision.blink_code import CODES, BlinkCode
from pipeline.vision.detection import Detection
from server.control.ipc_inputs import BlinkInput

UNSEEN_S = 0.3
"""A robot missed for less is found again by its place."""
LEAD_S = 0.05
"""Until the robot has been told."""
KEPT_S = 4.0
"""Then another code is drawn: two robots whose servers drew the same one stay undecided."""
SAID_S = 0.1
"""Orders may be lost: they are said again."""


class BlinkChoice:
    """Of one robot that can blink."""

    def __init__(self) -> None:
        """Nothing seen."""
        self.code: BlinkCode | None = None
        self._t_found = self._t_drawn = self._t_said = float("-inf")

    def look(self, detection: Detection, now: float) -> BlinkInput | None:
        """What to tell the robot at `now` [s], once a picture has been looked at."""
        prior = detection.prior
        if detection.pose is not None or len(detection.rays) > 0:
            self._t_found = now
        # not by which way is up: one that does not stand level cannot say that
        hears = prior.omega_cf_in_c is not None and prior.omega_bf_in_b is not None
        if now - self._t_found < UNSEEN_S or not hears:
            self.code = None
            return None
        if self.code is None or now - self._t_drawn > KEPT_S:
            drawn = int(np.random.default_rng(round(1e6 * now)).integers(CODES))
            self.code, self._t_drawn = BlinkCode(drawn, now + LEAD_S), now
        elif now - self._t_said < SAID_S:
            return None
        self._t_said = now
        return BlinkInput(self.code.number, self.code.t_begin)
