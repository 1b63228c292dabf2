"""The emulated line: laws that hold whatever is put in and whatever the line is like."""

from __future__ import annotations

import itertools
import struct
from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from hardware.sim.network.channel import (
    CLEAN,
    Burst,
    ChannelEmulator,
    Conditions,
    ConditionsError,
    spoilt,
)

CHANCES = st.floats(0.0, 1.0)
TIMES = st.floats(0.0, 0.2)
LINES = st.builds(
    Conditions,
    delay_s=TIMES,
    jitter_s=TIMES,
    loss=st.sampled_from([0.0, 0.01, 0.15, 1.0]),
    burst=st.none() | st.builds(Burst, enter=CHANCES, leave=CHANCES, loss=CHANCES),
    reorder=st.sampled_from([0.0, 0.1, 0.5]),
    hold_s=TIMES,
    duplicate=st.sampled_from([0.0, 0.1, 1.0]),
    rate_bps=st.sampled_from([float("inf"), 64e3, 2e6]),
    dark=st.booleans(),
)
SEEDS = st.integers(0, 1000)
INPUTS = st.lists(st.tuples(st.floats(0.0, 0.02), st.integers(20, 1500)), max_size=60)
"""(since the packet before [s], size [bytes])"""
END = 1e9


def packets(inputs: list[tuple[float, int]]) -> list[tuple[float, bytes]]:
    """Numbered, in the order of time."""
    t, made = 0.0, []
    for number, (pause, size) in enumerate(inputs):
        t += pause
        made.append((t, struct.pack("!I", number) + bytes(size - 4)))
    return made


def number(packet: bytes) -> int:
    return int(struct.unpack("!I", packet[:4])[0])


def through(line: ChannelEmulator, put: list[tuple[float, bytes]]) -> list[tuple[float, bytes]]:
    for t, packet in put:
        line.put(t, packet)
    return line.take(END)


@given(LINES, SEEDS, INPUTS)
def test_the_same_seed_does_the_same_to_the_same_packets(conditions, seed, inputs):
    put = packets(inputs)
    assert through(ChannelEmulator(conditions, seed), put) == through(
        ChannelEmulator(conditions, seed), put
    )


@given(LINES, SEEDS, INPUTS)
def test_every_packet_is_accounted_for(conditions, seed, inputs):
    line = ChannelEmulator(conditions, seed)
    out = through(line, packets(inputs))
    counts = line.counts
    gone = counts.lost + counts.burst_lost + counts.dark_lost + counts.overflowed
    assert counts.put == len(inputs)
    assert counts.put_bytes == sum(size for _, size in inputs)
    assert len(out) == counts.came == counts.put - gone + counts.duplicated
    assert counts.came_bytes == sum(len(packet) for _, packet in out)
    assert line.is_empty


@given(LINES, SEEDS, INPUTS)
def test_nothing_comes_before_its_delay_nor_after_all_that_may_hold_it(conditions, seed, inputs):
    put = packets(inputs)
    out = through(ChannelEmulator(replace(conditions, rate_bps=float("inf")), seed), put)
    for t, packet in out:
        late = t - put[number(packet)][0]
        most = conditions.delay_s + conditions.jitter_s + conditions.hold_s
        assert conditions.delay_s - 1e-9 <= late <= most + 1e-9


@given(LINES, SEEDS, INPUTS)
def test_only_packets_that_are_held_back_are_overtaken(conditions, seed, inputs):
    line = ChannelEmulator(conditions, seed)
    numbers = list(dict.fromkeys(number(packet) for _, packet in through(line, packets(inputs))))
    in_order = [n for k, n in enumerate(numbers) if n == max(numbers[: k + 1])]
    assert len(numbers) - len(in_order) <= line.counts.held_back


@given(SEEDS, INPUTS, CHANCES, CHANCES)
def test_what_a_line_loses_a_worse_one_loses_too(seed, inputs, one, other):
    put = packets(inputs)
    low, high = sorted((one, other))
    better = {number(p) for _, p in through(ChannelEmulator(Conditions(loss=low), seed), put)}
    worse = {number(p) for _, p in through(ChannelEmulator(Conditions(loss=high), seed), put)}
    assert worse <= better


@given(LINES, SEEDS, INPUTS, st.integers(0, 60))
def test_conditions_that_change_and_change_back_leave_the_rest_of_the_fate_alone(
    conditions, seed, inputs, at
):
    line = replace(conditions, rate_bps=float("inf"), burst=None)
    put = packets(inputs)
    plain, changed = ChannelEmulator(line, seed), ChannelEmulator(line, seed)
    for k, (t, packet) in enumerate(put):
        plain.put(t, packet)
        changed.conditions = replace(line, dark=True) if k == at else line
        changed.put(t, packet)
    came = [number(p) for _, p in changed.take(END)]
    assert set(came) == {number(p) for _, p in plain.take(END)} - {at}


@given(st.sampled_from([64e3, 500e3, 2e6]), SEEDS, INPUTS)
def test_no_stretch_of_time_carries_more_than_rate_and_bucket(rate_bps, seed, inputs):
    conditions = Conditions(rate_bps=rate_bps)
    line = ChannelEmulator(conditions, seed)
    out = through(line, packets(inputs))
    for first, (begin, _) in enumerate(out):
        size = 0
        for t, packet in out[first:]:
            size += len(packet)
            most = rate_bps / 8.0 * (t - begin) + conditions.bucket_bytes + 1500
            assert size <= most + 1e-6
    assert line.counts.longest_queue_bytes <= conditions.queue_bytes


@given(LINES, SEEDS, INPUTS, st.lists(st.floats(0.0, 2.0), max_size=10))
def test_taking_often_or_once_gives_the_same(conditions, seed, inputs, pauses):
    put = packets(inputs)
    once, often = ChannelEmulator(conditions, seed), ChannelEmulator(conditions, seed)
    expected = through(once, put)
    for t, packet in put:
        often.put(t, packet)
    taken, t = [], 0.0
    for pause in pauses:
        t += pause
        due = often.due()
        some = often.take(t)
        assert bool(some) == (due is not None and due <= t)
        taken += some
    assert taken + often.take(END) == expected
    assert often.due() is None


def test_a_burst_loses_in_runs():
    burst = Conditions(burst=Burst(enter=0.02, leave=0.15, loss=0.9))
    line = ChannelEmulator(burst, seed=4)
    out = {number(p) for _, p in through(line, packets([(0.001, 100)] * 20_000))}
    lost = [n not in out for n in range(20_000)]
    share = sum(lost) / len(lost)
    follows = sum(a and b for a, b in itertools.pairwise(lost)) / sum(lost)
    assert share == pytest.approx(0.9 * 0.02 / 0.17, rel=0.1)
    assert follows == pytest.approx(0.9 * 0.85, rel=0.1)  # bad goes on, and loses again
    assert line.counts.burst_lost == sum(lost)


@pytest.mark.parametrize("name", ["loss", "reorder", "duplicate", "corrupt"])
def test_shares_are_kept(name):
    line = ChannelEmulator(Conditions(**{name: 0.05}), seed=1)
    through(line, packets([(0.0, 40)] * 20_000))
    counted = {"loss": "lost", "reorder": "held_back", "duplicate": "duplicated"}
    happened = getattr(line.counts, counted.get(name, "corrupted"))
    assert happened == pytest.approx(1000, rel=0.1)


def udp(payload: bytes) -> bytes:
    """An IPv4 datagram."""
    header = struct.pack("!BBHHHBBH8x", 0x45, 0, 28 + len(payload), 0, 0, 64, 17, 0)
    return header + struct.pack("!HHHH", 1, 2, 8 + len(payload), 0xABCD) + payload


@given(st.binary(min_size=1, max_size=200), st.floats(0.0, 1.0, exclude_max=True))
def test_damage_reaches_the_program_one_bit_of_it(payload, place):
    packet, damaged = udp(payload), spoilt(udp(payload), place)
    assert damaged[:26] == packet[:26]
    assert damaged[26:28] == b"\0\0"  # no checksum: the kernel lets it pass
    assert bits(damaged[28:], payload) == 1


@given(st.binary(max_size=200), st.floats(0.0, 1.0, exclude_max=True))
def test_damage_to_anything_is_at_most_one_bit_and_a_checksum(packet, place):
    damaged = spoilt(packet, place)
    assert len(damaged) == len(packet)
    assert bits(damaged, packet) <= 17


def bits(one: bytes, other: bytes) -> int:
    return sum((a ^ b).bit_count() for a, b in zip(one, other, strict=True))


@pytest.mark.parametrize(
    "wrong",
    [
        {"loss": 1.1},
        {"duplicate": -0.1},
        {"delay_s": float("nan")},
        {"jitter_s": -1.0},
        {"rate_bps": 0.0},
        {"rate_bps": float("nan")},
        {"queue_bytes": 10},
    ],
)
def test_impossible_conditions_are_refused_with_their_name(wrong):
    with pytest.raises(ConditionsError, match=next(iter(wrong))):
        replace(CLEAN, **wrong)
    with pytest.raises(ConditionsError, match="leave"):
        Burst(0.1, 2.0, 0.5)
