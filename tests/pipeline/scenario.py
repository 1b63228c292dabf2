"""A hand that holds a phone and a robot on a suspension: truth, and what the sensors say of it.

Everything happens on a grid of 1 ms. Hand: three poles at 0.5 Hz (5 cm, 3° RMS) and a tremor of
9 Hz (0.05 mm, 0.03°); robot: the same with 6 cm, 4°. Noise, latency and biases are those of a phone
with Chromium's rounding and of a small flight controller.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field

import numpy as np
from scipy.linalg import expm

from pipeline.frames import GRAVITY
from pipeline.signals import BodyImu, PhoneImu, RelativePose

H = 1e-3
LEDS_IN_B = np.array(
    [
        [0.28, 0.0, 0.05],
        [0.0, 0.3, -0.06],
        [-0.05, -0.3, -0.03],
        [-0.2, 0.05, 0.2],
        [0.05, -0.1, 0.28],
    ]
)
FOCAL_PX, NOISE_PX = 900.0, 0.4


@dataclass(frozen=True)
class Setup:
    """What differs between scenarios; SI and radians."""

    seed: int = 0
    duration: float = 20.0
    picture_delay: tuple[float, float] = (0.060, 0.120)
    picture_period: float = 1.0 / 30.0
    phone_delay: tuple[float, float] = (0.015, 0.040)
    body_delay: tuple[float, float] = (0.001, 0.004)
    hidden: tuple[float, float] = (np.inf, np.inf)
    eta_bc: tuple[float, float, float] = (0.1, -0.2, 0.4)
    distance: float = 2.5


@dataclass
class World:
    """Truth on the grid; rows are times."""

    setup: Setup
    t: np.ndarray = field(init=False)

    def __post_init__(self):
        s = self.setup
        rng = np.random.default_rng(s.seed)
        n = round(s.duration / H)
        self.t = H * np.arange(n)
        hand = three_pole(rng, n, 0.05, np.deg2rad(3.0)) + tremor(rng, self.t)
        robot = three_pole(rng, n, 0.06, np.deg2rad(4.0))
        robot[0] += np.concatenate(((s.distance, 0.0, 0.0), s.eta_bc))
        self.R_fc, self.omega_c, self.f_c = felt(hand)
        self.R_fb, self.omega_b, self.f_b = felt(robot)
        d, dd = robot[:2, :, :3] - hand[:2, :, :3]
        self.p = np.einsum("nji,nj->ni", self.R_fc, d)
        self.u = np.einsum("nji,nj->ni", self.R_fc, dd)
        self.R = np.einsum("nji,njk->nik", self.R_fc, self.R_fb)

    def index(self, t):
        return np.clip(np.rint(np.asarray(t) / H).astype(int), 0, len(self.t) - 1)

    def phone_samples(self):
        """[(arrival, PhoneImu)] at 60 Hz, rounded as Chromium does."""
        rng = np.random.default_rng((self.setup.seed, 1))
        i, arrival = self._schedule(rng, 1.0 / 60.0, self.setup.phone_delay)
        n = (len(i), 3)
        omega = self.omega_c[i] + rng.normal(0.0, 0.002, 3) + rng.normal(0.0, 0.001, n)
        f = self.f_c[i] + rng.normal(0.0, 0.05, 3) + rng.normal(0.0, 0.02, n)
        step = np.deg2rad(0.1)
        omega, f = np.rint(omega / step) * step, np.rint(f / 0.1) * 0.1
        rows = zip(arrival, self.t[i], omega, f, strict=True)
        return [(a, PhoneImu(float(t), w, g)) for a, t, w, g in rows]

    def body_samples(self):
        """[(arrival, BodyImu)] at 200 Hz."""
        rng = np.random.default_rng((self.setup.seed, 2))
        i, arrival = self._schedule(rng, 0.005, self.setup.body_delay)
        n = (len(i), 3)
        omega = self.omega_b[i] + rng.normal(0.0, 0.02, 3) + rng.normal(0.0, 0.005, n)
        f = self.f_b[i] + rng.normal(0.0, 0.15, 3) + rng.normal(0.0, 0.1, n)
        rows = zip(arrival, self.t[i], omega, f, strict=True)
        return [(a, BodyImu(float(t), w, g)) for a, t, w, g in rows]

    def poses(self):
        """[(arrival, RelativePose)]: maximum likelihood of five LEDs in pixels, linearised."""
        rng = np.random.default_rng((self.setup.seed, 3))
        i, arrival = self._schedule(rng, self.setup.picture_period, self.setup.picture_delay)
        arrival = np.maximum.accumulate(arrival)  # a decoder keeps the order
        seen = (self.t[i] < self.setup.hidden[0]) | (self.t[i] > self.setup.hidden[1])
        i, arrival = i[seen], arrival[seen]
        C = pnp_covariance(self.p[i], self.R[i])
        e = np.einsum("nij,nj->ni", np.linalg.cholesky(C), rng.normal(size=(len(i), 6)))
        p, R = self.p[i] + e[:, :3], self.R[i] @ exp_each(e[:, 3:])
        rows = zip(arrival, self.t[i], p, R, C, strict=True)
        return [(a, RelativePose(float(t), q, S, D, 0.4, 5)) for a, t, q, S, D in rows]

    def _schedule(self, rng, period, delay):
        """Grid indices every `period`, arrival times `delay` after them."""
        i = self.index(np.arange(rng.uniform(0.0, period), self.t[-1], period))
        return i, self.t[i] + rng.uniform(*delay, len(i))


def events(world: World) -> list:
    """Everything that arrives, in the order of arrival."""
    everything = world.phone_samples() + world.body_samples() + world.poses()
    return sorted(everything, key=lambda event: event[0])


def feed(ekf, world: World, period: float = 0.005) -> Iterator[tuple[float, object]]:
    """Run the filter as the control loop does; gives (now, state) each period."""
    queue = iter(events(world))
    event = next(queue, None)
    for now in np.arange(0.1, world.t[-1], period):
        while event is not None and event[0] <= now:
            give(ekf, event[1], now)
            event = next(queue, None)
        yield now, ekf.state(now)


def give(ekf, sample, now):
    if isinstance(sample, PhoneImu):
        ekf.add_phone_imu(sample)
    elif isinstance(sample, BodyImu):
        ekf.add_body_imu(sample)
    else:
        ekf.add_pose(sample, now)


def three_pole(rng, n, sigma_p, sigma_eta):
    """(3, n, 6) value, rate and acceleration of white jerk through three poles at 0.5 Hz."""
    w = np.pi
    A = np.array([[0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [-(w**3), -3.0 * w**2, -3.0 * w]])
    p, v, a = 1.0, w**2 / 3.0, w**4
    stationary = np.array([[p, 0.0, -v], [0.0, v, 0.0], [-v, 0.0, a]])
    Phi = expm(A * H)
    Q = stationary - Phi @ stationary @ Phi.T
    root = np.linalg.cholesky(0.5 * (Q + Q.T) + 1e-18 * np.eye(3))
    x = np.empty((n, 3, 6))
    x[0] = np.linalg.cholesky(stationary) @ rng.normal(size=(3, 6))
    noise = np.einsum("ij,njk->nik", root, rng.normal(size=(n, 3, 6)))
    for k in range(n - 1):
        x[k + 1] = Phi @ x[k] + noise[k]
    return x.transpose(1, 0, 2) * np.repeat((sigma_p, sigma_eta), 3)


def tremor(rng, t):
    """(3, n, 6) of about 9 Hz, 0.05 mm and 0.03° RMS."""
    w = 2.0 * np.pi * rng.uniform(8.5, 9.5, (6,))
    phase = w * t[:, None] + rng.uniform(0.0, 2.0 * np.pi, (6,))
    sigma = np.sqrt(2.0) * np.repeat((5e-5, np.deg2rad(0.03)), 3)
    return sigma * np.stack((np.sin(phase), w * np.cos(phase), -(w**2) * np.sin(phase)))


def felt(motion):
    """R (n, 3, 3), angular velocity and specific force (n, 3) in own axes, of (3, n, 6)."""
    eta, rates = motion[0, :, 3:], motion[1, :, 3:]
    R = rpy_each(eta)
    sr, cr = np.sin(eta[:, 0]), np.cos(eta[:, 0])
    sp, cp = np.sin(eta[:, 1]), np.cos(eta[:, 1])
    omega = np.stack(
        (
            rates[:, 0] - sp * rates[:, 2],
            cr * rates[:, 1] + sr * cp * rates[:, 2],
            cr * cp * rates[:, 2] - sr * rates[:, 1],
        ),
        axis=1,
    )
    force = np.einsum("nji,nj->ni", R, motion[2, :, :3] + (0.0, 0.0, GRAVITY))
    return R, omega, force


def rpy_each(eta):
    """(n, 3, 3) of (n, 3)."""
    (sr, sp, sy), (cr, cp, cy) = np.sin(eta.T), np.cos(eta.T)
    rows = (
        (cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr),
        (sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr),
        (-sp, cp * sr, cp * cr),
    )
    return np.array(rows).transpose(2, 0, 1)


def exp_each(theta):
    """(n, 3, 3) rotations of (n, 3) rotation vectors."""
    angle = np.linalg.norm(theta, axis=1)[:, None, None] + 1e-300
    K = skew_each(theta) / angle
    return np.eye(3) + np.sin(angle) * K + (1.0 - np.cos(angle)) * K @ K


def log_each(R):
    """(n, 3) rotation vectors of (n, 3, 3), not near π."""
    v = np.stack((R[:, 2, 1] - R[:, 1, 2], R[:, 0, 2] - R[:, 2, 0], R[:, 1, 0] - R[:, 0, 1]), 1)
    sine = 0.5 * np.linalg.norm(v, axis=1)
    cosine = 0.5 * (np.trace(R, axis1=1, axis2=2) - 1.0)
    return 0.5 * v * (np.arctan2(sine, cosine) / np.maximum(sine, 1e-300))[:, None]


def skew_each(v):
    """(n, 3, 3) cross product matrices of (n, 3)."""
    K = np.zeros((len(v), 3, 3))
    K[:, 2, 1], K[:, 0, 2], K[:, 1, 0] = v.T
    return K - K.transpose(0, 2, 1)


def pnp_covariance(p, R):
    """(n, 6, 6) of (δp in c, θ in b): inverse of JᵀJ of the LEDs' pixels."""
    information = np.zeros((len(p), 6, 6))
    for led in LEDS_IN_B:
        q = p + R @ led
        Z = np.zeros((len(p), 2, 3))
        Z[:, 0, 0], Z[:, 1, 0] = q[:, 1] / q[:, 0], q[:, 2] / q[:, 0]
        Z[:, 0, 1] = Z[:, 1, 2] = -1.0
        Z *= FOCAL_PX / NOISE_PX / q[:, 0, None, None]
        J = np.concatenate((Z, -Z @ R @ skew_each(led[None])), axis=2)
        information += J.transpose(0, 2, 1) @ J
    C = np.linalg.inv(information)
    return 0.5 * (C + C.transpose(0, 2, 1))
