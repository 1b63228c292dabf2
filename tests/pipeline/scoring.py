"""What the tests of the estimators ask of a run through a `World`."""

from __future__ import annotations

import numpy as np


def assert_same(a, b, tolerance=1e-9):
    """Two relative states are equal."""
    for name in ("p_bc_in_c", "R_cb", "u_bf_in_c", "omega_bf_in_b", "omega_cf_in_c", "R_ic"):
        assert np.abs(getattr(a, name) - getattr(b, name)).max() < tolerance, name
    assert abs(a.sigma_p - b.sigma_p) < tolerance
    assert abs(a.sigma_theta - b.sigma_theta) < tolerance
