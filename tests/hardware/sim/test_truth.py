"""The truth of a simulated robot over its own small protocol."""

import socket
import threading

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from hardware.follower import FollowerError, FollowerState
from hardware.sim.truth import (
    AHEAD,
    MAX_BYTES,
    TruthClient,
    ahead_of,
    decode_truth,
    encode_truth,
)
from pipeline.frames import R_from_rpy, R_from_wxyz, log, wxyz_from_R

REQUEST = b"12345678"
IDLE = FollowerState.IDLE


def poses(n=50):
    for k in range(n):
        R = R_from_rpy(np.array([0.1 * np.sin(k), 0.02 * k, 0.05 * k]))
        yield 100.0 + 0.005 * k, np.array(wxyz_from_R(R)), np.array([0.1 * k, -0.2 * k, 0.3])


def test_a_full_answer_is_read_as_written_and_fits_a_datagram():
    rows = list(poses())
    data = encode_truth(REQUEST, rows, np.arange(8.0), FollowerState.COAST)
    truth = decode_truth(data, REQUEST)
    assert len(data) == 16 + 50 * 65 + 33 < MAX_BYTES
    np.testing.assert_array_equal(truth.t, [t for t, _, _ in rows])
    np.testing.assert_array_equal(truth.wxyz_fb, [q for _, q, _ in rows])
    np.testing.assert_array_equal(truth.p_bf_in_f, [p for _, _, p in rows])
    np.testing.assert_array_equal(truth.thrusts, np.arange(8.0))
    assert truth.state == FollowerState.COAST


@given(st.binary(max_size=400))
def test_any_other_bytes_are_no_answer(data):
    assert decode_truth(data, REQUEST) is None
    assert decode_truth(encode_truth(REQUEST, [], np.zeros(3), IDLE) + data, REQUEST) is None


def test_a_state_that_there_is_not_is_no_answer():
    data = encode_truth(REQUEST, list(poses()), np.zeros(8), IDLE)
    assert decode_truth(data, REQUEST) is not None
    assert decode_truth(data[:-1] + bytes([max(FollowerState) + 1]), REQUEST) is None


def test_the_answer_to_another_request_is_no_answer():
    assert (
        decode_truth(encode_truth(b"another!", list(poses()), np.zeros(8), IDLE), REQUEST) is None
    )


@given(st.floats(100.0, 100.245))
def test_between_two_ticks_the_pose_is_between_theirs(t):
    truth = decode_truth(encode_truth(REQUEST, list(poses()), np.zeros(8), IDLE), REQUEST)
    R, p = truth.at(t)
    k = (t - 100.0) / 0.005
    np.testing.assert_allclose(p, (0.1 * k, -0.2 * k, 0.3), atol=1e-9)
    near = R_from_wxyz(truth.wxyz_fb[round(k)])
    assert np.linalg.norm(log(near.T @ R)) < 0.08
    np.testing.assert_allclose(R @ R.T, np.eye(3), atol=1e-12)


@pytest.mark.parametrize(("t", "k"), [(0.0, 0), (100.0, 0), (100.245, 49), (1e6, 49)])
def test_beyond_its_memory_it_gives_the_nearest(t, k):
    truth = decode_truth(encode_truth(REQUEST, list(poses()), np.zeros(8), IDLE), REQUEST)
    R, p = truth.at(t)
    np.testing.assert_allclose(R, R_from_wxyz(truth.wxyz_fb[k]), atol=1e-12)
    np.testing.assert_allclose(p, truth.p_bf_in_f[k])


def test_a_single_pose_is_enough():
    truth = decode_truth(encode_truth(REQUEST, list(poses(1)), np.zeros(8), IDLE), REQUEST)
    np.testing.assert_allclose(truth.at(5.0)[1], truth.p_bf_in_f[0])


@pytest.fixture
def server():
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as s:
        s.bind(("127.0.0.1", 0))
        s.settimeout(5.0)
        yield s


def test_a_client_takes_the_answer_to_its_own_request_and_asks_only_for_news(server):
    def answer():
        request, client = server.recvfrom(100)
        server.sendto(b"nonsense", client)
        server.sendto(encode_truth(b"too late", list(poses(3)), np.zeros(8), IDLE), client)
        server.sendto(encode_truth(request, list(poses(40)), np.zeros(8), IDLE), client)

    client = TruthClient(server.getsockname()[1], timeout=5.0)
    thread = threading.Thread(target=answer)
    thread.start()
    assert len(client.latest().t) == 40
    thread.join()
    np.testing.assert_allclose(client.at(100.05)[1], (1.0, -2.0, 0.3))
    client.close()


def test_without_an_answer_it_says_so(server):
    client = TruthClient(server.getsockname()[1], timeout=0.01)
    with pytest.raises(FollowerError, match="no truth"):
        client.latest()
    client.close()


def test_without_a_robot_it_says_so(server):
    port = server.getsockname()[1]
    server.close()
    client = TruthClient(port, timeout=0.5)
    with pytest.raises(FollowerError, match=str(port)):
        client.at(0.0)
    client.close()


@pytest.mark.parametrize(
    ("tail", "ahead_s"),
    [(b"", 0.0), (AHEAD.pack(0.0625), 0.0625), (AHEAD.pack(0.3), None), (AHEAD.pack(-0.1), None),
     (AHEAD.pack(float("nan")), None), (b"abc", None)],
)  # fmt: skip
def test_a_request_says_how_far_ahead_or_is_none(tail, ahead_s):
    assert ahead_of(REQUEST + tail) == ahead_s


def test_an_answer_with_poses_ahead_fits_a_datagram_and_echoes_the_request():
    data = encode_truth(REQUEST + AHEAD.pack(0.2), list(poses(90)), np.zeros(16), IDLE)
    assert len(data) < MAX_BYTES
    assert len(decode_truth(data, REQUEST).t) == 90


def test_the_led_that_was_dark_is_told_with_its_tick():
    rows = list(poses(4))
    data = encode_truth(REQUEST, rows, np.zeros(8), IDLE, (-1, 2, 0))
    truth = decode_truth(data, REQUEST)
    assert truth.dark.tolist() == [-1, 2, 0, -1]
    assert [truth.dark_at(t + 0.001) for t in truth.t] == [-1, 2, 0, -1]
    assert truth.dark_at(truth.t[0] - 1.0) == -1
