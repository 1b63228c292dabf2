"""Where found LEDs, robot and reference are in the phone's picture, for who points the phone."""

from __future__ import annotations

from math import atan2, isfinite
from typing import Final

import numpy as np

from pipeline.camera.lens import Camera
from pipeline.camera.lens_kernels import NEAREST_M
from pipeline.frames import Array, R_from_wxyz
from pipeline.signals import Mode
from pipeline.vision.detection import Detection
from server.control.ipc import ControlStatus, expected_of
from server.protocol.sight_messages import Sight

SIGHT_S: Final = 1.0 / 15.0
"""From one to the next; quicker than an eye follows, slower than pictures."""
FRESH_S: Final = 0.3
"""What was found longer ago is not drawn: the phone has moved on."""
KNOWN_S: Final = 2.0
"""Without a picture for longer, nobody is led to where the robot was."""
SURE_M: Final = 0.3
"""Nor to where it only might be: standard deviation."""
FIELD: Final = 1.4
"""Times half the field of view: beyond that no lens model was fitted, and it may fold back."""
FOLLOWS: Final = (Mode.TRACK, Mode.COAST)


def sight(
    camera: Camera,
    leds_in_b: Array,
    detection: Detection | None,
    status: ControlStatus | None,
    now: float,
) -> Sight:
    """Of LEDs (n, 3) [m]; `status` is control's newest word, `detection` of the newest picture."""
    robot, goal, toward, distance = np.empty((0, 2)), np.empty((0, 2)), None, None
    expected = expected_of(status) if status is not None else None
    is_known = expected is not None and expected.sigma_p < SURE_M
    if status is not None and expected is not None and is_known and status.pose_age < KNOWN_S:
        p_bc_in_c = expected.p_bc_in_c
        distance = float(np.linalg.norm(p_bc_in_c))
        robot = _shares(camera, p_bc_in_c + leds_in_b @ expected.R_cb.T)
        if not _is_inside(_shares(camera, p_bc_in_c[None])):
            toward = atan2(-p_bc_in_c[2], -p_bc_in_c[1])
        goal = _shares(camera, _reference(status, leds_in_b))
    is_fresh = detection is not None and now - detection.t < FRESH_S
    found = _found(camera, detection) if detection is not None and is_fresh else robot[:0]
    return Sight(
        camera.width, camera.height, _flat(found), _flat(robot), _flat(goal), toward, distance
    )


def _reference(status: ControlStatus, leds_in_b: Array) -> Array:
    """LEDs (n, 3) in c [m] of the robot as the virtual camera would have it; none but in flight."""
    p_rv_in_v, R_vr = status.reference_p_in_v, status.reference_R_wxyz
    R_fc, R_fv = status.R_fc_wxyz, status.R_fv_wxyz
    follows = Mode(status.mode) in FOLLOWS
    if not follows or p_rv_in_v is None or R_vr is None or R_fc is None or R_fv is None:
        return leds_in_b[:0]
    R_cv = R_from_wxyz(R_fc).T @ R_from_wxyz(R_fv)
    return (np.asarray(p_rv_in_v) + leds_in_b @ R_from_wxyz(R_vr).T) @ R_cv.T


def _found(camera: Camera, detection: Detection) -> Array:
    """Shares (n, 2) of the LEDs that have a name."""
    if detection.match is None:
        return np.empty((0, 2))
    return _of_picture(camera, detection.spots.pixels[detection.match.spot])


def _shares(camera: Camera, points_in_c: Array) -> Array:
    """Shares (n, 2) of points (n, 3) [m]; none if one is not within reach of the lens model."""
    ahead, aside = points_in_c[:, :1], np.abs(points_in_c[:, 1:])
    if not (ahead > NEAREST_M).all() or (aside > FIELD * np.array(camera.half_field) * ahead).any():
        return np.empty((0, 2))
    return _of_picture(camera, camera.pixels(points_in_c))


def _of_picture(camera: Camera, pixels: Array) -> Array:
    shares: Array = (pixels + 0.5) / np.array([camera.width, camera.height])
    return shares


def _is_inside(shares: Array) -> bool:
    return len(shares) > 0 and bool(((shares > 0.0) & (shares < 1.0)).all())


def _flat(shares: Array) -> list[float]:
    """To a fifth of a pixel; nothing if one is no number."""
    numbers: list[float] = shares.round(4).ravel().tolist()
    return numbers if all(map(isfinite, numbers)) else []
