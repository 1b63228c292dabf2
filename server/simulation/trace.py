"""What a flight in virtual time came to, beside what the hand meant."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

from hardware.sim.reference_trajectory import Pose, ReferenceTrajectory, missed_by
from pipeline.config import VirtualCameraConfig
from pipeline.frames import Array
from pipeline.signals import Mode
from pipeline.teleop import Output


@dataclass(slots=True)
class TrackingTrace:
    """What happened while tracking, short gaps included, one row a tick."""

    t: list[float] = field(default_factory=list)
    coasts: list[bool] = field(default_factory=list)
    """In a gap."""
    error_in_f: list[Array] = field(default_factory=list)
    """Body minus intended place, along the controlled axes (3,) [m]."""
    turn: list[Array] = field(default_factory=list)
    """From the intended attitude (3,) [rad]."""
    estimate_error_in_c: list[Array] = field(default_factory=list)
    """Estimated minus true relative position (3,) [m]."""
    thrusts: list[Array] = field(default_factory=list)
    saturated: list[bool] = field(default_factory=list)
    at_limit: list[bool] = field(default_factory=list)
    """It was led to where it can't go."""
    intended_in_f: list[Array] = field(default_factory=list)
    body_in_f: list[Array] = field(default_factory=list)
    pictures: int = 0
    poses: int = 0
    leds: list[int] = field(default_factory=list)
    """Named in each picture."""
    left: str = ""
    """Why tracking ended, if it did."""


class TrackingEvaluator:
    """Keeps the trace: compares with what the hand meant, since the button was pressed."""

    def __init__(
        self, config: VirtualCameraConfig, axes: npt.NDArray[np.bool_], period_s: float
    ) -> None:
        """`axes` (6,): which of b are controlled; `period_s`: from one look to the next."""
        self.trace = TrackingTrace()
        self._config, self._axes, self._period_s = config, axes, period_s
        self._reference: ReferenceTrajectory | None = None

    def look(self, t: float, body: Pose, hand: Pose, output: Output) -> None:
        """Take the true poses of body and camera at `t` [s], and what control made of them."""
        trace = self.trace
        if output.failsafe.mode not in (Mode.TRACK, Mode.COAST):
            trace.left = output.failsafe.reason if self._reference is not None else ""
            return
        if self._reference is None:
            self._reference = ReferenceTrajectory(self._config, hand, body)
        intended = self._reference.step(hand, self._period_s)
        offset_in_f, turn = missed_by(body, intended, self._axes)
        trace.t.append(t)
        trace.coasts.append(output.failsafe.mode == Mode.COAST)
        trace.error_in_f.append(offset_in_f)
        trace.turn.append(turn)
        trace.intended_in_f.append(intended[1])
        trace.body_in_f.append(body[1])
        trace.thrusts.append(output.thrusts)
        trace.saturated.append(output.saturated)
        trace.at_limit.append(output.at_limit)
        if output.relative is not None:
            p_bc_in_c = output.relative.p_bc_in_c
            trace.estimate_error_in_c.append(p_bc_in_c - hand[0].T @ (body[1] - hand[1]))
