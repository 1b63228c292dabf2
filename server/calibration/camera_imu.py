"""Camera-IMU extrinsics and time delay, from a gyroscope and the turns that images show.

A gyroscope i and the pictures of a board that stands still tell of the same turns:
R_co φ = R_ci (∫ω dt − b Δt), the integral from one picture to the next, both moved by the offset.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy.interpolate import make_interp_spline
from scipy.optimize import least_squares

from hardware.camera_file import TIME_OFFSETS_S
from pipeline.frames import Array, R_co, exp, log
from server.calibration.motion import NEAR_S

OFFSETS_S = np.arange(*TIME_OFFSETS_S, 0.005)
FEWEST_STEPS = 30
FEWEST_SAMPLES = 20
SLOWEST = 0.15
"""Turns must be faster than this (RMS) to tell anything [rad/s]."""
MOST_LEFT = 0.5
"""Of the pictures' turns, by median, unexplained: else the gyroscope felt another motion."""
ENOUGH_BLOCKS = 14
BLOCK_S = 0.5
"""Errors further apart are independent."""
MOST_GAP_S = 0.1


class ImuError(ValueError):
    """Motion samples that can't be used; the text says what to do."""


class GyroSpline:
    """Angular velocity over time, a cubic between samples."""

    def __init__(self, t: Array, omega_in_i: Array) -> None:
        """Samples in order of time (n,) [s], (n, 3) [rad/s]; at least `FEWEST_SAMPLES`."""
        self.t, self.omega_in_i = t, omega_in_i
        self._rate = make_interp_spline(t, omega_in_i, k=3)
        self._angle = self._rate.antiderivative()

    def rate(self, t: Array) -> Array:
        """Angular rate (n, 3) [rad/s]."""
        return np.asarray(self._rate(np.clip(t, self.t[0], self.t[-1])))

    def angle(self, t: Array) -> Array:
        """Its integral (n, 3) [rad]."""
        return np.asarray(self._angle(np.clip(t, self.t[0], self.t[-1])))

    def covers(self, t: Array) -> npt.NDArray[np.bool_]:
        """Whether samples lie around (n,)."""
        after = np.clip(np.searchsorted(self.t, t), 1, len(self.t) - 1)
        inside = (t >= self.t[0]) & (t <= self.t[-1])
        dense = self.t[after] - self.t[after - 1] < MOST_GAP_S
        return np.asarray(inside & dense)


def gyro_of(rows: Array) -> GyroSpline:
    """A gyroscope from finite rows (n, 4 or more): t, gx, gy, gz; times ascend.

    Raises:
        ImuError: too few.
    """
    if len(rows) < FEWEST_SAMPLES:
        raise ImuError(f"imu: {len(rows)} samples; at least {FEWEST_SAMPLES} are needed")
    return GyroSpline(rows[:, 0], rows[:, 1:4])


@dataclass(frozen=True, slots=True, eq=False)
class CameraImu:
    """Found."""

    R_ci: Array
    """(3, 3) sensor's axes in the camera's."""
    time_offset_s: float
    """A picture was taken at its stamp plus this, on the sensor's clock."""
    bias_in_i: Array
    """(3,) of the gyroscope [rad/s]."""
    sigma: Array
    """(7,) of rotation [rad], offset [s], bias [rad/s]."""
    rms: float
    """What is left between both rates [rad/s]."""
    t: Array
    """(n,) middles of the steps, for the report [s]."""
    image_rate: Array
    """(n, 3) the camera's rate in its own axes by the pictures [rad/s]."""
    gyro_rate: Array
    """(n, 3) the same by the gyroscope."""


@dataclass(frozen=True, slots=True, eq=False)
class _Steps:
    begin: Array
    end: Array
    turned_in_c: Array
    """Residuals (n, 3) [rad]."""

    @property
    def dt(self) -> Array:
        return self.end - self.begin


def align(t: Array, R_og: Array, gyro: GyroSpline) -> CameraImu:
    """Compare the turns between neighbouring views in order of time with a gyroscope's.

    Raises:
        ImuError: not enough motion or overlap; says what to do.
    """
    steps = _steps(t, R_og, gyro)
    if len(steps.begin) < FEWEST_STEPS:
        raise ImuError("imu: film and motion samples overlap too little: start both together")
    rate = steps.turned_in_c / steps.dt[:, None]
    if float(np.sqrt((rate * rate).sum(axis=1).mean())) < SLOWEST:
        raise ImuError("imu: turn the camera to and fro about all three axes while filming")
    start = _coarse(steps, gyro)
    found = least_squares(
        lambda x: _residuals(x, start[0], steps, gyro).ravel(),
        np.concatenate((np.zeros(3), [start[1]], start[2])),
        loss="soft_l1",
        f_scale=0.003,
        x_scale=np.array([0.01, 0.01, 0.01, 0.005, 0.01, 0.01, 0.01]),
    )
    x = found.x
    R_ci = exp(x[:3]) @ start[0]
    left = _residuals(x, start[0], steps, gyro)
    is_allowed = TIME_OFFSETS_S[0] <= x[3] <= TIME_OFFSETS_S[1]  # in a camera's file
    if not is_allowed or _typical(left) > MOST_LEFT * _typical(steps.turned_in_c):
        raise ImuError("imu: film and motion samples do not fit each other: swing the camera more")
    middle = 0.5 * (steps.begin + steps.end)
    return CameraImu(
        R_ci=R_ci,
        time_offset_s=float(x[3]),
        bias_in_i=x[4:],
        sigma=_sigma(np.asarray(found.jac), left, middle),
        rms=float(np.sqrt(((left / steps.dt[:, None]) ** 2).mean())),
        t=middle,
        image_rate=rate,
        gyro_rate=(gyro.rate(middle + x[3]) - x[4:]) @ R_ci.T,
    )


def _steps(t: Array, R_og: Array, gyro: GyroSpline) -> _Steps:
    near = np.flatnonzero((np.diff(t) < NEAR_S) & (gyro.covers(0.5 * (t[1:] + t[:-1]))))
    turned = [-(R_co @ log(R_og[k + 1] @ R_og[k].T)) for k in near]
    return _Steps(t[near], t[near + 1], np.array(turned).reshape(-1, 3))


def _coarse(steps: _Steps, gyro: GyroSpline) -> tuple[Array, float, Array]:
    """Rotation, offset, bias by trying offsets, each with its best rotation (Kabsch)."""
    seen = steps.turned_in_c / steps.dt[:, None]
    best: tuple[float, Array, float, Array] | None = None
    for offset in OFFSETS_S:
        angles = gyro.angle(steps.end + offset) - gyro.angle(steps.begin + offset)
        gyro_rate = angles / steps.dt[:, None]
        a, b = seen - seen.mean(axis=0), gyro_rate - gyro_rate.mean(axis=0)
        U, _, Vt = np.linalg.svd(a.T @ b)
        R = U @ np.diag([1.0, 1.0, np.linalg.det(U @ Vt)]) @ Vt
        cost = float(np.abs(a - b @ R.T).mean())
        if best is None or cost < best[0]:
            best = (cost, R, float(offset), gyro_rate.mean(axis=0) - R.T @ seen.mean(axis=0))
    assert best is not None
    return best[1:]


def _residuals(x: Array, R_ci: Array, steps: _Steps, gyro: GyroSpline) -> Array:
    """(n, 3) [rad]."""
    angles = gyro.angle(steps.end + x[3]) - gyro.angle(steps.begin + x[3])
    gyro_rate = (angles - x[4:] * steps.dt[:, None]) @ (exp(x[:3]) @ R_ci).T
    left: Array = steps.turned_in_c - gyro_rate
    return left


def _typical(turns: Array) -> float:
    """Median size of turns (n, 3): a cut in the film is one of many."""
    return float(np.median(np.sqrt((turns * turns).sum(axis=1))))


def _sigma(J: Array, left: Array, t: Array) -> Array:
    """Standard deviations (7,), errors within a block of time being alike."""
    bread = np.linalg.pinv(J.T @ J)
    plain = np.diag(bread) * float((left * left).mean())
    scores = (J * left.ravel()[:, None]).reshape(-1, 3, J.shape[1]).sum(axis=1)
    block = ((t - t[0]) / BLOCK_S).astype(int)
    sums = np.array([scores[block == one].sum(axis=0) for one in np.unique(block)])
    spread = len(sums) / max(len(sums) - J.shape[1], 1)
    sandwich = spread * np.diag(bread @ (sums.T @ sums) @ bread)
    # errors of neighbouring steps cancel, for they share a view: the scatter of blocks knows
    return np.asarray(
        np.sqrt(sandwich if len(sums) >= ENOUGH_BLOCKS else np.maximum(plain, sandwich))
    )
