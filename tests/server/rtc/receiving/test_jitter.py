"""Packets to pictures: at the last packet, in order, and never long behind a loss."""

import random
from dataclasses import dataclass
from math import inf

import pytest
from hypothesis import given
from hypothesis import strategies as st

from server.protocol.wire import MAX_RECORD_BYTES
from server.rtc.receiving.jitter import ASK_AGAIN_S, CAPACITY, JitterBuffer

PATIENCE_S = 0.1


@dataclass
class Packet:
    sequence_number: int
    timestamp: int
    marker: int
    _data: bytes
    payload_type: int = 99


def stream(*sizes, first=65_530, keys=(0,)):
    """Pictures of so many packets each; a key begins with K, others with a digit."""
    packets = []
    for k, size in enumerate(sizes):
        for i in range(size):
            text = f"{'K' if k in keys and i == 0 else '.'}{k}:{i} "
            number = first + len(packets) & 0xFFFF
            packets.append(Packet(number, 3000 * k, int(i == size - 1), text.encode()))
    return packets


class Rig:
    def __init__(self):
        self.t = 10.0
        self.frames = []
        self.buffer = JitterBuffer(
            lambda _type, data: data.startswith(b"K"),
            self.frames.append,
            lambda: self.t,
            lambda: PATIENCE_S,
        )

    def add(self, *packets):
        asked = [self.buffer.add(packet)[0] for packet in packets]
        return any(asked)

    @property
    def texts(self):
        return [frame.data.decode() for frame in self.frames]


@pytest.fixture
def rig():
    return Rig()


def test_a_picture_goes_on_with_its_last_packet_not_with_the_next_picture(rig):
    packets = stream(3)
    rig.add(*packets[:2])
    assert rig.frames == []
    rig.add(packets[2])
    assert rig.texts == ["K0:0 .0:1 .0:2 "]


@given(st.data())
def test_whatever_the_order_all_pictures_come_once_and_in_order(data):
    sizes = data.draw(st.lists(st.integers(1, 5), min_size=1, max_size=8))
    packets = stream(*sizes, first=data.draw(st.integers(0, 65_535)))
    rest = data.draw(st.permutations(packets[1:]))
    rig = Rig()
    assert not rig.add(packets[0], *rest, *packets)
    assert len(rig.frames) == len(sizes)
    assert "".join(rig.texts) == "".join(p._data.decode() for p in packets)
    assert [frame.number for frame in rig.frames] == list(range(1, len(sizes) + 1))


def on_a_line(rng, packets, loss):
    """When each packet comes [s]: in any order within twice our patience, or never."""
    arrivals = [2e-3 * n + rng.choice([0.0, 0.0, 0.03, 0.09, 0.2]) * rng.random() for n in
                range(len(packets))]  # fmt: skip
    return [-1.0, *(inf if rng.random() < loss else t for t in arrivals[1:])]


def in_order(arrivals):
    """When an ideal reorderer hands on each packet [s]: its own wait, or that for one before it.

    It waits for a missing one until the first of those behind has waited for PATIENCE_S.
    """
    released, t = [], -inf
    for n, arrival in enumerate(arrivals):
        until = max(t, min(arrivals[n + 1 :], default=inf) + PATIENCE_S)
        t = max(t, min(arrival, until))
        released.append(t if arrival <= until else inf)
    return released


def whole_pictures(released, sizes, keys):
    """(when, which) of the pictures that are whole and lean on none that is not."""
    pictures, first, is_good = [], 0, False
    for k, size in enumerate(sizes):
        parts, first = released[first : first + size], first + size
        is_good = inf not in parts and (is_good or k in keys)
        if is_good:
            pictures.append((parts[-1], k))
    return pictures


def played(packets, arrivals, again):
    """(when, which) of the pictures that come out; some packets come `again` [s] later."""
    rig, came = Rig(), []
    events = [(t, n) for n, t in enumerate(arrivals) if t < inf]
    events += [(arrivals[n] + later, n) for n, later in again if arrivals[n] < inf]

    def until(t):
        while (due := rig.buffer.due()) is not None and due < t:
            rig.t = due
            rig.buffer.poll(due)
            taken()
            assert rig.buffer.due() != due
        rig.t = t

    def taken():
        came.extend((rig.t, text) for text in rig.texts[len(came) :])

    for t, n in sorted(events):
        until(t)
        rig.add(packets[n])
        taken()
    until(inf)
    return [(t, int(text[1 : text.index(":")])) for t, text in came]


@pytest.mark.parametrize("loss", [0.0, 0.02, 0.2])
@given(st.integers(0, 2**32 - 1))
def test_each_picture_comes_when_an_ideal_reorderer_has_it_whole_and_no_other(loss, seed):
    rng = random.Random(seed)
    sizes = [rng.randint(1, 5) for _ in range(rng.randint(1, 40))]
    keys = {0, *(k for k in range(len(sizes)) if rng.random() < 0.2)}
    packets = stream(*sizes, first=rng.randrange(65_536), keys=keys)
    arrivals = on_a_line(rng, packets, loss)
    again = [(n, rng.random()) for n in range(1, len(packets)) if rng.random() < 0.1]
    came = played(packets, arrivals, again)
    wanted = whole_pictures(in_order(arrivals), sizes, keys)
    assert [k for _, k in came] == [k for _, k in wanted]
    assert [t for t, _ in came] == pytest.approx([t for t, _ in wanted], abs=1e-9)


def test_packets_that_only_fill_the_line_are_no_pictures(rig):
    packets = stream(2, 1)
    filling = [Packet(packets[2].sequence_number + i & 0xFFFF, 0, 0, b"") for i in range(3)]
    packets[2].sequence_number = packets[2].sequence_number + 3 & 0xFFFF
    rig.add(*packets[:2], *filling, packets[2])
    assert rig.texts == ["K0:0 .0:1 ", ".1:0 "]


def test_a_picture_without_a_mark_ends_where_the_next_one_begins(rig):
    packets = stream(2, 1)
    packets[1].marker = 0
    rig.add(*packets)
    assert rig.texts == ["K0:0 .0:1 ", ".1:0 "]


def test_a_hole_is_waited_for_and_filled(rig):
    packets = stream(1, 3, 1)
    rig.add(packets[0], packets[1], *packets[3:])
    rig.t += 0.9 * PATIENCE_S
    assert not rig.buffer.poll(rig.t)
    rig.add(packets[2])
    assert len(rig.frames) == 3
    assert rig.buffer.due() is None


def test_after_a_hole_that_stays_only_a_key_helps_and_is_asked_for_at_once(rig):
    packets = stream(1, 2, 1, 1, 2, 1, keys=(0, 4))
    rig.add(packets[0], packets[1], packets[3])
    assert rig.buffer.due() == pytest.approx(rig.t + PATIENCE_S)
    rig.t += 1.01 * PATIENCE_S
    assert rig.buffer.poll(rig.t)
    assert not rig.add(packets[4])
    assert not rig.add(*packets[5:])
    assert rig.texts == ["K0:0 ", "K4:0 .4:1 ", ".5:0 "]
    assert [frame.number for frame in rig.frames] == [1, 3, 4]
    assert (rig.buffer.given_up, rig.buffer.needs_key) == (1, False)


def test_a_key_right_behind_the_hole_is_kept(rig):
    packets = stream(1, 2, 2, keys=(0, 2))
    rig.add(packets[0], packets[1], *packets[3:])
    rig.t += 1.01 * PATIENCE_S
    rig.buffer.poll(rig.t)
    assert rig.texts == ["K0:0 ", "K2:0 .2:1 "]


def test_the_request_for_a_key_is_repeated_while_useless_pictures_come(rig):
    packets = stream(*[1] * 9, keys=())
    asked = []
    for packet in packets:
        if rig.add(packet):
            asked.append(rig.t)
        rig.t += ASK_AGAIN_S / 3.0
    assert len(asked) == 3
    assert rig.frames == []
    assert rig.buffer.dropped == 9


def test_another_stream_begins_anew_with_a_key(rig):
    rig.add(*stream(1, 1, first=0))
    assert rig.add(*stream(1, 1, 1, first=CAPACITY + 100, keys=(1,)))
    assert rig.texts == ["K0:0 ", ".1:0 ", "K1:0 ", ".2:0 "]
    assert rig.buffer.restarts == 1


def test_a_late_packet_changes_nothing(rig):
    packets = stream(1, 2, 1, keys=(0, 2))
    rig.add(packets[0], packets[1], packets[3])
    rig.t += 1.01 * PATIENCE_S
    rig.buffer.poll(rig.t)
    before = rig.texts
    rig.add(packets[2], packets[0])
    assert rig.texts == before


def test_a_picture_without_end_is_not_kept_in_memory(rig):
    size = MAX_RECORD_BYTES // 64
    for number in range(2 * CAPACITY):
        rig.add(Packet(number, 0, 0, bytes(size)))
    assert rig.buffer._size <= MAX_RECORD_BYTES
    assert rig.frames == []
    assert rig.buffer.needs_key
