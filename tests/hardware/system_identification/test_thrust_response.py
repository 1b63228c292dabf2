"""Thrusts follow held commands exactly, whatever delay and lag, and smoothly with both."""

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from hardware.system_identification.thrust_response import thrust_response

PERIOD_S = 0.005
STEP_S = 1e-5


def integrated(commands, lag, delay):
    """The same by small steps."""
    steps = round(PERIOD_S / STEP_S)
    late = round(delay / STEP_S)
    held = np.repeat(commands, steps, axis=0)
    held = np.concatenate((np.repeat(held[:1], late, axis=0), held))[: len(held)]
    thrusts, y = [], held[0]
    for k, command in enumerate(held):
        if k % steps == 0:
            thrusts.append(y)
        y = command + (y - command) * np.exp(-STEP_S / lag)
    return np.array(thrusts)


@settings(max_examples=20, deadline=None)
@given(lag=st.floats(0.005, 0.08), delay_ms=st.integers(0, 250), seed=st.integers(0, 1000))
def test_as_integrated_by_small_steps(lag, delay_ms, seed):
    commands = np.random.default_rng(seed).uniform(0.2, 3.0, (40, 2))
    delay = 1e-4 * delay_ms
    found = thrust_response(commands, lag, delay, PERIOD_S)
    np.testing.assert_allclose(found, integrated(commands, lag, delay), atol=1e-9)


def test_no_jump_where_a_delay_is_a_whole_number_of_periods():
    commands = np.random.default_rng(3).uniform(0.2, 3.0, (60, 3))
    below, at, above = (
        thrust_response(commands, 0.03, 0.015 + off, PERIOD_S) for off in (-1e-7, 0.0, 1e-7)
    )
    assert np.abs(below - at).max() < 1e-4
    assert np.abs(above - at).max() < 1e-4


def test_a_command_that_stays_is_the_thrust():
    commands = np.full((30, 1), 1.3)
    np.testing.assert_allclose(thrust_response(commands, 0.025, 0.0173, PERIOD_S), commands)
