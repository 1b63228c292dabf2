"""The link between server and control: nothing that is no number gets through, nobody blocks."""

from __future__ import annotations

import socket
from dataclasses import replace
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
from pipeline.vision.blink_code import CODES
from pipeline.vision.rays import NO_RAYS
from server.control.ipc import control_end, server_end
from server.control.ipc_inputs import (
    LARGEST,
    MAX_LEDS,
    BlinkInput,
    ReadyInput,
    RequestInput,
    decode,
    encode,
    is_believable,
)
from tests.server.house import control_status

V = np.array((0.1, 0.2, 0.3))
IMU = PhoneImu(1.0, V, V)
POSE = RelativePose(1.0, V, np.eye(3), np.full((6, 6), 0.5), 0.3, 5)
RAYS = LedRays(
    np.array([3, 3]), np.ones(2), np.array([[0.1, 0.2]] * 2), np.array([0.1 * np.eye(2)] * 2)
)
SEEN = VisionMeasurement(1.0, RAYS, POSE, (0.6, 0.4), StampOffset(0.01, 0.001))
FEW = replace(SEEN, pose=None, offset=None)
TOUCH = TouchState(1.0, True, 2)
REQUEST, READY = RequestInput("stop"), ReadyInput(["No phone."])
BLINK = BlinkInput(3, 5.5)
BAD = (nan, inf, -inf, 2.0 * LARGEST)


def wire(messages):
    """Bytes, by which messages compare that hold arrays."""
    return list(map(encode, messages))


def spoilt(array, bad):
    """With another last number."""
    array = array.copy()
    array.flat[-1] = bad
    return array


@pytest.fixture
def ends(tmp_path):
    server, control = server_end(tmp_path), control_end(tmp_path)
    yield server, control
    for end in (server, control):
        if end.fileno() >= 0:
            end.close()


def test_what_the_server_says_arrives_in_order(ends):
    server, control = ends
    said = [IMU, SEEN, FEW, TOUCH, REQUEST, READY, BLINK]
    assert all(server.send(message) for message in said)
    heard = control.inputs()
    assert wire(heard) == wire(said)
    assert [type(one) for one in heard] == [type(one) for one in said]
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
        lambda x: PhoneImu(x, V, V),
        lambda x: PhoneImu(1.0, spoilt(V, x), V),
        lambda x: PhoneImu(1.0, V, spoilt(V, x)),
        lambda x: replace(SEEN, t=x),
        lambda x: replace(SEEN, half_field=(0.6, x)),
        lambda x: replace(SEEN, offset=StampOffset(0.01, x)),
        lambda x: replace(SEEN, rays=replace(RAYS, t=spoilt(RAYS.t, x))),
        lambda x: replace(SEEN, rays=replace(RAYS, tangents=spoilt(RAYS.tangents, x))),
        lambda x: replace(FEW, rays=replace(RAYS, covariances=spoilt(RAYS.covariances, x))),
        lambda x: replace(SEEN, pose=replace(POSE, t=x)),
        lambda x: replace(SEEN, pose=replace(POSE, p_bc_in_c=spoilt(V, x))),
        lambda x: replace(SEEN, pose=replace(POSE, R_cb=spoilt(np.eye(3), x))),
        lambda x: replace(SEEN, pose=replace(POSE, covariance=spoilt(POSE.covariance, x))),
        lambda x: replace(SEEN, pose=replace(POSE, reprojection_px=x)),
        lambda x: TouchState(x, True, 1),
        lambda x: BlinkInput(3, x),
    ],
)
def test_a_number_that_is_none_is_refused_and_counted_wherever_it_stands(ends, place, bad):
    server, control = ends
    server.send(place(bad))
    server.send(IMU)
    assert wire(control.inputs()) == wire([IMU])
    assert control.dropped == 1


@pytest.mark.parametrize(
    "wrong",
    [
        PhoneImu(1.0, np.zeros(2), V),
        PhoneImu(1.0, V, np.zeros((3, 1))),
        PhoneImu(1.0, V.astype(np.intp), V),
        *(replace(SEEN, pose=replace(POSE, covariance=np.zeros(n))) for n in (0, 35, 36, 37)),
        replace(SEEN, pose=replace(POSE, R_cb=np.zeros(9))),
        replace(SEEN, rays=replace(RAYS, t=np.zeros(1))),
        replace(SEEN, rays=replace(RAYS, tangents=np.zeros((2, 3)))),
        replace(SEEN, rays=replace(RAYS, covariances=np.zeros((2, 4)))),
        replace(SEEN, rays=replace(RAYS, led=np.zeros((2, 1), dtype=np.intp))),
        replace(SEEN, rays=replace(RAYS, led=np.zeros(2))),
        *(BlinkInput(number, 1.0) for number in (-1, CODES)),
    ],
)
def test_an_array_of_another_shape_or_kind_is_refused(ends, wrong):
    server, control = ends
    server.send(wrong)
    assert control.inputs() == []
    assert control.dropped == 1


@pytest.mark.parametrize(
    "plain",
    [
        ["f", [4], V.tobytes()],
        ["f", [-3], V.tobytes()],
        ["f", [2**63], V.tobytes()],
        ["f", [1] * 70, V.tobytes()],
        ["f", [3.0], V.tobytes()],
        ["f", [3], 10**9],
        ["f", [3], "x" * 24],
        [["f"], [3], V.tobytes()],
        ["f", [3]],
        V.tolist(),
        None,
    ],
)
def test_what_is_no_array_is_refused(plain):
    sample = {"t": 1.0, "omega_m_cf_in_c": plain, "a_m_cf_in_c": plain}
    with pytest.raises(ValueError, match=r"\$|shape"):
        decode(msgspec.msgpack.encode(["imu", sample]))


@pytest.mark.parametrize("leds", [[MAX_LEDS, 0], [0, -1], [0] * (MAX_LEDS + 1)])
def test_leds_that_no_robot_has_are_refused(ends, leds):
    server, control = ends
    n = len(leds)
    rays = LedRays(np.array(leds), np.ones(n), np.zeros((n, 2)), np.zeros((n, 2, 2)))
    server.send(replace(SEEN, rays=rays))
    assert control.inputs() == []
    assert control.dropped == 1


@pytest.mark.parametrize("named", ["R_cb_wxyz", "R_fc_wxyz", "R_fv_wxyz", "reference_R_wxyz"])
@pytest.mark.parametrize("q", [(0.0,) * 4, (1e-300, 0.0, 0.0, 0.0), (nan,) * 4, (1.0, 1.0, 0, 0)])
def test_a_status_whose_attitude_is_none_is_counted(ends, named, q):
    server, control = ends
    control.send(control_status(**{named: q}))
    control.send(known := control_status(**{named: (0.0, 0.6, -0.8, 0.0)}))
    assert server.statuses() == [known]
    assert server.dropped == 1


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
    assert server.send(TOUCH)
    control.close()
    assert not server.send(IMU)
    assert server.dropped == 2
    successor = control_end(tmp_path)
    assert server.send(READY)
    assert wire(successor.inputs()) == wire([READY])
    successor.close()
    server.close()


def test_a_full_queue_is_no_error_and_what_is_lost_is_counted(ends):
    server, control = ends
    sent = sum(server.send(IMU) for _ in range(5_000))
    assert sent + server.dropped == 5_000
    assert server.dropped > 0
    assert len(control.inputs(10_000)) == sent


def test_what_is_larger_than_a_socket_takes_is_no_error_either(ends):
    server, control = ends
    control._socket.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, 4_096)
    assert not control.send(control_status(reason="x" * 100_000))
    assert control.dropped == 1
    assert control.send(control_status())
    assert len(server.statuses()) == 1


def test_a_turn_takes_no_more_than_its_limit(ends):
    server, control = ends
    server.send(IMU)
    server.send(TOUCH)
    assert wire(control.inputs(limit=1)) == wire([IMU])
    assert wire(control.inputs(limit=1)) == wire([TOUCH])


def test_one_that_died_without_cleaning_up_is_replaced(tmp_path):
    first = control_end(tmp_path)
    second = control_end(tmp_path)
    server = server_end(tmp_path)
    server.send(READY)
    assert wire(second.inputs()) == wire([READY])
    for end in (first, second, server):
        end.close()


def test_signals_survive_the_journey_as_arrays_of_their_own():
    rng = np.random.default_rng(0)
    a, b, c = rng.normal(size=(3, 3))
    measured = RelativePose(2.5, c, rng.normal(size=(3, 3)).T, rng.normal(size=(6, 6)), 0.4, 6)
    rays = LedRays(
        np.array([4, 1]), rng.normal(size=2), rng.normal(size=(2, 2)), rng.normal(size=(2, 2, 2))
    )
    offset = StampOffset(0.05, 0.002)
    sample = decode(encode(PhoneImu(1.5, a, b)))
    assert isinstance(sample, PhoneImu)
    np.testing.assert_array_equal((sample.omega_m_cf_in_c, sample.a_m_cf_in_c), (a, b))
    assert sample.a_m_cf_in_c.flags.writeable  # or no kernel takes it
    seen = decode(encode(VisionMeasurement(2.5, rays, measured, (0.7, 0.4), offset)))
    assert isinstance(seen, VisionMeasurement)
    assert (seen.t, seen.half_field, seen.offset) == (2.5, (0.7, 0.4), offset)
    for name in ("led", "t", "tangents", "covariances"):
        np.testing.assert_array_equal(getattr(seen.rays, name), getattr(rays, name))
    assert seen.pose is not None
    np.testing.assert_array_equal(seen.pose.R_cb, measured.R_cb)
    assert seen.pose.R_cb.flags.c_contiguous
    np.testing.assert_array_equal(seen.pose.covariance, measured.covariance)
    assert (seen.pose.t, seen.pose.reprojection_px, seen.pose.leds) == (2.5, 0.4, 6)
    nothing = decode(encode(VisionMeasurement(2.5, NO_RAYS, None)))
    assert isinstance(nothing, VisionMeasurement)
    assert (nothing.pose, nothing.offset, len(nothing.rays)) == (None, None, 0)
    assert nothing.rays.tangents.shape == (0, 2)
    assert nothing.rays.covariances.shape == (0, 2, 2)
    touch = decode(encode(TouchState(3.5, True, 9)))
    assert isinstance(touch, TouchState)
    assert (touch.t, touch.held, touch.press) == (3.5, True, 9)
