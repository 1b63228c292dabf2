"""Where a body goes that moves on by twists."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from pipeline.frames import Array, exp, wxyz_from_R


def moving_on(
    R_fb: Array, p_bf_in_f: Array, twists_in_b: Sequence[Array], every: float
) -> list[tuple[float, Array, Array]]:
    """Rows (in how long [s], wxyz_fb (4,), p_bf_in_f (3,) [m]), one a twist (6,) [m/s, rad/s].

    Each lasts for `every` [s].
    """
    rows = []
    for k, twist_in_b in enumerate(twists_in_b, start=1):
        half = R_fb @ exp(0.5 * every * twist_in_b[3:])
        p_bf_in_f = p_bf_in_f + every * (half @ twist_in_b[:3])
        R_fb = R_fb @ exp(every * twist_in_b[3:])
        rows.append((k * every, np.array(wxyz_from_R(R_fb)), p_bf_in_f))
    return rows
