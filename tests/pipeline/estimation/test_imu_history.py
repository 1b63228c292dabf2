"""IMU samples arrive in any order and are kept in the order of their times."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from pipeline.estimation.imu_history import BODY, PHONE, ImuHistory

arrivals = st.lists(st.tuples(st.integers(0, 30), st.sampled_from((BODY, PHONE))), max_size=40)


def filled(samples, capacity=64):
    history = ImuHistory(capacity)
    news = [history.insert(float(t), kind, np.full(3, t), np.full(3, kind)) for t, kind in samples]
    return history, news


def content(history):
    return list(zip(history.times.tolist(), history.kinds.tolist(), strict=True))


@given(arrivals)
def test_any_order_of_arrival_gives_the_sorted_set(samples):
    history, news = filled(samples)
    assert content(history) == sorted(set(samples))
    assert sum(news) == len(history)
    assert np.array_equal(history.values[:, 0], history.times)
    assert np.array_equal(history.values[:, 5], history.kinds)


@given(arrivals, st.integers(-1, 31))
def test_forgetting_leaves_what_is_newer(samples, t):
    history, _ = filled(samples)
    history.forget_until(float(t))
    assert content(history) == sorted({sample for sample in samples if sample[0] > t})


@given(arrivals, st.integers(0, 30), st.sampled_from((BODY, PHONE)))
def test_the_nearest_of_a_kind(samples, t, kind):
    history, _ = filled(samples)
    gaps = [abs(time - t) for time, other in samples if other == kind]
    i = history.nearest(float(t), kind)
    assert (i < 0) == (not gaps)
    if gaps:
        assert history.kinds[i] == kind
        assert abs(history.times[i] - t) == min(gaps)


def test_a_full_history_keeps_its_newest_half_and_order():
    history, _ = filled([(t, BODY) for t in range(1000)], capacity=16)
    assert 8 <= len(history) <= 16
    assert content(history) == [(float(t), BODY) for t in range(1000 - len(history), 1000)]
    assert history.newest == [999.0, -np.inf]
