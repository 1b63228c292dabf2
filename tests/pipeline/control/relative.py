"""An estimate at rest, for tests."""

from __future__ import annotations

import numpy as np

from pipeline.frames import GRAVITY, Array
from pipeline.signals import RelativeState

UP = np.array([0.0, 0.0, GRAVITY])


def relative_at(p_bc_in_c: Array, R_cb: Array) -> RelativeState:
    """Robot and level phone at rest, all known well."""
    return RelativeState(
        t=0.0,
        p_bc_in_c=p_bc_in_c,
        R_cb=R_cb,
        u_bf_in_c=np.zeros(3),
        omega_bf_in_b=np.zeros(3),
        omega_cf_in_c=np.zeros(3),
        R_ic=np.eye(3),
        sigma_p=1e-3,
        sigma_theta=1e-3,
        age=0.05,
        f_cf_in_c=UP,
        f_bf_in_b=R_cb.T @ UP,
    )
