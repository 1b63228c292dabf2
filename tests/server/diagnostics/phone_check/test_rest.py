"""Seconds of rest: found by how little a phone turns, and what its sensors say then."""

from __future__ import annotations

import numpy as np
import pytest

from pipeline.frames import GRAVITY
from server.diagnostics.phone_check.rest import NO_REST, RestLog

BIAS = np.array([0.003, 0.0, -0.004])
"""0.005 rad/s long."""


def fed(log: RestLog, since: float, seconds: float, turning: float = 0.0) -> None:
    """60 samples a second of a phone that sways by `turning` [rad/s]."""
    for k in range(round(60 * seconds)):
        t = since + k / 60.0
        rate = BIAS + turning * np.sin(2.0 * np.pi * 3.0 * t)
        log.add(t, rate, np.array([0.0, 0.0, GRAVITY + 0.1]))


def test_a_second_of_rest_between_motion_tells_bias_and_gravity() -> None:
    log = RestLog()
    fed(log, 100.0, 4.0, turning=0.5)
    fed(log, 104.0, 2.0)
    fed(log, 106.0, 4.0, turning=0.5)
    found = log.stillest(0.0)
    assert found.bias == pytest.approx(0.005)
    assert found.gravity == pytest.approx(GRAVITY + 0.1)
    assert found.spread == pytest.approx(0.0, abs=1e-9)


def test_a_phone_that_always_moves_tells_neither() -> None:
    log = RestLog()
    fed(log, 0.0, 10.0, turning=0.05)
    assert log.stillest(0.0) is NO_REST


def test_rest_before_the_check_began_is_not_told() -> None:
    log = RestLog()
    fed(log, 0.0, 3.0)
    fed(log, 3.0, 3.0, turning=0.5)
    assert log.stillest(1.0).t == pytest.approx(2.0, abs=1.0)
    assert log.stillest(3.0) is NO_REST


def test_a_second_of_which_most_is_missing_is_none() -> None:
    log = RestLog()
    fed(log, 0.0, 0.5)
    assert log.stillest(0.0) is NO_REST


def test_only_so_many_are_remembered() -> None:
    log = RestLog(most=3)
    fed(log, 0.0, 10.0)
    assert len(log._found) == 3
