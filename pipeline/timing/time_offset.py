"""Coarse camera-IMU time delay by correlating images with motion samples over a range of shifts.

Both gyroscopes say how the body turned relative to the camera, ω_b − R_cbᵀ ω_c, up to a constant
attitude and slow biases; the pictures say the same at their own stamps. Of all shifts within reach
the one that fits best is the offset, if no other fits nearly as well: tremor repeats itself after a
ninth of a second, and a wrong lock is worse than none. The filter refines it online as a state
(Li & Mourikis, Int. J. Robotics Research 33 (2014) 947).

A robot that tells its motion in place of sensing it may tell it late: then its turns date pictures
only as far as that lateness is known, and the phone's have to.
"""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass
from typing import Final

import numpy as np
import numpy.typing as npt

from pipeline.estimator_config import TimeOffsetConfig
from pipeline.frames import Array, R_from_wxyz, wxyz_from_R
from pipeline.imu_stream import ImuStreams
from pipeline.timing.quaternions import conjugate, matrices, product, small_vectors

PARAMETERS: Final = 7
"""Constant attitude, bias of the body's gyroscope, offset."""
STILL = "Move the phone a little."
RIVALS = "Move the phone a little, not to and fro: two time offsets fit alike."
MISFIT = "What the phone's gyroscope feels is not what its pictures show."
FAR = "The pictures are dated wrongly, by about {ms:+.0f} ms: reload the page."
WAITING = "Waiting for pictures and motion samples."


@dataclass(frozen=True, slots=True)
class Offset:
    """A picture was taken at its stamp plus `value_s`."""

    value_s: float
    sigma_s: float
    """Standard deviation, the misfit of the pictures included."""
    quality: float
    """How much worse the best rival fits, over what is demanded: at least 1."""
    since: float
    t: float
    """Stamps of the first and the newest picture it rests on [s]."""


@dataclass(frozen=True, slots=True, eq=False)
class _AttitudeByShift:
    """What a picture makes of the unknown constant attitude, were it taken at each shift."""

    t: float
    wxyz: Array
    """(shifts, 4): start of the camera's gyroscope ← start of the body's."""
    wxyz_b: Array
    """(4,) start of the body's gyroscope ← b, for a shift of 0."""
    turns_on: Array
    """(shifts, 3) of the body until `late_s` later, in the axes of its gyroscope's start [rad]."""
    covariance: Array
    """(3, 3) of the picture's attitude, in the axes of the left side [rad²]."""


class TimeOffset:
    """Streaming: give it all pictures, ask it now and then."""

    def __init__(self, config: TimeOffsetConfig, imus: ImuStreams, is_told: bool = False) -> None:
        """Begin without a picture; somebody else fills `imus`, the body's as `is_told` or felt."""
        self._config, self._imus = config, imus
        self._late_s = config.late_s if is_told else 0.0
        steps = round(config.reach_s / config.step_s)
        self._shifts: Array = config.step_s * np.arange(-steps, steps + 1, dtype=np.float64)
        self._gap_end = np.inf
        """Of the last gap of either gyroscope [s]."""
        self._waiting: deque[tuple[float, Array, Array]] = deque(maxlen=32)
        self._seen: deque[_AttitudeByShift] = deque()
        self._new = 0
        self._offset: Offset | None = None
        self.reason = WAITING
        """Why there is no estimate; empty if there is."""

    def add_pose(self, t: float, R_cb: Array, covariance: Array | None = None) -> None:
        """Take a picture's attitude with its stamp `t` [s].

        Args:
            t: Stamp [s].
            R_cb: (3, 3).
            covariance: (3, 3) of θ in b [rad²] with R = R̂ Exp(θ); None: alike in all directions.
        """
        C = np.eye(3) * self._config.sigma_R**2 if covariance is None else covariance
        C_in_c = R_cb @ C @ R_cb.T
        self._waiting.append((t, np.array(wxyz_from_R(R_cb)), C_in_c))

    def estimate(self) -> Offset | None:
        """The offset by the pictures of the window; None with a `reason`."""
        self._add_covered_poses()
        if self._new >= self._config.every:
            self._new = 0
            judged = self._judged()
            self._offset = judged if isinstance(judged, Offset) else None
            self.reason = "" if isinstance(judged, Offset) else judged
        return self._offset

    def _add_covered_poses(self) -> None:
        """Pictures whose neighbourhood both gyroscopes have covered by now."""
        reach, config, phone, body = self._config.reach_s, self._config, *self._imus.both
        until, since = min(phone.newest, body.newest), max(phone.oldest, body.oldest)
        gap_end = max(phone.gap_end, body.gap_end)
        if gap_end != self._gap_end and self._seen:  # nothing fits across a gap
            self._seen.clear()
            self._new = config.every
        self._gap_end = gap_end
        while self._waiting and self._waiting[0][0] + reach + self._late_s <= until:
            t, wxyz_cb, C_in_c = self._waiting.popleft()
            if t - reach < since or (self._seen and t <= self._seen[-1].t):
                continue
            times = t + self._shifts
            from_camera, from_body = phone.attitudes(times), body.attitudes(times)
            wxyz = product(product(from_camera, wxyz_cb), conjugate(from_body))
            middle = len(times) // 2
            R_ic = R_from_wxyz(from_camera[middle])
            later = body.attitudes(times + self._late_s) if self._late_s > 0.0 else from_body
            turns_on = small_vectors(product(later, conjugate(from_body)))
            self._seen.append(
                _AttitudeByShift(t, wxyz, from_body[middle], turns_on, R_ic @ C_in_c @ R_ic.T)
            )
            self._new += 1
        while self._seen and self._seen[0].t < self._seen[-1].t - config.window_s:
            self._seen.popleft()

    def _judged(self) -> Offset | str:
        """The best shift if it stands alone, or why it does not."""
        config, n = self._config, len(self._seen)
        if n < config.min_pictures or self._seen[-1].t - self._seen[0].t < config.min_span_s:
            return WAITING
        chi2 = self._misfits()
        best = int(np.argmin(chi2))
        excess = max(1.0, float(chi2[best]) / (3 * n - PARAMETERS))
        if excess > config.max_excess:
            return MISFIT
        rise = (chi2 - chi2[best]) / excess
        margins = rise / np.maximum(config.gate_chi2, config.gate_ridge * _ridges(rise, best))
        far = np.abs(self._shifts - self._shifts[best]) > config.basin_s
        quality = float(margins[far].min())
        value, curvature = _parabola(self._shifts, rise, best)
        if quality < 1.0 or curvature <= 0.0 or best in (0, len(rise) - 1):
            return STILL if _is_one_valley(margins < 1.0) else RIVALS
        sigma = float(np.hypot(np.sqrt(2.0 / curvature), config.floor_s))
        if sigma > config.max_sigma_s:
            return STILL
        if abs(value) > config.max_s:
            return FAR.format(ms=1e1 * round(1e2 * value))
        return Offset(value, sigma, quality, self._seen[0].t, self._seen[-1].t)

    def _misfits(self) -> Array:
        """χ² by shift, (shifts,): what constant attitude and bias leave unexplained."""
        seen = self._seen
        middle = seen[len(seen) // 2]
        wxyz = np.array([one.wxyz for one in seen])
        errors = small_vectors(product(wxyz, conjugate(middle.wxyz)))  # (n, shifts, 3)
        C = np.mean([one.covariance for one in seen], axis=0) + np.eye(3) * self._config.floor_R**2
        W = np.linalg.cholesky(np.linalg.inv(C)).T
        flat = (errors @ W.T).transpose(0, 2, 1).reshape(3 * len(seen), -1)
        basis, _ = np.linalg.qr((W @ self._explained(middle)).reshape(3 * len(seen), 6))
        left = flat - basis @ (basis.T @ flat)
        chi2: Array = np.square(left).sum(axis=0)
        if self._late_s == 0.0:
            return chi2
        R_ij = R_from_wxyz(middle.wxyz[len(self._shifts) // 2])
        late = np.array([one.turns_on for one in seen]) @ (W @ R_ij).T
        late = late.transpose(0, 2, 1).reshape(3 * len(seen), -1)
        late -= basis @ (basis.T @ late)
        # best share of `late_s`, of which nothing is known but that it is 0 ± 1
        chi2 -= np.square((late * left).sum(axis=0)) / (np.square(late).sum(axis=0) + 1.0)
        return chi2

    def _explained(self, middle: _AttitudeByShift) -> Array:
        """(n, 3, 6) what a constant turn and a bias of the body's gyroscope do to the errors."""
        t = np.array([one.t for one in self._seen])
        R_jb = matrices(np.array([one.wxyz_b for one in self._seen]))
        steps = 0.5 * np.diff(t)[:, None, None] * (R_jb[1:] + R_jb[:-1])
        turned = np.concatenate((np.zeros((1, 3, 3)), np.cumsum(steps, axis=0)))
        R_ij = R_from_wxyz(middle.wxyz[len(self._shifts) // 2])
        return np.concatenate((np.broadcast_to(np.eye(3), turned.shape), R_ij @ turned), axis=2)


def _parabola(shifts: Array, chi2: Array, best: int) -> tuple[float, float]:
    """Lowest point [s] and curvature [1/s²] of a parabola through χ² around its least value."""
    first, last = max(0, best - 2), min(len(shifts), best + 3)
    x = shifts[first:last] - shifts[best]
    a, b, _ = np.polyfit(x, chi2[first:last], 2)
    if a <= 0.0:
        return float(shifts[best]), 0.0
    step = float(shifts[1] - shifts[0])
    return float(shifts[best] + np.clip(-0.5 * b / a, -step, step)), float(2.0 * a)


def _ridges(rise: Array, best: int) -> Array:
    """What is highest between the best shift and each one."""
    left = np.maximum.accumulate(rise[best::-1])[::-1]
    return np.concatenate((left, np.maximum.accumulate(rise[best:])[1:]))


def _is_one_valley(alike: npt.NDArray[np.bool_]) -> bool:
    """Whether nothing stands between the shifts that fit alike."""
    where = np.flatnonzero(alike)
    return bool(alike[where[0] : where[-1] + 1].all())
