"""Cut-off frequency and time constants of the virtual camera's two stages."""

from __future__ import annotations

from math import inf, pi, sqrt

from pipeline.config import VirtualCameraConfig

COMFORTABLE_HZ, TAU_2 = 0.28, 0.16
"""The paper's second stage [s] goes with cut-offs up to this one."""


def cutoff_hz(config: VirtualCameraConfig) -> float:
    """Frequency at which a slow turn of the phone reaches the robot with −3 dB."""
    if config.mode == "off" or config.tau_1 <= 0.0 >= config.tau_2:
        return inf
    a, b = config.tau_1**2, config.tau_2**2
    # |H|² = 1/((1+a w²)(1+b w²)) = 1/2, a quadratic in w²; the form that lets a b vanish
    w2 = 2.0 / (a + b + sqrt((a + b) ** 2 + 4.0 * a * b))
    return sqrt(w2) / (2.0 * pi)


def time_constants(hz: float) -> tuple[float, float]:
    """tau_1, tau_2 [s] of a cut-off: the paper's 0.16 s behind a slower one, shorter if need be."""
    w, w_comfortable = 2.0 * pi * hz, 2.0 * pi * COMFORTABLE_HZ
    tau_2 = TAU_2 * min(1.0, w_comfortable / w)
    return sqrt(2.0 / (1.0 + (tau_2 * w) ** 2) - 1.0) / w, tau_2
