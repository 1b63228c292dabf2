"""Coordinate frames as ROS and Foxglove have them, and what a state says of them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np

from pipeline.frames import Array, R_co, Triple, wxyz_from_R
from server.export.decoded import Quaternion, RecordedState

INERTIAL, PHONE, OPTICAL, VIRTUAL = "inertial", "phone", "optical", "virtual"
BODY, REFERENCE = "base_link", "reference"
HERE: Final = (0.0, 0.0, 0.0)
"""Of a frame whose direction alone is known, or counts."""


@dataclass(frozen=True, slots=True)
class FramePlace:
    """Where a frame is."""

    parent: str
    child: str
    p: Triple
    """Of the child in the parent's axes [m]."""
    wxyz: Quaternion
    """Turns the child's axes into the parent's."""


FILMED: Final = FramePlace(PHONE, OPTICAL, HERE, wxyz_from_R(R_co))
"""How OpenCV's axes lie in the camera's."""


def places(state: RecordedState) -> list[FramePlace]:
    """Those that are known; of phone and virtual camera in space the directions alone are."""
    candidates = (
        (INERTIAL, PHONE, HERE, state.R_fc_wxyz),
        (INERTIAL, VIRTUAL, HERE, state.R_fv_wxyz),
        (PHONE, BODY, state.p_bc_in_c, state.R_cb_wxyz),
        (VIRTUAL, REFERENCE, state.reference_p_in_v, state.reference_R_wxyz),
    )
    return [
        FramePlace(parent, child, p, wxyz)
        for parent, child, p, wxyz in candidates
        if p is not None and wxyz is not None
    ]


def covariance(state: RecordedState) -> Array:
    """(6, 6) of the body's pose: the largest standard deviation along every axis; 0: unknown."""
    sigmas = np.repeat([state.sigma_p or 0.0, state.sigma_theta or 0.0], 3)
    return np.diag(sigmas**2)
