"""ImuStream: samples arrive in any order and are kept in the order of their times."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from pipeline.frames import exp, log
from pipeline.imu_stream import MAX_GAP_S, ImuStream

arrivals = st.lists(st.integers(0, 30), max_size=40)


def filled(times, capacity=64):
    stream = ImuStream(capacity)
    news = [stream.insert(float(t), np.full(3, t), np.full(3, -t)) for t in times]
    return stream, news


@given(arrivals)
def test_any_order_of_arrival_gives_the_sorted_set(times):
    stream, news = filled(times)
    assert stream.times.tolist() == sorted(set(times))
    assert sum(news) == len(stream)
    assert np.array_equal(stream.values[:, 0], stream.times)
    assert np.array_equal(stream.values[:, 5], -stream.times)


@given(arrivals, st.integers(-1, 31))
def test_forgetting_leaves_what_is_newer(times, t):
    stream, _ = filled(times)
    stream.forget_until(float(t))
    assert stream.times.tolist() == sorted({time for time in times if time > t})


@given(arrivals, st.integers(0, 3000))
def test_what_was_felt_near_a_time_is_the_nearest_sample_within_a_gap(times, hundredths):
    stream, _ = filled(times)
    t = 0.01 * hundredths
    gaps = [abs(time - t) for time in times]
    found = stream.near(t)
    assert (found is None) == (not gaps or min(gaps) > MAX_GAP_S)
    if found is not None:
        assert abs(found[0] - t) == min(gaps)


def test_a_full_stream_keeps_its_newest_half_and_order():
    stream, _ = filled(range(1000), capacity=16)
    assert 8 <= len(stream) <= 16
    assert stream.times.tolist() == [float(t) for t in range(1000 - len(stream), 1000)]
    assert stream.newest == 999.0


def turning(times, rate):
    """A stream of a gyroscope that turns at `rate(t)` (3,)."""
    stream = ImuStream()
    for t in times:
        stream.insert(float(t), rate(t), np.zeros(3))
    return stream


def test_between_two_samples_what_was_felt_is_between_theirs_and_beyond_all_the_nearest():
    stream, _ = filled([1, 2])
    assert [stream.at(t)[0] for t in (0.0, 1.0, 1.25, 2.0, 9.0)] == [1.0, 1.0, 1.25, 2.0, 2.0]


def test_a_constant_rate_is_followed_exactly_between_samples():
    omega = np.array([0.3, -1.0, 0.5])
    stream = turning(0.01 * np.arange(100), lambda t: omega)
    for t in (0.123, 0.9899):
        assert np.linalg.norm(log(stream.turn(0.0, t).T @ exp(omega * t))) < 1e-6
    assert np.linalg.norm(log(stream.turn(0.7, 0.2).T @ exp(-0.5 * omega))) < 1e-6


def test_a_changing_rate_is_followed_to_second_order():
    stream = turning(0.01 * np.arange(200), lambda t: np.array([np.sin(3.0 * t), 0.0, 0.0]))
    assert abs(log(stream.turn(0.0, 1.5))[0] - (1.0 - np.cos(4.5)) / 3.0) < 1e-4


@given(st.permutations(range(20)), st.integers(0, 19))
def test_a_late_sample_is_heeded_as_if_it_had_come_in_time(order, asked):
    def rate(t):
        return np.array([t, 1.0 - t, 0.5])

    late, stream = ImuStream(), turning(0.05 * np.arange(20), rate)
    for n, k in enumerate(order):
        late.insert(0.05 * k, rate(0.05 * k), np.zeros(3))
        if n == asked:
            assert late.gap_end <= late.newest
    np.testing.assert_allclose(late.turn(0.5, 0.9), stream.turn(0.5, 0.9), atol=1e-12)


def test_a_gap_begins_anew():
    stream = turning((0.0, 0.05, 1.0, 1.05), lambda t: np.ones(3))
    assert stream.gap_end == stream.oldest == 1.0
    assert stream.between(0.0, 1.02) is None
    assert stream.between(1.01, 1.05)[0].tolist() == [1.0, 1.05]
    assert stream.between(1.01, 1.06) is None
    assert ImuStream().oldest == np.inf


def test_turns_survive_that_the_older_half_is_forgotten():
    stream, n = ImuStream(64), 150
    for k in range(n):
        stream.insert(0.01 * k, np.array([0.1, 0.0, 0.0]), np.zeros(3))
        assert stream.oldest == stream.times[0]
    assert stream.oldest > 0.5
    turned = log(stream.turn(stream.oldest, stream.newest))[0]
    assert abs(turned - 0.1 * (stream.newest - stream.oldest)) < 1e-9
