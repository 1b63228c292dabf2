"""Predictions of a filter for the times of images that are only now looked at."""

from __future__ import annotations

from bisect import bisect_left
from dataclasses import dataclass
from math import isfinite
from operator import attrgetter

from pipeline.frames import Array, exp, log
from pipeline.imu_stream import MAX_GAP_S
from pipeline.signals import RelativeState

REMEMBERED_S = 1.0


@dataclass(frozen=True, slots=True, eq=False)
class Prediction:
    """A filter's prediction for a time, made without the picture of that time."""

    t: float
    """[s]."""
    p_bc_in_c: Array
    """(3,) [m]."""
    R_cb: Array
    """(3, 3)."""
    u_bf_in_c: Array
    """(3,) [m/s]: as in `RelativeState`."""
    sigma_p: float
    """Largest standard deviation of the position [m]."""
    sigma_theta: float
    """Largest standard deviation of the attitude [rad]."""
    time_offset: float = 0.0
    """Of the pictures' stamps, as the filter knows it: taken at the stamp plus this [s]."""

    @classmethod
    def of(cls, state: RelativeState, time_offset: float) -> Prediction:
        """What a filter's state says of its own time; a `time_offset` of NaN is none."""
        place = (state.p_bc_in_c, state.R_cb, state.u_bf_in_c)
        offset = time_offset if isfinite(time_offset) else 0.0
        return cls(state.t, *place, state.sigma_p, state.sigma_theta, offset)


class PredictionHistory:
    """The last second of predictions. One thread may add while another one asks."""

    def __init__(self) -> None:
        """Begin without a prediction."""
        self._rows: tuple[Prediction, ...] = ()

    def add(self, expected: Prediction | None) -> None:
        """The filter's newest prediction; None when it has none: then all before is void."""
        if expected is None or (self._rows and expected.t <= self._rows[-1].t):
            self._rows = ()  # another life of the filter
        if expected is not None:
            recent = (row for row in self._rows if expected.t - row.t <= REMEMBERED_S)
            self._rows = (*recent, expected)

    def at(self, stamp: float) -> Prediction | None:
        """Prediction for a picture's stamp [s]; None outside what is remembered."""
        rows = self._rows
        if not rows:
            return None
        t = stamp + rows[-1].time_offset
        k = bisect_left(rows, t, key=attrgetter("t"))
        if k == len(rows):
            return None
        if rows[k].t == t:
            return rows[k]
        if k == 0 or rows[k].t - rows[k - 1].t > MAX_GAP_S:
            return None
        return _between(rows[k - 1], rows[k], t)


def _between(before: Prediction, after: Prediction, t: float) -> Prediction:
    """Interpolate two predictions; as unsure as the worse of them."""
    share = (t - before.t) / (after.t - before.t)
    return Prediction(
        t=t,
        p_bc_in_c=before.p_bc_in_c + share * (after.p_bc_in_c - before.p_bc_in_c),
        R_cb=before.R_cb @ exp(share * log(before.R_cb.T @ after.R_cb)),
        u_bf_in_c=before.u_bf_in_c + share * (after.u_bf_in_c - before.u_bf_in_c),
        sigma_p=max(before.sigma_p, after.sigma_p),
        sigma_theta=max(before.sigma_theta, after.sigma_theta),
        time_offset=after.time_offset,
    )
