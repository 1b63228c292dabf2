"""When a picture was taken: by its record, else by a pair of times, else by its arrival."""

import random

import pytest

from server.phone.ingest import ARRIVAL_S
from server.rtc.receiving.frame_timestamping import (
    OLDEST_PAIR_S,
    REMEMBERED_PAIRS,
    FrameTimestamping,
)
from server.rtc.receiving.metadata_trailer import FrameRecord

RECORD = FrameRecord(1, 42, 0, None)


def ticks(t_s, begin=2**32 - 1000):
    return begin + round(90_000 * t_s) & 0xFFFFFFFF


def test_its_own_record_is_believed_first():
    dating = FrameTimestamping()
    dating.pair(ticks(1.0), 999)
    date = dating.date(RECORD, ticks(1.0), 5e6)
    assert (date.t_us, date.source) == (42, "record")


def test_the_pair_of_the_picture_then_the_newest_pair_and_the_time_between():
    dating = FrameTimestamping()
    dating.pair(ticks(1.0), 7_000_000)
    assert dating.date(None, ticks(1.0), 9e6).t_us == 7_000_000
    later = dating.date(None, ticks(1.1), 9e6)
    assert (later.t_us, later.source) == (7_100_000, "pair")
    assert dating.date(None, ticks(1.0 + 2 * OLDEST_PAIR_S), 20e6).source == "arrival"


def test_old_pairs_are_forgotten():
    dating = FrameTimestamping()
    for k in range(3 * REMEMBERED_PAIRS):
        dating.pair(k, k)
    assert len(dating._pairs) == REMEMBERED_PAIRS


def test_by_arrival_the_jitter_of_the_line_goes_and_its_least_delay_stays():
    rng, dating = random.Random(3), FrameTimestamping()
    errors = []
    for k in range(600):
        taken = k / 30.0
        arrival = taken + 0.03 + rng.expovariate(1 / 0.02)
        date = dating.date(None, ticks(taken), 1e6 * (100.0 + arrival))
        assert date.source == "arrival"
        errors.append(1e-6 * date.t_us - 100.0 - taken)
    late = errors[150:]
    assert max(late) - min(late) < 0.005  # of 80 ms and more
    assert min(late) == pytest.approx(0.03, abs=0.002)
    assert min(late) < ARRIVAL_S


DRIFT = 1e-4
"""100 ppm: how much the stamps' clock goes too fast, or too slowly."""


def late(dating, begin_s, drift, rng, stamps_from):
    """How late the pictures of an hour are dated by arrival [s], ten a second."""
    for k in range(36_000):
        taken = begin_s + k / 10.0
        arrival = taken + 0.03 + rng.expovariate(1 / 0.01)
        stamp = ticks((taken - begin_s) * (1.0 + drift), stamps_from)
        yield 1e-6 * dating.date(None, stamp, 1e6 * arrival).t_us - taken


@pytest.mark.parametrize("drift", [-DRIFT, DRIFT])
def test_by_arrival_an_hour_of_clocks_that_drift_and_a_restart_leave_no_error(drift):
    """A least delay lives for 300 pictures at most: 30 s, in which 100 ppm are 3 ms."""
    rng, dating, settled = random.Random(4), FrameTimestamping(), 300
    for begin, stamps in ((100.0, 2**32 - 1000), (3700.0, 123_456)):
        errors = list(late(dating, begin, drift, rng, stamps))[settled:]
        assert min(errors) > 0.03 - 3.1e-3
        assert max(errors) < 0.03 + 2e-3


@pytest.mark.parametrize("drift", [-DRIFT, DRIFT])
def test_by_pairs_clocks_that_drift_are_no_further_off_than_an_old_pair(drift):
    dating = FrameTimestamping()
    for k in range(36_000):
        taken = 100.0 + k / 10.0
        stamp = ticks(taken * (1.0 + drift))
        if k % 40 == 0:
            dating.pair(stamp, round(1e6 * taken))
        date = dating.date(None, stamp, 1e6 * (taken + 0.08))
        assert date.source == "pair"
        assert abs(1e-6 * date.t_us - taken) <= DRIFT * OLDEST_PAIR_S + 2e-5


def test_by_arrival_a_stream_that_begins_anew_is_dated_anew():
    dating = FrameTimestamping()
    for k in range(10):
        dating.date(None, ticks(k / 30.0), 1e6 * (5.0 + k / 30.0))
    assert dating.date(None, ticks(3600.0), 6e6).t_us == pytest.approx(6_000_000)
