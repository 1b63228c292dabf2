"""The compiled step and its Jacobians are those of the readable one."""

import numpy as np
import pytest

from pipeline.estimation import gravity_free, gravity_free_kernels
from tests.pipeline.estimation.test_gravity_free import apart, changed, drawn, moved
from tests.pipeline.moving import H, rate

QUIET = np.array([0.8, 1.0, 0.8, 1.0])
"""Inputs of a hand; times `FAST` of a fall down the stairs."""
FAST = np.array([25.0, 6.0, 25.0, 6.0])


def scaled(inputs, by):
    rows = np.stack((inputs.omega_b, inputs.f_b, inputs.omega_c, inputs.f_c))
    return gravity_free.PredictedImu(*(rows * by[:, None]))


def compiled(x, inputs, h):
    """(motion after, f, g), memory full of rubbish before."""
    state, R = np.full(19, 7.0), x.R.copy()
    state[:3], state[3:6] = x.p, x.u
    f, g, scratch = np.full((9, 9), 9.0), np.full((9, 12), 9.0), np.full((13, 3, 3), np.nan)
    rows = np.concatenate((inputs.omega_b, inputs.f_b, inputs.omega_c, inputs.f_c))
    gravity_free_kernels.step(state, R, rows, h, scratch, f, g)
    assert (state[6:] == 7.0).all()
    return gravity_free.RelativeMotion(state[:3], R, state[3:6]), f, g


def columns(n, f, step):
    return np.array([rate(lambda s, e=e: f(s * step / H * e), 0.0) * H / step for e in np.eye(n)]).T


@pytest.mark.parametrize("pace", [QUIET, FAST, np.zeros(4)], ids=["hand", "fast", "nothing"])
@pytest.mark.parametrize("h", [0.005, 0.01, 1e-6])
def test_a_compiled_step_is_the_readable_one(pace, h):
    for seed in range(4):
        x, inputs = drawn(seed)
        inputs = scaled(inputs, pace)
        assert (
            np.abs(apart(compiled(x, inputs, h)[0], gravity_free.step(x, inputs, h))).max() < 1e-12
        )


@pytest.mark.parametrize(("pace", "tolerance"), [(QUIET, 1e-8), (FAST, 1e-5), (np.zeros(4), 1e-8)])
@pytest.mark.parametrize("pitch", [0.3, np.pi / 2, -np.pi / 2])
def test_its_jacobians_are_its_derivatives(pace, tolerance, pitch):
    """By the inputs, turns of half a step are cut off after the second order."""
    x, inputs = drawn(2, pitch)
    inputs, h = scaled(inputs, pace), 0.005
    after, f, g = compiled(x, inputs, h)
    by_state = columns(9, lambda e: apart(gravity_free.step(moved(x, e), inputs, h), after), 2e-3)
    by_input = columns(12, lambda e: apart(gravity_free.step(x, changed(inputs, e), h), after), 0.1)
    assert np.abs(f - by_state).max() < 1e-8
    assert np.abs(g - by_input).max() < tolerance


def test_the_jacobians_tend_to_the_continuous_ones():
    x, inputs = drawn(1)
    F, G = gravity_free.error_jacobian(x, inputs)
    h = 1e-5
    _, f, g = compiled(x, inputs, h)
    assert np.abs((f - np.eye(9)) / h - F).max() < 1e-2
    assert np.abs(g / h - G).max() < 1e-2
