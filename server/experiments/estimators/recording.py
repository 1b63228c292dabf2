"""A recording for the estimators: vision runs once, each of them hears the same.

There is no truth. What each predicted for the time of a picture, before it arrived, is compared
with the pose which that picture then gave: covariances add.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field
from math import nan
from typing import Final

import numpy as np

from hardware.sim.world.evaluator import Errors, EstimatorRun
from hardware.sim.world.sensors import Event, Sample, play
from pipeline.config import EstimatorName
from pipeline.estimation.estimator import Estimator, Fusion
from pipeline.frames import Array, exp, log
from pipeline.signals import BodyImu, PhoneImu, RelativePose, RelativeState, VisionMeasurement
from server.control.ipc_inputs import Input
from server.recording.reader import Recording
from server.recording.writer import RecordingError
from server.replay.offline import Offline

SETTLE_S: Final = 1.0
"""After the first pose, before anything is judged."""
Maker = Callable[[EstimatorName, Array], Estimator]
Prediction = tuple[float, RelativeState, Array]
"""(t [s], state, covariance)."""


@dataclass(slots=True)
class EstimatorInputs:
    """What control heard."""

    times: list[float] = field(default_factory=list)
    events: list[Event] = field(default_factory=list)
    poses: list[tuple[float, RelativePose]] = field(default_factory=list)
    """With the arrival of each [s]."""

    def tap(self, now: float, inbox: Sequence[Input], body: Sequence[BodyImu]) -> None:
        """Take one period."""
        self.times.append(now)
        self.events += [(now, sample) for sample in body]
        for message in inbox:
            if isinstance(message, PhoneImu):
                self.events.append((now, message))
            elif isinstance(message, VisionMeasurement):
                self.events.append((now, message))
                if message.pose is not None:
                    self.poses.append((now, message.pose))


def play_recording(
    recording: Recording, names: Iterable[EstimatorName], make: Maker
) -> tuple[dict[EstimatorName, EstimatorRun], float]:
    """A track of each estimator, its times since the recording's begin, and from when to judge.

    Raises:
        RecordingError: damaged, or the robot is seen in none of its pictures.
    """
    tape = EstimatorInputs()
    offline = Offline(recording, tape.tap)
    for _ in offline.rows():
        pass
    if not tape.poses:
        raise RecordingError(recording.path, "the robot is in none of its pictures", "another one")
    leds, first = offline.robot.leds_in_b, recording.t_first
    tracks = {name: _track(tape, make(name, leds), first) for name in names}
    return tracks, tape.poses[0][0] - first + SETTLE_S


def _track(tape: EstimatorInputs, estimator: Estimator, t_first: float) -> EstimatorRun:
    predicted: list[Prediction] = []
    health = []
    for now, state in play(estimator, tape.events, tape.times, _nobody):
        if state is not None:
            predicted.append((now, state, estimator.covariance))
        report = estimator.health
        health.append((now - t_first, report.nis, report.time_offset, report.time_offset_sigma))
    offset = health[-1][2] if np.isfinite(health[-1][2]) else 0.0
    errors = _compare(predicted, tape.poses, offset, t_first)
    unknown = np.full((len(errors.t), 3), nan)
    nothing = Errors(np.empty(0), np.empty((0, 6)), np.empty((0, 6, 6)))
    return EstimatorRun(errors, nothing, unknown, unknown, np.array(health))


def _compare(
    predicted: list[Prediction],
    poses: list[tuple[float, RelativePose]],
    offset: float,
    t_first: float,
) -> Errors:
    """Compare at the time of each pose: its stamp and the `offset` [s] that was learnt."""
    t, e, C = [], [], []
    times = [prediction[0] for prediction in predicted]
    for arrival, pose in poses:
        taken = pose.t + offset
        after = int(np.searchsorted(times, taken))
        t.append(taken - t_first)
        if not 0 < after < len(times) or times[after] >= arrival:
            e.append(np.full(6, nan))
            C.append(np.full((6, 6), nan))
            continue
        p, R = _between(predicted[after - 1], predicted[after], taken)
        e.append(np.concatenate((pose.p_bc_in_c - p, log(R.T @ pose.R_cb))))
        C.append(predicted[after][2] + pose.covariance)
    return Errors(np.array(t), np.array(e), np.array(C))


def _between(before: Prediction, after: Prediction, t: float) -> tuple[Array, Array]:
    """(p, R) at `t` [s], between two periods."""
    (t0, a, _), (t1, b, _) = before, after
    share = (t - t0) / (t1 - t0)
    p: Array = (1.0 - share) * a.p_bc_in_c + share * b.p_bc_in_c
    return p, a.R_cb @ exp(share * log(a.R_cb.T @ b.R_cb))


def _nobody(sample: Sample, fusion: Fusion | None) -> None:
    """Doesn't listen."""
