"""What all refinements of a pose linearise, against differences; and that they end at one pose."""

from __future__ import annotations

import numpy as np
import pytest

from hardware.led_layout import fit_kernels as layout
from pipeline.frames import Array, exp, log
from pipeline.identification import fit_kernels as search
from pipeline.identification import pnp_kernels as likelihood
from pipeline.identification.association_kernels import lights_of
from pipeline.identification.projection_kernels import put_jacobian, put_moved
from tests.pipeline.seeing import LEDS_IN_B, truth_at

F = 900.0


def tangents(p: Array, R: Array, led: Array) -> Array:
    """(2,): left and up of an LED, one metre ahead."""
    x, y, z = p + R @ led
    return np.array([y / x, z / x])


def moved(p: Array, R: Array, step: Array) -> tuple[Array, Array]:
    """The readable twin of `put_moved`."""
    return p + step[:3], R @ exp(step[3:])


@pytest.mark.parametrize("scale", [1.0, -F])
def test_the_jacobian_is_the_slope_of_the_projection(scale: float) -> None:
    truth, J = truth_at(np.random.default_rng(3)), np.empty((2, 6))
    for led in LEDS_IN_B:
        x = (truth.p + truth.R @ led)[0]
        left, up = tangents(truth.p, truth.R, led)
        put_jacobian(x, left, up, truth.R, led, scale, J)
        for k, e in enumerate(1e-6 * np.eye(6)):
            ahead, behind = (tangents(*moved(truth.p, truth.R, d), led) for d in (e, -e))
            np.testing.assert_allclose(J[:, k], scale * (ahead - behind) / 2e-6, atol=1e-8 * F)


def test_a_step_moves_as_the_readable_twin_says() -> None:
    rng = np.random.default_rng(4)
    for size in (1e-6, 0.1, 1.0):
        truth, step = truth_at(rng), rng.normal(0.0, size, 6)
        p, R = truth.p.copy(), np.empty((3, 3))
        put_moved(p, truth.R, step, np.empty((3, 3)), p, R)
        for got, want in zip((p, R), moved(truth.p, truth.R, step), strict=True):
            np.testing.assert_allclose(got, want, atol=1e-12)


def test_three_refinements_of_the_same_spots_end_at_the_same_pose() -> None:
    rng, m = np.random.default_rng(5), len(LEDS_IN_B)
    for _ in range(10):
        truth = truth_at(rng)
        seen = np.array([tangents(truth.p, truth.R, led) for led in LEDS_IN_B])
        seen += rng.normal(0.0, 0.2 / F, seen.shape)
        start = truth.p * 1.02, truth.R @ exp(rng.normal(0.0, 0.03, 3))
        (p_1, R_1), (p_2, R_2), (p_3, R_3) = ((start[0].copy(), start[1].copy()) for _ in range(3))
        still, even = np.zeros((m, 3)), np.tile(np.eye(2), (m, 1, 1))
        information, residuals = np.empty((6, 6)), np.empty((m, 2))
        chi2 = likelihood.refine(
            LEDS_IN_B, -seen, still, even, np.zeros(m), 0.0, F, p_1, R_1, information, residuals
        )
        lights = lights_of(seen, np.ones(m))
        total = search.fit(p_2, R_2, LEDS_IN_B, np.arange(m), -1, lights)
        scratch = np.empty(layout.SCRATCH)
        cost = layout.refine(
            LEDS_IN_B, -F * seen, F, R_3, p_3, truth.R, layout.FREE, 0.0, np.inf, scratch
        )
        assert F * F * total == pytest.approx(chi2, rel=1e-6)
        assert cost == pytest.approx(chi2, rel=1e-6)
        for p, R in ((p_2, R_2), (p_3, R_3)):
            np.testing.assert_allclose(p, p_1, atol=1e-5)
            np.testing.assert_allclose(log(R.T @ R_1), 0.0, atol=1e-5)
