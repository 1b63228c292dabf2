"""The robot's gate, searched as a whole: every state that anything leads to, in Python and in C.

Two ends that differ only in times within the same limits, and in names of epochs, are one here;
from each such end everything that can happen happens, until nothing new comes of it.
"""

from __future__ import annotations

import copy
import ctypes
import re
from collections.abc import Iterator
from dataclasses import replace
from itertools import product

import numpy as np
import pytest

from hardware.follower import STOPPED, EStop, FollowerState, Refusal
from hardware.link import robot_end
from hardware.link.datagram import CommandDatagram, encode_command
from hardware.link.robot_end import LinkLimits, RobotEnd
from tests.hardware.link.test_watchdog import KEY, CRobotEnd
from tests.hardware.link.test_watchdog import library as library

LIMITS = LinkLimits(thrusters=1, f_max=3.0, max_rise=3.0, ramp_us=300_000)
HANDSHAKE_US, TICK_US = LIMITS.handshake_us, 5_000
PASSES_US = (TICK_US, 61_000, 170_000, 281_000, 401_000)
"""Time without a word."""
AFTER_US = (TICK_US, 50_000)
"""Time before a word: that and the limit of silence make ten steps of a handshake."""
WIRE = FollowerState.STOPPED_BY_WIRE
PEER = ("control", 1)
pytestmark = pytest.mark.slow
WORDS: tuple[tuple[str, float, dict[str, object]], ...] = (
    ("zero", 0.0, {}),
    ("thrust", 1.0, {}),
    ("stop", 0.0, {"stop": True}),
    ("late zero", 0.0, {"nonce": 0}),
    ("late stop", 0.0, {"nonce": 0, "stop": True}),
)


class Ends:
    """Both ends, and what the law asks of their past."""

    def __init__(self, library: ctypes.CDLL) -> None:
        self.python, self.c = RobotEnd(LIMITS, 7, KEY), CRobotEnd(library, LIMITS, 7)
        self.now_us, self.nonce, self.counter, self.newest = 1_000_000, 0, 0, 1
        self.wired = False
        self.shut_us = 0
        """When the wire was closed last, after it had stopped the robot."""
        self.tick(0)

    def copy(self) -> Ends:
        other = copy.copy(self)
        other.python, other.c = copy.deepcopy(self.python), copy.copy(self.c)
        other.c.memory = ctypes.create_string_buffer(self.c.memory.raw, len(self.c.memory))
        return other

    @property
    def key(self) -> tuple[object, ...]:
        """What is the same of two ends that nobody could tell apart."""
        end = self.python
        silence_us = self.now_us - end._taken_us
        shaking_us = self.now_us - end._handshake_us
        return (
            end.state,
            end.refusal,
            end.e_stop,
            bool(end._given),
            end._replaced,
            sum(silence_us > limit for limit in (60_000, 280_000, 400_000)),
            end._given.fading.is_over(self.now_us),
            end._epoch == 0,
            end._epoch == end._newest[0],
            end._candidate == end._newest[0],
            end._candidate != 0 and min(shaking_us, HANDSHAKE_US) // 50_000,
            end._candidate != 0 and self.now_us - end._shaken_us > 60_000,
            self.wired,
        )

    def tick(self, dt_us: int) -> float:
        """Time passes; the thrust then, and a sample whose nonce is fresh."""
        self.now_us += dt_us
        self.nonce += 1
        thrusts = [end.setpoint(self.now_us) for end in (self.python, self.c)]
        np.testing.assert_allclose(thrusts[0], thrusts[1], atol=1e-6)
        values = self.now_us, self.nonce, (0.0,) * 3, (0.0,) * 3, thrusts[1]
        assert self.python.sample(*values) == self.c.sample(*values)
        return float(thrusts[0][0])

    def hear(self, thrust: float, epoch: int, **changes: object) -> Refusal:
        self.counter += 1
        self.newest = max(self.newest, epoch)
        good = CommandDatagram(epoch, self.counter, self.nonce, 1, thrust > 0.0, (thrust,))
        data = encode_command(replace(good, **changes), KEY)
        why = self.python.receive(data, PEER, self.now_us)
        assert why == self.c.receive(data, PEER, self.now_us)
        return why

    def pull(self, *, is_open: bool) -> None:
        if self.python.state == WIRE and self.python.e_stop == EStop.OPEN and not is_open:
            self.shut_us = self.now_us
        self.wired = True
        self.python.wire(is_open=is_open)
        self.c.wire(is_open=is_open)

    def halt(self) -> None:
        self.python.halt()
        self.c.halt()


def happenings(ends: Ends) -> Iterator[tuple[str, Ends, Refusal | None]]:
    """Everything that can happen, each to ends of its own: what, to whom, what was said to it."""
    followed, newest = ends.python._epoch, ends.newest
    epochs = sorted({followed, newest, newest + 1, max(1, followed - 1)} - {0})
    for epoch, after_us, (what, thrust, changes) in product(epochs, AFTER_US, WORDS):
        other = ends.copy()
        other.tick(after_us)
        yield f"{what} of {epoch - newest}", other, other.hear(thrust, epoch, **changes)
    for dt_us in PASSES_US:
        other = ends.copy()
        other.tick(dt_us)
        yield f"{dt_us} us", other, None
    for is_open in (True, False):
        other = ends.copy()
        other.pull(is_open=is_open)
        yield f"open {is_open}", other, None
    other = ends.copy()
    other.halt()
    yield "halt", other, None


class Search:
    """What was found: ends by what tells them apart, and edges between states."""

    def __init__(self, library: ctypes.CDLL) -> None:
        first = Ends(library)
        self.known = {first.key}
        self.edges: set[tuple[FollowerState, FollowerState]] = set()
        waiting = [first]
        while waiting:
            ends = waiting.pop()
            for what, other, why in happenings(ends):
                judge(what, ends, other, why)
                self.edges.add((ends.python.state, other.python.state))
                if other.key not in self.known:
                    self.known.add(other.key)
                    waiting.append(other.copy())
                other.tick(0)  # what C then gives and says is the same


def judge(what: str, before: Ends, after: Ends, why: Refusal | None) -> None:
    """The laws of one happening."""
    old, end = before.python, after.python
    thrust = float(end.setpoint(after.now_us)[0])
    if end.e_stop == EStop.OPEN:
        assert (end.state, end.refusal) == (WIRE, Refusal.WIRE), what
        assert thrust == 0.0, what
        assert why != Refusal.NONE, f"{what}: taken while the emergency stop is pressed"
    if end.state in STOPPED:
        assert thrust == 0.0, what
    if old.state == WIRE and end.state != WIRE:
        assert (end.state, why, end.e_stop) == (FollowerState.REFUSING, Refusal.NONE, EStop.CLOSED)
        assert end._candidate > old._epoch, "out of it by a later epoch alone"
    if end.state == FollowerState.IDLE and old.state in STOPPED and after.wired:
        assert after.now_us - after.shut_us >= HANDSHAKE_US, "ready before a whole handshake"
    if end.state == WIRE and old.state != WIRE:
        assert what == "open True", what


def documented() -> set[tuple[FollowerState, FollowerState]]:
    """Edges of the table in `robot_end.py`."""
    rows = re.findall(
        r"^\| ([A-Z_, ]+|any other) *\| ([A-Z_, ]+?) *\|", robot_end.__doc__ or "", re.M
    )
    edges = set()
    for begin, end in rows:
        names = (
            [one.name for one in FollowerState] if begin.strip() == "any other" else named(begin)
        )
        for first in names:
            edges |= {(FollowerState[first], FollowerState[last]) for last in named(end)}
    return {(begin, end) for begin, end in edges if begin != end}


def named(cell: str) -> list[str]:
    return re.findall(r"[A-Z_]+", cell)


@pytest.fixture(scope="module")
def found(library: ctypes.CDLL) -> Search:
    return Search(library)


def test_every_state_is_reached_by_the_documented_edges_and_no_others(found: Search) -> None:
    edges = {(begin, end) for begin, end in found.edges if begin != end}
    assert {state for edge in edges for state in edge} == {*FollowerState}
    assert edges == documented()


def test_the_search_is_no_small_one_and_knows_each_state_with_and_without_a_wire(
    found: Search,
) -> None:
    assert len(found.known) > 500
    both = {(key[0], key[-1]) for key in found.known}
    assert both == {*product(FollowerState, (False, True))} - {(WIRE, False)}
