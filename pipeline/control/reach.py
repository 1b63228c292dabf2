"""How far from its rest a robot that hangs can be held: the forces its thrusters give for ever.

What it hangs from pulls it back by K x, so a place x is held by the force K x and no torque. With
thrusts in [f_min, f_max - kept], the forces that can be given so are a convex set about 0, cut out
of the zonotope of all wrenches {A f}; its faces are n.F <= r. How much of it a force takes up is

    g(F) = max (n.F / r),

1 on the border. Here it is the 16-norm over the faces instead of the largest, so that its gradient
has no jumps: 0 to 14 % more where faces meet, so a little less far into the corners.
"""

from __future__ import annotations

from itertools import combinations
from typing import Final

import numpy as np

from pipeline.frames import Array
from pipeline.robot import Robot

ORDER: Final = 16
"""Of the norm over the faces: a corner is as sharp as this is large."""
FLAT: Final = 1e-6
"""Less is nothing: a set that is flat there [N, N m], or what two faces differ by [1/N]."""


class ThrustReach:
    """Forces at no torque that thrusters can hold, with some thrust kept for control."""

    def __init__(self, robot: Robot, kept_n: float) -> None:
        """Of a robot whose force is controlled along all axes.

        Args:
            robot: With its thrusters and their limits.
            kept_n: Of each thruster's largest thrust, for control [N].

        Raises:
            ValueError: no place can be held so, not even its rest.
        """
        high = max(robot.f_max - kept_n, robot.f_min)
        normals, bounds = _faces(robot.A[robot.wrench_axes], robot.f_min, high)
        if bounds.min() <= FLAT:
            raise ValueError(
                f"robot {robot.name!r}: its thrusters have no reach: with {robot.f_min:g} to "
                f"{high:g} N each they can't hold it at its rest and push it to every side"
            )
        # faces that only differ by their torque are the same without any
        per_n = np.round(normals[:, :3] / bounds[:, None] / FLAT) * FLAT
        self._per_n = np.ascontiguousarray(np.unique(per_n, axis=0))

    def taken(self, force_in_b: Array) -> tuple[float, Array]:
        """What share of the reach a force (3,) [N] takes up, and its gradient (3,) [1/N]."""
        along = np.maximum(self._per_n @ force_in_b, 0.0)
        largest = float(along.max())
        if largest <= 0.0:
            return 0.0, np.zeros(3)
        relative = along / largest
        norm = float((relative**ORDER).sum()) ** (1.0 / ORDER)
        return largest * norm, ((relative / norm) ** (ORDER - 1)) @ self._per_n


def _faces(A: Array, low: float, high: float) -> tuple[Array, Array]:
    """(n, k) unit normals and (n,) bounds of {A f : low <= f <= high}, for A (k, m).

    Each face is spanned by k - 1 thrusters; what others give along its normal bounds it.
    """
    axes, thrusters = A.shape
    spans = A.T[list(combinations(range(thrusters), axes - 1))]
    _, sizes, rows = np.linalg.svd(spans)
    one_side = rows[sizes[:, -1] > FLAT, -1]
    normals = np.vstack((one_side, -one_side))
    along = normals @ A
    return normals, np.where(along > 0.0, high * along, low * along).sum(axis=1)
