"""One experiment's flight in virtual time: arm, hover, the arm moves, and what happens then."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from hardware.robot_file import RobotFile
from hardware.sim.hand import Hand, make_hand
from pipeline.config import PERIOD_S, TeleopConfig
from pipeline.frames import Array
from pipeline.signals import Mode
from pipeline.teleop import Output
from server.simulation.sensors import Leader, prompt
from server.simulation.virtual_time import VirtualTimeSimulation

HOVER_S = 8.0
"""From switching on to the arm's move; tracking begins within the first second."""
REST_S = 1.0
"""Before the move; the mean error in it is the reference's own, not the move's."""


@dataclass(frozen=True, slots=True)
class Push:
    """A force that the thrusters are made to give beside what control asks for. Sec. V-C.2."""

    after_s: float
    """Since the arm's move [s]."""
    y_n: float
    """Along y_b [N]."""


@dataclass(frozen=True, slots=True)
class Move:
    """What is done to a robot that hovers."""

    hand: str
    """How the arm moves, of `hardware.sim.hand.HANDS`."""
    push: Push | None = None


@dataclass(frozen=True, slots=True, eq=False)
class ExperimentTrace:
    """Rows since `REST_S` before the arm's move, one a control period; SI."""

    t: Array
    """(n,) since the move [s]."""
    error_in_b: Array
    """(n, 6) the controller's error: reference less what it believes, the paper's measure."""
    missed_in_b: Array
    """(n, 6) the true one: where the body was meant to be less where it is."""
    p_bc_in_c: Array
    """(n, 3) as estimated."""
    thrusts: Array
    """(n, m) asked of the thrusters [N]."""
    wrench_in_b: Array
    """(n, 6) that control asked for, as far as the thrusters could give it [N, N m]."""
    saturated: Array
    """(n,) 1 where the thrusters could not give the wrench."""
    moved: Array
    """(n, 3) of the camera since the start [m]."""
    ended: str
    """Why tracking ended early, or ""."""


@dataclass(slots=True)
class _Rows:
    t: list[float] = field(default_factory=list)
    values: list[Array] = field(default_factory=list)


class Flight:
    """One flight; `run` gives its trace, `hover` what all moves begin with."""

    def __init__(
        self,
        robot_file: RobotFile,
        config: TeleopConfig,
        leader: Leader,
        seed: int = 0,
    ) -> None:
        """Everything at rest."""
        self._robot, self._start, self._seed = robot_file.robot, robot_file.start, seed
        still = self._hand("still")
        self._loop = VirtualTimeSimulation(robot_file, config, leader.scene(seed), prompt(), still)
        self._push: Push | None = None
        self._push_in_b = np.zeros(6)
        self._rows, self._ended = _Rows(), ""

    def hover(self) -> None:
        """Fly until just before the arm's move, whatever that will be."""
        self._fly_until(HOVER_S - 2.0 * PERIOD_S)

    def run(self, move: Move, seconds: float) -> ExperimentTrace:
        """Fly until `seconds` after the arm's move, or until tracking ends."""
        self._push, self._loop.phone.hand = move.push, self._hand(move.hand)
        self._fly_until(HOVER_S + seconds)
        if not self._ended and not self._rows.t:
            self._ended = "tracking never began"
        return self._trace()

    def _hand(self, name: str) -> Hand:
        """It rests until the arm's move."""
        return make_hand(name, seed=self._seed, start=self._start, rest_s=HOVER_S)

    def _fly_until(self, t: float) -> None:
        for _ in range(round((t - self._loop.t) / PERIOD_S)):
            if self._ended:
                return
            self._advance()

    def _advance(self) -> None:
        """One control period of everything."""
        loop, after_s = self._loop, self._loop.t + PERIOD_S - HOVER_S
        if self._push is not None and after_s >= self._push.after_s:
            self._push_in_b[1] = self._push.y_n
            loop.controller.teleop.push(self._push_in_b)
        output = loop.advance()
        if loop.trace.left:
            self._ended = f"{loop.t - HOVER_S:+.2f} s: {loop.trace.left}"
        if output.failsafe.mode is Mode.TRACK:
            self._measure(loop.t, output)

    def _measure(self, now: float, output: Output) -> None:
        hand, body = self._loop.truth()
        offset_in_f, turn = self._loop.trace.error_in_f[-1], self._loop.trace.turn[-1]
        error, view, relative = output.error, output.view, output.relative
        if now < HOVER_S - REST_S or error is None or view is None or relative is None:
            return
        self._rows.t.append(now - HOVER_S)
        self._rows.values.append(
            np.concatenate(
                (
                    view.R_vb.T @ error.e_p_in_v,
                    error.e_eta_in_b,
                    -body[0].T @ offset_in_f,
                    -turn,
                    relative.p_bc_in_c,
                    [output.saturated],
                    hand[1],
                    self._robot.A @ output.thrusts - self._push_in_b,
                    output.thrusts,
                )
            )
        )

    def _trace(self) -> ExperimentTrace:
        t, robot = np.array(self._rows.t), self._robot
        width = 25 + robot.A.shape[1]
        rows = np.array(self._rows.values).reshape(-1, width)
        missed = rows[:, 6:12]
        if len(t):
            missed = missed - missed[t < 0.0].mean(axis=0)
        return ExperimentTrace(
            t,
            rows[:, :6],
            missed,
            rows[:, 12:15],
            rows[:, 25:],
            rows[:, 19:25],
            rows[:, 15],
            rows[:, 16:19] - rows[:1, 16:19],
            self._ended,
        )
