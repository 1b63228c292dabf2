"""The estimator of a name: one of three behind one interface."""

from __future__ import annotations

from dataclasses import replace
from typing import Final, get_args

import numpy as np

from pipeline.config import EstimatorName, TeleopConfig
from pipeline.estimation.accelerometer_check import AccelerometerCheck
from pipeline.estimation.adaptive_noise import AdaptiveNoise
from pipeline.estimation.bias_steps import BiasSteps
from pipeline.estimation.date_noise import DateNoise
from pipeline.estimation.estimator import Estimator
from pipeline.estimation.no_filter import NoFilter
from pipeline.estimation.paper_ekf import PaperEkf
from pipeline.estimation.picture_kernels import pose_in_picture
from pipeline.estimation.ray_kernels import correct
from pipeline.estimation.relative_filter import RelativeFilter
from pipeline.frames import GRAVITY, Array
from pipeline.robot import ToldMotion
from pipeline.signals import BodyImu, LedRays, PhoneImu, RelativePose, VisionMeasurement

NEEDS_SENSORS: Final = (
    "'paper' needs motion sensors on the robot's body, and this one has none: 'relative' or 'none'"
)


def make_estimator(
    config: TeleopConfig, leds_in_b: Array, motion: ToldMotion | None = None
) -> Estimator:
    """The one that `config.estimator` names, for a robot with `leds_in_b` (n, 3) [m].

    `motion` of one without motion sensors on its body.

    Raises:
        ValueError: one that can't do without them.
    """
    if config.estimator == "none":
        return NoFilter(config.no_filter)
    if config.estimator == "paper":
        if motion is not None:
            raise ValueError(f"estimator: {NEEDS_SENSORS}")
        return PaperEkf(config.ekf)
    return RelativeFilter(config.relative, leds_in_b, motion)


def warm_up() -> None:
    """Compile every kernel, or load it from the cache, so that nothing compiles in the loop."""
    leds_in_b = np.array([[0.1, 0.2, 0.0], [0.1, -0.2, 0.1], [-0.1, 0.0, 0.3], [0.0, 0.1, -0.2]])
    p, up, still = np.array([2.5, 0.0, 0.0]), np.array([0.0, 0.0, GRAVITY]), np.zeros(3)
    q = leds_in_b + p
    tangents, C = q[:, 1:] / q[:, :1], np.tile(1e-7 * np.eye(2), (4, 1, 1))
    for name in get_args(EstimatorName):
        estimator = make_estimator(replace(TeleopConfig(), estimator=name), leds_in_b)
        for t in (0.0, 0.01, 0.02, 0.03):
            estimator.add_body_imu(BodyImu(t, still, up))
            estimator.add_phone_imu(PhoneImu(t, still, up))
            rays = LedRays(np.arange(4), np.full(4, t), tangents, C)
            pose = RelativePose(t, p, np.eye(3), 1e-4 * np.eye(6), 0.0, 4)
            estimator.add_seen(VisionMeasurement(t, rays, pose), t)
        estimator.state(0.05)
    e, P = np.full(6, 1e-3), 1e-4 * np.eye(22)  # what a picture is only asked once it is dated
    C = P[:6, :6].copy()
    BiasSteps(np.ones(4)).learn(0.0, e, C, P)
    DateNoise().learn(e, C, e)
    AdaptiveNoise().judge(e, pose_in_picture(P, e), C)
    correct(np.zeros(19), np.eye(3), np.zeros(22))  # a start that is carried on
    check = AccelerometerCheck()
    for t in (0.0, 0.01):
        check.add(t, still, up)
