"""Statuses of control, as a recording has them, to flights that a plant can be found by."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

import numpy as np

from hardware.system_identification.flight_record import FlightRecord
from pipeline.control.failsafe import FLYING
from pipeline.frames import Array, R_from_wxyz
from server.control.ipc import ControlStatus
from server.export.decoded import RecordedState

GAP_S = 0.05
"""Between two commands, motion samples or attitudes: what was in between is unknown."""
LEAST_STATUSES = 50
"""A second."""
State = ControlStatus | RecordedState


def flights_of(states: Iterable[State]) -> Iterator[FlightRecord]:
    """Each segment of flight without a gap that says enough to look at."""
    for segment in _segments(states):
        if len(segment) >= LEAST_STATUSES:
            yield _record(segment)


def _segments(states: Iterable[State]) -> Iterator[list[State]]:
    """Statuses that follow each other, all of them in flight and with an attitude."""
    segment: list[State] = []
    for state in states:
        flies = state.mode in FLYING and state.R_cb_wxyz is not None and state.R_fc_wxyz is not None
        follows = not segment or _follows(segment[-1], state)
        if segment and not (flies and follows):
            yield segment
            segment = []
        if flies and state.body_samples:
            segment.append(state)
    yield segment


def _follows(before: State, state: State) -> bool:
    """Whether nothing is missing between two statuses of one robot."""
    if len(state.thrusts) != len(before.thrusts):
        return False
    if not state.body_samples:
        return True  # its samples come with the next one, if they come
    times = [before.body_samples[-1][0], *(row[0] for row in state.body_samples)]
    return state.t - before.t <= GAP_S and bool((np.diff(times) <= GAP_S).all())


def _record(segment: list[State]) -> FlightRecord:
    imu = np.array([row for state in segment for row in state.body_samples])
    imu = imu[np.unique(imu[:, 0], return_index=True)[1]]
    commands = np.array([row for state in segment for row in _commands(state)])
    return FlightRecord(
        commands[:, 0],
        commands[:, 1:],
        imu[:, 0],
        imu[:, 1:4],
        imu[:, 4:7],
        np.array([state.t for state in segment]),
        np.array([_attitude(state) for state in segment]),
    )


def _attitude(state: State) -> Array:
    """R_fb (3, 3) of a status that has it."""
    assert state.R_fc_wxyz is not None
    assert state.R_cb_wxyz is not None
    R_fb: Array = R_from_wxyz(state.R_fc_wxyz) @ R_from_wxyz(state.R_cb_wxyz)
    return R_fb


def _commands(state: State) -> list[tuple[float, ...]]:
    """All since the status before; of older recordings the last one alone."""
    whole = [row for row in state.commands if len(row) == 1 + len(state.thrusts)]
    return whole or [(state.t, *state.thrusts)]
