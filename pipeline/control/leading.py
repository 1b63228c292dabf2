"""How a person leads: how far the robot goes for a motion of the hand, and along which axes.

What moves the robot is the motion since the press of the virtual camera, with the reference that is
rigid in it. With x_b the body's displacement since the press, e_p Eq. (14) and all in f,

    e = S e_p − (I − S) x_b,   S = diag(s_x, s_y, s_z).

If x_b is known, e = 0 is x_b = S x_r: of the displacement x_r of the paper's reference the robot
goes the share S. S = I is the paper's law; S = 0 keeps the place of the press. Where r is in f no
picture tells, for all of them are relative to the phone: x_b is what `SuspendedPlace` knows. The
rate of e is formed alike, with the body's velocity.

Each press takes x_b = 0 and the robot's present pose for the reference, so nothing jumps, and a
change counts from the next press on.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final, Literal

import numpy as np

from pipeline.control.pid import PoseError, Reference
from pipeline.frames import Array
from pipeline.robot import Robot
from pipeline.signals import VirtualView

LeadingAxes = Literal["all", "shift", "turn", "level"]
LEAST_SCALE: Final = 0.25
"""Way of the robot over that of its reference: less, the error of its place outweighs it."""
MOST_SCALE: Final = 1.0
"""Beyond it S − I would push a robot that something blocks: what its thrusters then give without
moving it, `SuspendedPlace` takes for a way that is gone, and the law for more to go."""


@dataclass(frozen=True, slots=True)
class Leading:
    """What of the hand's motion reaches the robot."""

    scale: float = 1.0
    """So many times as far as the reference would go by itself, `LEAST_SCALE` to `MOST_SCALE`."""
    axes: LeadingAxes = "all"
    """`shift`: the phone's turns move and turn nothing; `turn`: the robot stays in its place and
    turns alone; `level`: it keeps its height."""

    @property
    def is_plain(self) -> bool:
        """The paper's law, and nothing else."""
        return self.scale == 1.0 and self.axes == "all"

    @property
    def keeps_attitude(self) -> bool:
        """The virtual camera stays as it was at the press: the phone's turns lead nothing."""
        return self.axes == "shift"

    @property
    def needs_place(self) -> bool:
        """Whether it can only be done by who knows where the robot is in f."""
        return self.scale != 1.0 or self.axes in ("turn", "level")

    @property
    def shares_in_f(self) -> Array | None:
        """S as (3,) along x, y, z of f; None for I."""
        if not self.needs_place:
            return None
        if self.axes == "turn":
            return np.zeros(3)
        return np.array([self.scale, self.scale, 0.0 if self.axes == "level" else self.scale])


PLAIN: Final = Leading()


def suits(leading: Leading, robot: Robot) -> bool:
    """Whether `robot` can be led so: its place is known by what it hangs from."""
    return not leading.needs_place or knows_its_place(robot)


def knows_its_place(robot: Robot) -> bool:
    """Whether it hangs, and is controlled along all axes."""
    return bool((robot.stiffness_in_f > 0.0).all() and robot.axes[:3].all())


def led(
    error: PoseError,
    view: VirtualView,
    shares_in_f: Array,
    x_bf_in_f: Array,
    v_bf_in_f: Array,
) -> PoseError:
    """The error when only `shares_in_f` (3,) of the reference's displacement are to be gone.

    Deviation from Eq. (14), (15), (18), (19): of the place, see the head of this file; the
    attitude's are as they were.

    Args:
        error: To the reference that is rigid in v.
        view: The robot from v.
        shares_in_f: Diagonal of S.
        x_bf_in_f: Displacement of the body since the press (3,) [m].
        v_bf_in_f: Its velocity (3,) [m/s].
    """
    R_fv, rest = view.R_fv, 1.0 - shares_in_f
    return PoseError(
        e_p_in_v=R_fv.T @ (shares_in_f * (R_fv @ error.e_p_in_v) - rest * x_bf_in_f),
        e_p_rate_in_v=R_fv.T @ (shares_in_f * (R_fv @ error.e_p_rate_in_v) - rest * v_bf_in_f),
        e_eta_in_b=error.e_eta_in_b,
        e_eta_rate_in_b=error.e_eta_rate_in_b,
    )


def aim_of(error: PoseError, view: VirtualView, reference: Reference) -> Reference:
    """Where the robot shall be now, seen from v: not constant there if it is led by a share."""
    return Reference(view.p_bv_in_v + error.e_p_in_v, reference.R_vr)
