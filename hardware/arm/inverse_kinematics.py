"""Differential inverse kinematics: a twist of the tip to rates of its joints, by mink.

The tip first goes as far as it can without turning, then turns by what is left of its joints as far
as it can without leaving its place: each is a quadratic programme, in which what is not asked for
weighs so much that nearly nothing of it happens. So a place that is out of reach never tilts the
gripper, and an attitude that is out of reach never carries it away; each is given up by itself.
Axes that the robot is not led along or about weigh nothing: there it turns as its joints must.

`Bounds` hold for the sum, and where one is met nothing jumps, for a programme's solution doesn't.
"""

from __future__ import annotations

from typing import Final

import numpy as np
import numpy.typing as npt

from hardware.arm.arm_model import ArmModel
from hardware.arm.bounds import Bounds
from hardware.arm.mink_extra import mink
from pipeline.frames import Array

SOLVER: Final = "daqp"
GOES: Final = np.array([1.0, 1.0, 1.0, 3.0, 3.0, 3.0])
"""Weights of a tip that goes and shall not turn [1, m/rad]: at its reach it turns by some 0.1°."""
TURNS: Final = np.array([50.0, 50.0, 50.0, 1.0, 1.0, 1.0])
"""Of one that turns in its place [rad/m, 1]: where it can't, it is 1 mm away from it at most."""
GOES_DAMPED: Final = 4e-5
"""What a joint's rate weighs beside: a tip that moves by less than 6 mm/rad (its square), in a
posture where its joints can hardly move it, gives that up ..."""
TURNS_DAMPED: Final = 1e-3
"""... and so one that turns by less than 0.03."""


class InverseKinematics:
    """Of one arm; knows no time and no servo."""

    def __init__(self, arm: ArmModel, axes: npt.NDArray[np.bool_]) -> None:
        """`axes` (6,): along and about which of b it is led."""
        self.arm = arm
        self._configuration = mink.Configuration(arm.model, arm.configuration(arm.parameters.home))
        self._bounds = Bounds(arm, axes)
        self._goes = _TwistTask(arm, GOES * axes)
        self._turns = _TwistTask(arm, TURNS * axes)

    def rates(self, q: Array, twist_in_b: Array, h: float) -> Array:
        """Of the joints (n,) [rad/s] for the next `h` [s], at the angles `q` (n,) [rad].

        Zeros if the solver finds none.
        """
        self._configuration.update(self.arm.configuration(q))
        jacobian = self.arm.jacobian(q)
        self._bounds.begin(self._configuration, jacobian, h)
        v, omega = twist_in_b[:3], twist_in_b[3:]
        try:
            goes = self._solved(self._goes, jacobian, np.append(v, np.zeros(3)), h, GOES_DAMPED)
            self._bounds.take(h * goes)
            turned = np.append(np.zeros(3), omega)
            turns = self._solved(self._turns, jacobian, turned, h, TURNS_DAMPED)
        except mink.NoSolutionFound:
            return np.zeros(len(q))
        rates: Array = (goes + turns)[self.arm.dofs]
        return rates

    def _solved(
        self, task: _TwistTask, jacobian: Array, twist_in_b: Array, h: float, damping: float
    ) -> Array:
        task.ask(jacobian, h * twist_in_b)
        rates: Array = mink.solve_ik(
            self._configuration, [task], h, SOLVER, damping=damping, limits=[self._bounds]
        )
        return rates


class _TwistTask(mink.Task):
    """Move the tip by so much, in its own axes."""

    def __init__(self, arm: ArmModel, weights: Array) -> None:
        """Ask for nothing yet."""
        super().__init__(cost=weights)
        self._dofs = arm.dofs
        self._jacobian = np.zeros((6, arm.model.nv))
        self._way_in_b = np.zeros(6)

    def ask(self, jacobian: Array, way_in_b: Array) -> None:
        """For a way (6,) [m, rad] where the tip's Jacobian is (6, n)."""
        self._jacobian[:, self._dofs] = jacobian
        self._way_in_b = way_in_b

    def compute_error(self, configuration: mink.Configuration) -> Array:  # noqa: ARG002
        """Minus what is asked for. See `mink.Task`."""
        return -self._way_in_b

    def compute_jacobian(self, configuration: mink.Configuration) -> Array:  # noqa: ARG002
        """Of the tip. See `mink.Task`."""
        return self._jacobian
