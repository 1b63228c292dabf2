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


def test_by_arrival_a_stream_that_begins_anew_is_dated_anew():
    dating = FrameTimestamping()
    for k in range(10):
        dating.date(None, ticks(k / 30.0), 1e6 * (5.0 + k / 30.0))
    assert dating.date(None, ticks(3600.0), 6e6).t_us == pytest.approx(6_000_000)
