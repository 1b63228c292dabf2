"""Scenes of a robot with LEDs before a camera: what was seen, beside what was there."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

import hardware
from hardware.camera_file import find_camera
from hardware.robot_file import load_robot
from hardware.sim.render import RenderOptions, render
from pipeline.frames import R_from_rpy, exp, log
from pipeline.signals import Frame, LedRays, RelativePose, VisionMeasurement
from pipeline.vision.detection import FramePrior

CAMERA = find_camera("lightleash-virtual-phone", 1280, 720)
LEDS_IN_B = load_robot(Path(hardware.__file__).parent / "robots" / "ames.toml").robot.leds_in_b
UP_IN_F = np.array([0.0, 0.0, 1.0])
WRONG_M, WRONG_SHARE, WRONG_RAD = 0.02, 0.05, np.deg2rad(10.0)
"""Beyond 2 cm + 5 % of the range, or 10°, a reported pose is wrong."""


@dataclass(frozen=True, eq=False)
class Truth:
    p: np.ndarray
    R: np.ndarray
    R_fc: np.ndarray
    """Camera: its roll and pitch are what gravity tells."""

    def prior(self, rng=None, sigma_rad=0.01):
        """Both verticals; with `rng` the camera's is off by about `sigma_rad`."""
        up_in_c = self.R_fc.T @ UP_IN_F
        if rng is not None:
            up_in_c = exp(rng.normal(0.0, sigma_rad, 3)) @ up_in_c
        return FramePrior(up_in_c, self.R.T @ self.R_fc.T @ UP_IN_F, np.zeros(3), np.zeros(3))

    def pixels(self):
        return CAMERA.pixels(self.p + LEDS_IN_B @ self.R.T)


def truth_at(rng, distance=2.5):
    """The robot somewhere in the picture's middle, both held about upright."""
    yaw = rng.uniform(-0.6, 0.6)
    R_fc = R_from_rpy(rng.uniform(-0.25, 0.25, 3))
    R_fb = R_from_rpy(np.append(rng.uniform(-0.2, 0.2, 2), R_yaw(R_fc) + yaw))
    p = distance * np.array([1.0, rng.uniform(-0.25, 0.25), rng.uniform(-0.1, 0.1)])
    return Truth(p, R_fc.T @ R_fb, R_fc)


def R_yaw(R):
    return float(np.arctan2(R[1, 0], R[0, 0]))


def moved(truth, rng, dp=0.004, turn=0.006):
    """A picture later: a hand's and a robot's motion."""
    R_fc = truth.R_fc @ exp(rng.normal(0.0, turn, 3))
    R = exp(rng.normal(0.0, turn, 3)) @ truth.R
    return Truth(truth.p + rng.normal(0.0, dp, 3), R, R_fc)


def picture(truth, rng, look=None, covered=(), camera=CAMERA, leds=LEDS_IN_B):
    """Luma of the scene; `covered` of the `leds` (n, 3) are dark."""
    shown = np.delete(leds, covered, axis=0)
    return render(camera, lambda _: (truth.R, truth.p), shown, look or RenderOptions(), rng)


def frame_at(t, truth, rng, look=None, covered=(), leds=LEDS_IN_B):
    return Frame(t, picture(truth, rng, look, covered, leds=leds))


def error_of(pose, truth):
    """(δp in c, θ in b) with truth = estimate ⊞ error."""
    return np.concatenate((truth.p - pose.p_bc_in_c, log(pose.R_cb.T @ truth.R)))


def is_wrong(pose, truth):
    error = error_of(pose, truth)
    far = np.linalg.norm(error[:3]) > WRONG_M + WRONG_SHARE * np.linalg.norm(truth.p)
    return bool(far or np.linalg.norm(error[3:]) > WRONG_RAD)


def rays_at(t, p, R, leds=None, sigma=1e-4, leds_in_b=LEDS_IN_B):
    """What a perfect lens makes of LEDs of a body at `p`, `R`; `sigma` of the tangents."""
    named = np.arange(len(leds_in_b)) if leds is None else np.array(leds, dtype=np.intp)
    q = p + leds_in_b[named] @ R.T
    n = len(named)
    covariances = np.tile(sigma**2 * np.eye(2), (n, 1, 1))
    return LedRays(named, np.full(n, t), q[:, 1:] / q[:, :1], covariances)


def seen_at(t, p, R, covariance, leds=None, leds_in_b=LEDS_IN_B):
    """A picture that saw all LEDs of a body at `p`, `R`, or only some: then without a pose."""
    rays = rays_at(t, p, R, leds, leds_in_b=leds_in_b)
    pose = RelativePose(t, p, R, covariance, 0.1, len(rays)) if leds is None else None
    return VisionMeasurement(t, rays, pose)


def nees(pose, truth):
    """Squared error over covariance, per degree of freedom: median 0.89 if consistent."""
    error = error_of(pose, truth)
    return float(error @ np.linalg.solve(pose.covariance, error)) / 6.0


def quiver(t: float) -> np.ndarray:
    """What a gyroscope at rest says (3,) [rad/s]: never the same twice."""
    return np.full(3, 1e-9 * t)
