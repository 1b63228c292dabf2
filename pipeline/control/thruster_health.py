"""Which thruster does not give what it is told, by what the body's IMU measures.

The robot's accelerometer and gyroscope measure the wrench that acts on it (gravity apart);
commands, lag and delay say what its thrusters give. What is left over, suspension, air, a hand, a
wall, is compared between now and half a second before: a thruster that fails adds a change along
its own column of A in proportion to its thrust, force and torque together, and hardly anything else
does. So for each thruster, and each of two times of failing (a moment ago, long ago), a likelihood
ratio against "all as usual", where *usual* contains changes of what else pulls, thrusters that give
15 % more or less than told, lags and bodies that are not as told. A change that no single thruster
explains, a push or a contact, names none: a wrong name is worse than none.

Willsky and Jones 1976 (generalised likelihood ratio), over windows in place of a recursion.
"""

from __future__ import annotations

from typing import Final

import numpy as np

from pipeline.config import PERIOD_S
from pipeline.control.thruster_health_kernels import judge, put_row
from pipeline.control.thruster_model import ThrusterModel
from pipeline.frames import Array
from pipeline.robot import Robot
from pipeline.signals import BodyImu

NOW, PAUSE, BEFORE = 12, 48, 80
"""Periods: of the window now, of the pause in which it may have failed, of the window before."""
LAG_S: Final = 0.020
"""Of the thrusters, beside what is told ..."""
GAIN: Final = 0.15
"""... what each gives ..."""
BODY: Final = 0.20
"""... and mass and moments of inertia: standard deviations."""
OTHER_FORCE: Final = 0.2
"""Change of other forces between the windows, of a thruster's largest: a cable's, some 0.6 N ..."""
OTHER_TORQUE: Final = 0.03
"""... and of other torques, of the largest of the thruster with the longest lever."""
LIKELY: Final = 14.0
"""2 ln of the ratio from which one is named: whole robots of unknown bodies reached 6 ..."""
LIKELIER: Final = 8.0
"""... and from the next one."""
MISFIT: Final = 14.0
"""χ² of what it does not explain, five degrees of freedom: 1.6 %."""
LEAST_LOST: Final = 0.22
"""Less than this is no failure: gains differ by 15 %."""
EVERY: Final = 3
"""Periods from one look to the next."""
LOOKS: Final = 6
"""So often it must be the same one: for longer than the window now, in which what began or ended
within it looks smaller than it is; and contacts change their minds."""
DEAD: Final = 0.3
"""Who gives less counts as dead: so little can't be told from nothing."""


ASIDE: Final = 0.10
"""6°: from a missing torque to that of the thruster."""
TORQUE: Final = slice(10, 13)
"""Columns of the rows: sum of the measured torque less the thrusters' own."""


class ThrusterHealth:
    """One robot's thrusters. Call `follow` every period."""

    def __init__(self, robot: Robot) -> None:
        """All as told."""
        self._robot = robot
        thrusters = robot.A.shape[1]
        self._inertia = np.concatenate((np.full(3, robot.mass), robot.inertia))
        lever = float(np.linalg.norm(robot.A[3:], axis=0).max())
        usual = robot.f_max * np.repeat((OTHER_FORCE, OTHER_TORQUE * lever), 3)
        self._usual = usual**2
        self._rows = np.zeros((NOW + PAUSE + BEFORE + 1, 16 + 2 * thrusters))
        self._thrusters = ThrusterModel(robot, thrusters)
        self._is_observable = bool(robot.wrench_axes[3:5].all())
        """Of one that a floor keeps from tilting no torque tells a push from a failure."""
        self._ratios, self._lost = np.zeros(thrusters), np.zeros(thrusters)
        self.gains = np.ones(thrusters)
        """(m,) share of what it is told that each gives: 1, or what was found."""
        self.words: tuple[str, ...] = ()
        """What people should know of each that gives less, counted from 1."""
        self._omega, self._f = np.zeros(3), np.zeros(3)
        self.reset()
        # compile or load the kernels here, of the very arrays of flight: never inside the loop
        self._put(PERIOD_S)
        judge(*self._asked())
        self.start()

    def reset(self) -> None:
        """Somebody has mended them."""
        self.gains, self.words = np.ones_like(self.gains), ()
        self._A = self._robot.A.copy()
        self.start()

    def start(self) -> None:
        """What was measured so far does not count: the robot did not obey, or was not free."""
        self._filled = self._k = self._same = 0
        self._suspect: int | None = None
        self._rows[:] = 0.0

    def follow(self, commanded: Array, body: BodyImu, h: float) -> bool:
        """Go on by a period; True if `gains` is another one now.

        Args:
            commanded: Thrusts that the robot was last told (m,) [N].
            body: Its newest sample.
            h: Since the last call [s].
        """
        self._thrusters.follow(commanded, h)
        self._k = (self._k + 1) % len(self._rows)
        self._omega[:], self._f[:] = body.omega_m_bf_in_b, body.a_m_bf_in_b
        self._put(float(h))
        self._filled += 1
        if self._filled < len(self._rows) or self._filled % EVERY or not self._is_observable:
            return False
        return self._found(judge(*self._asked()))

    def _put(self, h: float) -> None:
        sample = self._omega, self._f
        put_row(self._rows, self._k, self._A, self._inertia, *sample, self._thrusters.given, h)

    def _asked(
        self,
    ) -> tuple[
        Array, int, tuple[int, int, int], Array, Array, tuple[float, float, float], Array, Array
    ]:
        windows = NOW, NOW + PAUSE, NOW + PAUSE + BEFORE
        errors = LAG_S, GAIN, BODY
        return (
            self._rows,
            self._k,
            windows,
            self._A,
            self._usual,
            errors,
            self._ratios,
            self._lost,
        )

    def _found(self, total: float) -> bool:
        if total <= LIKELY:  # of no thruster can the ratio be larger
            self._same = max(0, self._same - 1)
            return False
        which = int(self._ratios.argmax())
        ratio = float(self._ratios[which])
        next_one = float(np.partition(self._ratios, -2)[-2])
        likely = (
            ratio > LIKELY
            and ratio - next_one > LIKELIER
            and total - ratio < MISFIT
            and float(self._lost[which]) > LEAST_LOST
        )
        if not likely or self._aside(which) > ASIDE:
            self._same = max(0, self._same - 1)
            return False
        self._same = self._same + 1 if which == self._suspect else 1
        self._suspect = which
        if self._same < LOOKS:
            return False
        self._blame(which)
        return True

    def _aside(self, which: int) -> float:
        """Angle from the torque that is missing to this thruster's [rad].

        A cable pulls with newtons, but hardly turns: torque tells a thruster from what touches.
        """
        now, since = self._rows[self._k], self._rows[self._k - NOW]
        until, begin = self._rows[self._k - NOW - PAUSE], self._rows[self._k - NOW - PAUSE - BEFORE]
        after, before = now - since, until - begin
        torque = after[TORQUE] / after[0] - before[TORQUE] / before[0]
        column = -self._A[3:, which]
        along = float(torque @ column)
        across = np.cross(torque, column)
        return float(np.arctan2(np.sqrt(across @ across), along))

    def _blame(self, which: int) -> None:
        """Others, and what else this one loses, are looked for beside it."""
        gains = self.gains.copy()
        gains[which] *= 1.0 - float(self._lost[which])
        gains[which] *= gains[which] > DEAD
        self.gains, self.words = gains, _words(gains)
        self._A = np.ascontiguousarray(self._robot.A * gains)
        self.start()


def _words(gains: Array) -> tuple[str, ...]:
    weak = ((i, g) for i, g in enumerate(gains, 1) if g < 1.0)
    return tuple(
        f"Thruster {i} gives {100.0 * g:.0f} % of its thrust."
        if g > 0.0
        else f"Thruster {i} gives no thrust."
        for i, g in weak
    )
