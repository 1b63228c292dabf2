"""Telemetry of the estimators on its way to the server: all of it, no number that is none."""

from __future__ import annotations

from math import isfinite, nan
from typing import get_args

import msgspec
import numpy as np
import pytest

from hardware.robot_file import load_robot
from pipeline.config import EstimatorName, TeleopConfig
from pipeline.estimation.estimator import Health
from pipeline.signals import BodyImu
from server.control.controller import Controller
from server.control.ipc import ControlStatus
from server.control.ipc_estimate import EstimateFields, finite
from server.control.ipc_inputs import ReadyInput
from tests.server.control.test_controller import UP, Rig

ROBOT = load_robot("ames").robot
BIASES = ("bias_omega_b", "bias_a_b", "bias_omega_c", "bias_a_c")
NUMBERS = ("nis", "age", "time_offset_sigma", *BIASES)


def told_by(name: EstimatorName, seconds: float) -> tuple[ControlStatus, Health]:
    """By a controller that sees a robot at rest, and what its estimator knows."""
    rig = Rig()
    rig.controller = Controller(ROBOT, TeleopConfig(estimator=name))
    status: ControlStatus = rig.status(rig.run(seconds)[-1][1])
    return status, rig.controller.teleop.estimator.health


def fields(status: ControlStatus) -> EstimateFields:
    """That a status must have."""
    assert status.estimate is not None
    return status.estimate


@pytest.mark.parametrize("name", get_args(EstimatorName))
def test_every_estimator_is_told_by_its_name_and_survives_the_link(name):
    for seconds in (0.005, 0.5):
        status, _ = told_by(name, seconds)
        assert status.estimate is not None
        assert status.estimate.name == name
        there = msgspec.msgpack.decode(msgspec.msgpack.encode(status), type=ControlStatus)
        assert there == status


def test_before_the_first_picture_nothing_is_known():
    told = fields(told_by("relative", 0.005)[0])
    assert [getattr(told, name) for name in NUMBERS] == [None] * len(NUMBERS)
    assert (told.complaint, told.late, told.leds_rejected) == ("", 0, 0)


def test_what_the_relative_filter_knows_is_told_as_it_is():
    status, health = told_by("relative", 0.5)
    told = fields(status)
    assert 0.05 <= told.age < 0.09
    assert told.nis == health.nis
    assert told.time_offset_sigma == health.time_offset_sigma
    for name in BIASES:
        np.testing.assert_array_equal(getattr(told, name), getattr(health, name))


def test_without_a_filter_there_are_no_biases():
    told = fields(told_by("none", 0.5)[0])
    assert [getattr(told, name) for name in BIASES] == [None] * len(BIASES)
    assert told.age is not None


def test_counts_complaint_and_numbers_that_are_none():
    class Doubtful:
        complaint = "Restart the camera."

    still = np.zeros(3)
    health = Health(late=2, leds_rejected=5, nis=nan, time_offset_sigma=np.inf, bias_a_b=still)
    told = EstimateFields.of("relative", Doubtful(), health, None)
    assert (told.complaint, told.late, told.leds_rejected) == ("Restart the camera.", 2, 5)
    assert (told.nis, told.age, told.time_offset_sigma, told.bias_omega_b) == (None,) * 4
    assert told.bias_a_b == (0.0, 0.0, 0.0)


@pytest.mark.parametrize("value", [0.0, -1.5, nan, np.inf, np.float64(2.0)])
def test_finite_gives_a_plain_number_or_none(value):
    assert finite(value) == (value if isfinite(value) else None)
    assert type(finite(value)) in (float, type(None))


def test_the_age_grows_while_no_picture_comes():
    rig = Rig()
    rig.run(0.5)
    t = 100.0 + 0.005 * rig.k
    output = None
    for k in range(1, 41):
        body = [BodyImu(t + 0.005 * k - 0.003, np.zeros(3), np.array(UP))]
        _, output = rig.controller.tick(t + 0.005 * k, [ReadyInput([])], body, "")
    told = fields(rig.status(output))
    assert 0.25 <= told.age < 0.29
