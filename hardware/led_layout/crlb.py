"""CRLB of a pose by LEDs, view by view: how well it can be known at all."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from hardware.led_layout.viewpoints import Viewpoints, attitude, seen
from pipeline.frames import Array, skew

HUGE = 1e12
"""Variance of a pose that is not to be had [m², rad²]."""


@dataclass(frozen=True, slots=True, eq=False)
class Sigmas:
    """Standard deviations of the pose; axes: view, distance."""

    lateral: Array
    """(k, d) along the worse direction in the picture's plane [m]."""
    depth: Array
    """(k, d) along the line of sight [m]."""
    rotation: Array
    """(k, d) about the worst axis [rad]."""


def sigmas(leds_in_b: Array, looks: Viewpoints, noise_px: float) -> Sigmas:
    """Standard deviations with all LEDs seen, each coordinate off by `noise_px`."""
    covariances = np.array(
        [
            [_covariance(leds_in_b, attitude(d), float(z), looks.focal_px) for z in looks.distances]
            for d in looks.directions_in_b
        ]
    )
    worst = np.linalg.eigvalsh
    return Sigmas(
        noise_px * np.sqrt(worst(covariances[..., 1:3, 1:3])[..., -1]),
        noise_px * np.sqrt(covariances[..., 0, 0]),
        noise_px * np.sqrt(worst(covariances[..., 3:, 3:])[..., -1]),
    )


def one_hidden(leds_in_b: Array, looks: Viewpoints, noise_px: float) -> Sigmas:
    """Standard deviations with the LED hidden that each figure misses most."""
    each = [sigmas(np.delete(leds_in_b, k, axis=0), looks, noise_px) for k in range(len(leds_in_b))]
    return Sigmas(
        np.max([s.lateral for s in each], axis=0),
        np.max([s.depth for s in each], axis=0),
        np.max([s.rotation for s in each], axis=0),
    )


def _covariance(leds_in_b: Array, R_cb: Array, distance: float, f: float) -> Array:
    """Covariance (6, 6) of (δp in c, θ in b) for a noise of 1 px; huge where LEDs say nothing."""
    px = seen(leds_in_b, R_cb, distance, f)
    q = leds_in_b @ R_cb.T + np.array([distance, 0.0, 0.0])
    along = np.zeros((len(q), 2, 3))
    along[:, :, 0] = -px / q[:, :1]
    along[:, 0, 1] = along[:, 1, 2] = -f / q[:, 0]
    turns = np.array([-R_cb @ skew(led) for led in leds_in_b])
    J = np.concatenate((along, along @ turns), axis=2).reshape(-1, 6)
    information = J.T @ J
    scale = 1.0 / np.sqrt(np.diag(information))
    if np.linalg.cond(information * np.outer(scale, scale)) > 1e12:
        return np.diag(np.full(6, HUGE))
    covariance: Array = np.linalg.inv(information)
    return covariance
