"""Where the relative filter begins: at a picture that gives a pose by itself."""

from __future__ import annotations

from typing import Final

import numpy as np

from pipeline.camera.lens_kernels import NEAREST_M
from pipeline.estimation.out_of_sequence import Checkpoint
from pipeline.estimation.ray_kernels import correct
from pipeline.estimation.relative_kernels import BIASES, OFFSET, X_BIASES, X_OFFSET, N, X
from pipeline.estimator_config import RelativeConfig
from pipeline.frames import Array
from pipeline.signals import VisionMeasurement
from pipeline.so3_kernels import largest_sigma

LOST: Final = 0.1
"""Doubt of the place, by its distance, or of the attitude [rad], beyond which a picture's own pose
is the better start: what the LEDs say of an error so large isn't linear in it."""
SAME: Final = 22.5
"""99.9 % of χ² with 6 degrees of freedom: a pose farther off is not of what was predicted."""
Learnt = tuple[Array, Array]
"""Biases and time offset (13,), and their covariance (13, 13)."""


def can_start(seen: VisionMeasurement, config: RelativeConfig) -> bool:
    """Whether the picture has a pose, before the camera, that fits its LEDs well."""
    pose = seen.pose
    if pose is None or not pose.p_bc_in_c[0] > NEAREST_M:
        return False
    return pose.reprojection_px <= config.start_reprojection_px


def is_better_start(seen: VisionMeasurement, P: Array, config: RelativeConfig) -> bool:
    """So little was known before the picture, P (22, 22), that it had better be a start."""
    if seen.pose is None or not can_start(seen, config):
        return False
    C = np.array(seen.pose.covariance, dtype=np.float64, order="C")
    worse, near = 2.0 * config.start_doubt, LOST * float(seen.pose.p_bc_in_c[0])
    return any(
        largest_sigma(P, k) > max(enough, worse * largest_sigma(C, k))
        for k, enough in ((0, near), (3, LOST))
    )


def correct_by_pose(
    seen: VisionMeasurement,
    here: Checkpoint[VisionMeasurement],
    e: Array,
    passing: Array,
    config: RelativeConfig,
) -> bool:
    """Correct what was predicted for a picture by the pose that it gives by itself.

    What LEDs say of an error so large isn't linear in it, a pose is, and two of them tell how it
    moves from the one to the other: pictures too far apart for their LEDs would else all be starts.
    Nothing is learnt of the pictures' dates.

    Args:
        seen: The picture, with its pose.
        here: What was predicted for it; corrected.
        e: (6,) by how much the pose is off that: δp in c [m], θ in b [rad].
        passing: (6,) how the pose passes there, which a wrong date is seen as.
        config: How far starts are doubted.

    Returns:
        False: it can't be of what was predicted, which is left as it is.
    """
    assert seen.pose is not None
    seen_P = here.P[: len(e)] + np.outer(passing, here.P[OFFSET])
    S = seen_P[:, : len(e)] + np.outer(seen_P[:, OFFSET], passing)
    S += config.start_doubt**2 * seen.pose.covariance
    if not e @ np.linalg.solve(S, e) < SAME:
        return False
    K: Array = np.ascontiguousarray(np.linalg.solve(S, seen_P).T)
    K[OFFSET] = 0.0
    correct(here.x, here.R, K @ e)
    here.P += K @ S @ K.T - K @ seen_P - (K @ seen_P).T
    return True


def first_checkpoint(
    seen: VisionMeasurement, learnt: Learnt | None, now: float, config: RelativeConfig
) -> Checkpoint[VisionMeasurement]:
    """The body at rest in f at the pose of `seen`; what was `learnt` of the sensors stays.

    Raises:
        ValueError: `seen` has no pose.
    """
    if seen.pose is None:
        raise ValueError("a start needs a pose")
    start: Checkpoint[VisionMeasurement] = Checkpoint.empty(X, N)
    if learnt is not None:
        start.x[X_BIASES:], start.P[BIASES:, BIASES:] = learnt
    else:
        start.P[BIASES:, BIASES:] = np.diag(_initial_variances(config))
        if seen.offset is not None:
            start.x[X_OFFSET] = seen.offset.value
            start.P[OFFSET, OFFSET] = seen.offset.sigma**2
    start.t = min(seen.t + float(start.x[X_OFFSET]), now)
    start.x[0:3], start.R[:] = seen.pose.p_bc_in_c, seen.pose.R_cb
    start.P[:6, :6] = config.start_doubt**2 * seen.pose.covariance
    start.P[6:9, 6:9] = config.initial_u**2 * np.eye(3)
    return start


def _initial_variances(c: RelativeConfig) -> Array:
    """Variances (13,) of biases and time offset [unit²]."""
    sigmas = (c.initial_omega_b, c.initial_f_b, c.initial_omega_c, c.initial_f_c)
    variances: Array = np.square(np.append(np.repeat(sigmas, 3), c.initial_offset))
    return variances
