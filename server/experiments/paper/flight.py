"""One experiment's flight in virtual time: arm, hover, the arm moves, and what happens then."""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass, field

import numpy as np

from hardware.follower import ThrustCommand
from hardware.robot_file import RobotFile
from hardware.sim.hand import make_hand
from hardware.sim.intent import Intent, missed_by
from hardware.sim.lockstep_follower import LockstepFollower
from hardware.sim.truth import Truth
from pipeline.config import TeleopConfig
from pipeline.frames import Array
from pipeline.signals import BodyImu, Mode, Operator, Requests
from pipeline.teleop import Inputs, Output, Teleop
from server.experiments.paper.leader import Leader, Rig
from server.robot_link import RobotLink

PERIOD_S = 0.005
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


@dataclass(frozen=True, slots=True, eq=False)
class Trace:
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
    """One flight; `run` gives its trace."""

    def __init__(
        self,
        robot_file: RobotFile,
        config: TeleopConfig,
        leader: Leader,
        hand: str,
        seed: int = 0,
        push: Push | None = None,
    ) -> None:
        """Everything at rest; `hand` is one of `hardware.sim.hand.HANDS`."""
        robot = robot_file.robot
        self._robot, self._config, self._push = robot, config, push
        self._hand = make_hand(hand, seed=seed, start=robot_file.start, rest_s=HOVER_S)
        self._rig = Rig(leader, self._hand, robot.leds_in_b, seed)
        self._follower = LockstepFollower(robot_file, seed)
        self._link = RobotLink(self._follower)
        self._teleop = Teleop(robot, config, PERIOD_S)
        self._push_in_b = np.zeros(6)
        self._poses: deque[tuple[float, Array, Array]] = deque(maxlen=120)
        self._body: list[BodyImu] = []
        self._mode = Mode.DISARMED
        self._ready = False
        self._intent: Intent | None = None
        self._rows, self._ended = _Rows(), ""

    def run(self, seconds: float) -> Trace:
        """Fly until `seconds` after the arm's move, or until tracking ends."""
        for _ in range(round((HOVER_S + seconds) / PERIOD_S)):
            self._advance()
            if self._ended:
                break
        return self._trace()

    def _advance(self) -> None:
        """One control period of everything."""
        before = self._follower.t
        self._follower.advance(PERIOD_S)
        now, plant = self._follower.t, self._follower.plant
        self._poses.append((now, plant.wxyz_fb, plant.p_bf_in_f))
        felt, seen = self._rig.arrivals(before, now, self._robot_at)
        tracking = self._mode is Mode.TRACK
        if self._push is not None and now >= HOVER_S + self._push.after_s:
            self._push_in_b[1] = self._push.y_n
            self._teleop.push(self._push_in_b)
        inputs = Inputs(
            t=now,
            phone_imu=tuple(felt),
            body_imu=tuple(self._body),
            seen=tuple(seen),
            operator=Operator(now, held=self._mode in (Mode.ARMED, Mode.TRACK), press=1),
            requests=Requests(arm=self._ready),
            refusals=(self._link.reason,) if self._link.reason else (),
        )
        output = self._teleop.step(inputs)
        self._mode = output.failsafe.mode
        self._ready = self._mode is Mode.DISARMED and not output.refusals
        if tracking and self._mode is not Mode.TRACK:
            self._ended = f"{now - HOVER_S:+.2f} s: {output.failsafe.reason}"
        self._body = self._link.exchange(ThrustCommand(output.thrusts, output.armed), now)
        if self._mode is Mode.TRACK:
            self._measure(now, output)

    def _robot_at(self, t: float) -> tuple[Array, Array]:
        times, wxyz, p = zip(*self._poses, strict=True)
        return Truth(np.array(times), np.array(wxyz), np.array(p), np.zeros(0)).at(t)

    def _measure(self, now: float, output: Output) -> None:
        plant = self._follower.plant
        body, hand = (plant.R_fb, plant.p_bf_in_f), self._hand.pose(now)
        if self._intent is None:
            self._intent = Intent(self._config.virtual_camera, hand, body)
        offset_in_f, turn = missed_by(body, self._intent.step(hand, PERIOD_S), self._robot.axes)
        error, view, relative = output.error, output.view, output.relative
        if now < HOVER_S - REST_S or error is None or view is None or relative is None:
            return
        self._rows.t.append(now - HOVER_S)
        self._rows.values.append(
            np.concatenate(
                (
                    view.R_vb.T @ error.e_p_in_v,
                    error.e_eta_in_b,
                    -plant.R_fb.T @ offset_in_f,
                    -turn,
                    relative.p_bc_in_c,
                    [output.saturated],
                    hand[1],
                    self._robot.A @ output.thrusts - self._push_in_b,
                    output.thrusts,
                )
            )
        )

    def _trace(self) -> Trace:
        t, robot = np.array(self._rows.t), self._robot
        width = 25 + robot.A.shape[1]
        rows = np.array(self._rows.values).reshape(-1, width)
        missed = rows[:, 6:12]
        if len(t):
            missed = missed - missed[t < 0.0].mean(axis=0)
        return Trace(
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
