"""Motions known by their statistics: a hand that trembles, a robot that sways.

Linear processes driven by white noise, so that the posterior Cramér-Rao bound knows all of them; a
hand of sines with exact derivatives at any time is `hardware/sim/hand.py`.
A motion is an array (3, n, 6): value, rate and acceleration, at n times, of x, y, z [m], roll,
pitch, yaw [rad].
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from scipy.linalg import expm, solve_continuous_lyapunov

from hardware.sim.hand_parts import TREMOR_DEG, TREMOR_M
from hardware.sim.world.rotations import rates_each, rpy_each, turn_each
from pipeline.frames import GRAVITY, Array

POLES: Final = np.pi
"""Three of them at 0.5 Hz [rad/s]."""
TREMOR_SIGMA: Final = (TREMOR_M, float(np.deg2rad(TREMOR_DEG)))
"""Of a hand [m, rad]."""
MUSCLE_S: Final = 0.008
"""Low pass between the noise and the force that drives a tremor."""


@dataclass(frozen=True, slots=True, eq=False)
class LinearProcess:
    """A linear process of σ = 1 driven by white noise, or by nothing."""

    A: Array
    """(m, m) dynamics."""
    stationary: Array
    """(m, m) covariance at any time."""

    def step(self, h: float) -> tuple[Array, Array]:
        """Transition (m, m) over `h` [s] and the covariance of what the noise adds; exact."""
        Phi: Array = expm(self.A * h)
        Q = self.stationary - Phi @ self.stationary @ Phi.T
        return Phi, 0.5 * (Q + Q.T)


def three_pole(w: float = POLES) -> LinearProcess:
    """Value, rate, acceleration of white jerk through three poles at `w` [rad/s]."""
    A = np.array([[0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [-(w**3), -3.0 * w**2, -3.0 * w]])
    v, a = w**2 / 3.0, w**4
    return LinearProcess(A, np.array([[1.0, 0.0, -v], [0.0, v, 0.0], [-v, 0.0, a]]))


def tremor(omega: float, relaxation: float) -> LinearProcess:
    """Value, rate, muscle force of an oscillation of `omega` [rad/s] that forgets itself.

    Physiological tremor is a second order linear stochastic process (Timmer et al. 1998,
    arXiv chao-dyn/9805011); its envelope fades with `relaxation` [s]. With inf it is a sine.
    """
    damping = 2.0 / relaxation
    A = np.array([[0.0, 1.0, 0.0], [-(omega**2), -damping, 1.0], [0.0, 0.0, -1.0 / MUSCLE_S]])
    if not np.isfinite(relaxation):
        return LinearProcess(A, np.diag((1.0, omega**2, 0.0)))
    C: Array = solve_continuous_lyapunov(A, np.diag((0.0, 0.0, -1.0)))
    return LinearProcess(A, C / C[0, 0])


def wander(rng: np.random.Generator, n: int, h: float, processes: Sequence[LinearProcess]) -> Array:
    """Draw states (n, m, k) of the k processes, a step of `h` [s]."""
    Phi, Q = (np.array(each) for each in zip(*(p.step(h) for p in processes), strict=True))
    start = np.array([p.stationary for p in processes])
    k, m = start.shape[:2]
    x = np.empty((n, k, m, 1))
    x[0] = _root(start) @ rng.normal(size=(k, m, 1))
    noise = _root(Q) @ rng.normal(size=(n, k, m, 1))
    for j in range(n - 1):
        x[j + 1] = Phi @ x[j] + noise[j]
    return x[..., 0].transpose(0, 2, 1)


def slow_motion(rng: np.random.Generator, n: int, h: float, sigma: tuple[float, float]) -> Array:
    """Three poles, σ [m, rad], a step of `h` [s]."""
    x = wander(rng, n, h, [three_pole()] * 6)
    motion: Array = x.transpose(1, 0, 2) * np.repeat(sigma, 3)
    return motion


def tremor_motion(
    rng: np.random.Generator, t: Array, relaxation: float, hz: tuple[float, float]
) -> tuple[Array, Array]:
    """Draw a tremor at equidistant times `t` (n,) [s]; also its frequencies (6,) [rad/s]."""
    omega, sigma = 2.0 * np.pi * rng.uniform(*hz, 6), np.repeat(TREMOR_SIGMA, 3)
    if np.isfinite(relaxation):
        x = wander(rng, len(t), t[1] - t[0], [tremor(float(w), relaxation) for w in omega])
        value, rate, force = x.transpose(1, 0, 2)
        acceleration = force - 2.0 / relaxation * rate - omega**2 * value
        return sigma * np.stack((value, rate, acceleration)), omega
    phase = omega * t[:, None] + rng.uniform(0.0, 2.0 * np.pi, 6)
    rows = (np.sin(phase), omega * np.cos(phase), -(omega**2) * np.sin(phase))
    return np.sqrt(2.0) * sigma * np.stack(rows), omega


def _root(C: Array) -> Array:
    """Square roots of covariances (k, m, m) of any rank."""
    values, vectors = np.linalg.eigh(C)
    root: Array = vectors * np.sqrt(np.maximum(values, 0.0))[:, None, :]
    return root


def imu_of(motion: Array) -> tuple[Array, Array, Array]:
    """Attitude (n, 3, 3) in f; what an ideal IMU reads (n, 3), in own axes: ω [rad/s], f [m/s²]."""
    eta, rates = motion[0, :, 3:], motion[1, :, 3:]
    R = rpy_each(eta)
    omega = turn_each(rates_each(eta), rates)
    up = np.array([0.0, 0.0, GRAVITY])
    return R, omega, turn_each(R.transpose(0, 2, 1), motion[2, :, :3] + up)
