"""Where a body goes that keeps its present twist."""

from __future__ import annotations

import numpy as np

from pipeline.frames import Array, exp, wxyz_from_R


def coasting(
    R_fb: Array, p_bf_in_f: Array, twist_in_b: Array, seconds: float, every: float
) -> list[tuple[float, Array, Array]]:
    """Rows (in how long [s], wxyz_fb (4,), p_bf_in_f (3,) [m]), `every` so often."""
    v_in_b, omega_in_b = twist_in_b[:3], twist_in_b[3:]
    rows = []
    for k in range(1, round(seconds / every) + 1):
        t = k * every
        half = R_fb @ exp(0.5 * t * omega_in_b)
        wxyz_fb = np.array(wxyz_from_R(R_fb @ exp(t * omega_in_b)))
        rows.append((t, wxyz_fb, p_bf_in_f + t * (half @ v_in_b)))
    return rows
