"""Gates: truth passes, each kind of lie is named."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from pipeline.frames import exp, rotation_about_x
from pipeline.signals import RelativePose
from pipeline.vision.gating import gate_rejection
from pipeline.vision_config import GatesConfig

UP = np.array([0.0, 0.0, 1.0])
TRUE = RelativePose(
    t=0.0,
    p_bc_in_c=np.array([2.5, 0.1, -0.1]),
    R_cb=exp(np.array([0.05, -0.1, 0.4])),
    covariance=1e-6 * np.eye(6),
    reprojection_px=0.2,
    leds=5,
)
LIES = {
    "px": replace(TRUE, reprojection_px=2.5),
    "behind": replace(TRUE, p_bc_in_c=np.array([-2.5, 0.0, 0.0])),
    "m away": replace(TRUE, p_bc_in_c=np.array([25.0, 0.0, 0.0])),
    "not a number": replace(TRUE, p_bc_in_c=np.array([np.nan, 0.0, 0.0])),
    "gravity": replace(TRUE, R_cb=rotation_about_x(np.pi / 2) @ TRUE.R_cb),
}


def test_the_truth_is_believed_with_and_without_gravity() -> None:
    up_in_b = TRUE.R_cb.T @ UP
    assert gate_rejection(TRUE, UP, up_in_b, GatesConfig()) is None
    assert gate_rejection(TRUE, None, None, GatesConfig()) is None


@pytest.mark.parametrize("word", LIES)
def test_a_lie_is_refused_with_its_reason(word: str) -> None:
    reason = gate_rejection(LIES[word], UP, TRUE.R_cb.T @ UP, GatesConfig())
    assert reason is not None
    assert word in reason
