"""The link between server and control: nothing that is no number gets through, nobody blocks."""

from __future__ import annotations

import socket
from math import inf, nan

import msgspec
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pipeline.signals import (
    LedRays,
    PhoneImu,
    RelativePose,
    StampOffset,
    TouchState,
    VisionMeasurement,
)
from pipeline.vision.rays import NO_RAYS
from server.control.ipc import (
    LARGEST,
    OperatorInput,
    PhoneImuInput,
    ReadyInput,
    RequestInput,
    control_end,
    is_believable,
    server_end,
)
from server.control.ipc_vision import MAX_LEDS, LedFields, PoseFields, SeenInput
from tests.server.house import control_status

V = (0.1, 0.2, 0.3)
EYE = (1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0)
IMU = PhoneImuInput(1.0, V, V)
POSE = PoseFields(1.0, V, EYE, [0.5] * 36, 0.3, 5)
LED = LedFields(3, 1.0, (0.1, 0.2), (0.1, 0.0, 0.0, 0.1))
SEEN = SeenInput(1.0, [LED, LED], POSE, (0.6, 0.4))
FEW = SeenInput(1.0, [LED], None, (0.6, 0.4))
OPERATOR = OperatorInput(1.0, True, 2)
REQUEST, READY = RequestInput("stop"), ReadyInput(["No phone."])
replace = msgspec.structs.replace
BAD = (nan, inf, -inf, 2.0 * LARGEST)


@pytest.fixture
def ends(tmp_path):
    server, control = server_end(tmp_path), control_end(tmp_path)
    yield server, control
    for end in (server, control):
        if end.fileno() >= 0:
            end.close()


def test_what_the_server_says_arrives_in_order(ends):
    server, control = ends
    said = [IMU, SEEN, FEW, OPERATOR, REQUEST, READY]
    assert all(server.send(message) for message in said)
    assert control.inputs() == said
    assert control.inputs() == []


def test_what_control_says_arrives_with_ages_that_are_for_ever(ends):
    server, control = ends
    status = control_status()
    assert control.send(status)
    assert server.statuses() == [status]
    assert status.pose_age == inf


@pytest.mark.parametrize("bad", BAD)
@pytest.mark.parametrize(
    "place",
    [
        lambda x: PhoneImuInput(x, V, V),
        lambda x: PhoneImuInput(1.0, (0.0, x, 0.0), V),
        lambda x: PhoneImuInput(1.0, V, (0.0, 0.0, x)),
        lambda x: replace(SEEN, t=x),
        lambda x: replace(SEEN, half_field=(0.6, x)),
        lambda x: replace(SEEN, offset=(0.01, x)),
        lambda x: replace(SEEN, leds=[LED, replace(LED, t=x)]),
        lambda x: replace(SEEN, leds=[LED, replace(LED, tangents=(x, 0.0))]),
        lambda x: replace(FEW, leds=[replace(LED, covariance=(0.1, 0.0, 0.0, x))]),
        lambda x: replace(SEEN, pose=replace(POSE, t=x)),
        lambda x: replace(SEEN, pose=replace(POSE, p=(x, 0.0, 0.0))),
        lambda x: replace(SEEN, pose=replace(POSE, R=(*EYE[:8], x))),
        lambda x: replace(SEEN, pose=replace(POSE, covariance=[*[0.5] * 35, x])),
        lambda x: replace(SEEN, pose=replace(POSE, reprojection_px=x)),
        lambda x: OperatorInput(x, True, 1),
    ],
)
def test_a_number_that_is_none_is_refused_and_counted_wherever_it_stands(ends, place, bad):
    server, control = ends
    server.send(place(bad))
    server.send(IMU)
    assert control.inputs() == [IMU]
    assert control.dropped == 1


@pytest.mark.parametrize("length", [0, 35, 37])
def test_a_covariance_of_another_size_is_refused(ends, length):
    server, control = ends
    server.send(replace(SEEN, pose=replace(POSE, covariance=[0.5] * length)))
    assert control.inputs() == []
    assert control.dropped == 1


@pytest.mark.parametrize(
    "leds", [[replace(LED, led=MAX_LEDS)], [replace(LED, led=-1)], [LED] * (MAX_LEDS + 1)]
)
def test_leds_that_no_robot_has_are_refused(ends, leds):
    server, control = ends
    server.send(replace(SEEN, leds=leds))
    assert control.inputs() == []
    assert control.dropped == 1


@given(st.binary(max_size=300))
def test_garbage_is_counted_and_costs_nothing_else(tmp_path_factory, data):
    folder = tmp_path_factory.mktemp("link")
    control = control_end(folder)
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as stranger:
        stranger.sendto(data, str(folder / "control.sock"))
        stranger.sendto(msgspec.msgpack.encode(REQUEST), str(folder / "control.sock"))
    heard = control.inputs()
    assert heard[-1] == REQUEST
    assert all(map(is_believable, heard))
    assert len(heard) + control.dropped == 2
    control.close()


def test_nobody_at_the_other_end_is_no_error_and_a_newcomer_is_heard(tmp_path):
    server = server_end(tmp_path)
    assert not server.send(IMU)
    control = control_end(tmp_path)
    assert server.send(OPERATOR)
    control.close()
    assert not server.send(IMU)
    assert server.dropped == 2
    successor = control_end(tmp_path)
    assert server.send(READY)
    assert successor.inputs() == [READY]
    successor.close()
    server.close()


def test_a_full_queue_is_no_error_and_what_is_lost_is_counted(ends):
    server, control = ends
    sent = sum(server.send(IMU) for _ in range(5_000))
    assert sent + server.dropped == 5_000
    assert server.dropped > 0
    assert len(control.inputs(10_000)) == sent


def test_a_turn_takes_no_more_than_its_limit(ends):
    server, control = ends
    server.send(IMU)
    server.send(OPERATOR)
    assert control.inputs(limit=1) == [IMU]
    assert control.inputs(limit=1) == [OPERATOR]


def test_one_that_died_without_cleaning_up_is_replaced(tmp_path):
    first = control_end(tmp_path)
    second = control_end(tmp_path)
    server = server_end(tmp_path)
    server.send(READY)
    assert second.inputs() == [READY]
    for end in (first, second, server):
        end.close()


def test_signals_survive_the_journey():
    rng = np.random.default_rng(0)
    a, b, c = rng.normal(size=(3, 3))
    sample = PhoneImuInput.of(PhoneImu(1.5, a, b)).sample()
    np.testing.assert_array_equal((sample.omega_m_cf_in_c, sample.a_m_cf_in_c), (a, b))
    measured = RelativePose(2.5, c, rng.normal(size=(3, 3)), rng.normal(size=(6, 6)), 0.4, 6)
    rays = LedRays(
        np.array([4, 1]), rng.normal(size=2), rng.normal(size=(2, 2)), rng.normal(size=(2, 2, 2))
    )
    seen = SeenInput.of(
        VisionMeasurement(2.5, rays, measured, (0.7, 0.4), StampOffset(0.05, 0.002))
    ).seen()
    assert (seen.t, seen.half_field) == (2.5, (0.7, 0.4))
    assert seen.offset == StampOffset(0.05, 0.002)
    for name in ("led", "t", "tangents", "covariances"):
        np.testing.assert_array_equal(getattr(seen.rays, name), getattr(rays, name))
    assert seen.pose is not None
    np.testing.assert_array_equal(seen.pose.R_cb, measured.R_cb)
    np.testing.assert_array_equal(seen.pose.covariance, measured.covariance)
    assert (seen.pose.t, seen.pose.reprojection_px, seen.pose.leds) == (2.5, 0.4, 6)
    nothing = SeenInput.of(VisionMeasurement(2.5, NO_RAYS, None)).seen()
    assert nothing.pose is None
    assert nothing.offset is None
    assert nothing.rays.tangents.shape == (0, 2)
    assert nothing.rays.covariances.shape == (0, 2, 2)
    operator = OperatorInput.of(TouchState(3.5, True, 9)).operator()
    assert (operator.t, operator.held, operator.press) == (3.5, True, 9)
