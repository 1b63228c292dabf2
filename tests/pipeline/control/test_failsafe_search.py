"""The failsafe searched as a whole: all states that inputs at, below and above each limit lead to.

Timers are quantised by the step, and the limits are short multiples of it, in the order of the
shipped ones: what the machine compares, it compares here, too. A monitor beside it remembers what
the laws speak of and the machine might not.
"""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from itertools import product
from typing import NamedTuple

import pytest

from pipeline.config import FailsafeConfig
from pipeline.control import failsafe
from pipeline.control.failsafe import (
    FLYING,
    FOREVER_MS,
    NO_REQUESTS,
    Failsafe,
    FailsafeInputs,
    FailsafeTimers,
)
from pipeline.signals import Mode, Requests

Said = tuple[str, str, str, str, tuple[str, ...]]
"""Gap, fault, doubt, block, refusals."""
D = 10
"""Step [ms]."""
LIMITS = FailsafeTimers(
    silent=D,
    fresh=2 * D,
    coast=4 * D,
    pose_arm=D,
    pose_hold=2 * D,
    gap=3 * D,
    phone_ramp=3 * D,
    pose_ramp=3 * D,
    ramp=3 * D,
    hold_max=6 * D,
    recover=4 * D,
    recover_short=3 * D,
    short=2 * D,
    armed_idle=7 * D,
)
HOVERS = replace(LIMITS, phone_ramp=FOREVER_MS)
EDGES = {
    *((mode, Mode.STOPPED) for mode in Mode if mode != Mode.STOPPED),
    (Mode.STOPPED, Mode.DISARMED),
    (Mode.DISARMED, Mode.ARMED),
    (Mode.ARMED, Mode.TRACK),
    (Mode.ARMED, Mode.DISARMED),
    (Mode.TRACK, Mode.COAST),
    (Mode.TRACK, Mode.HOLD),
    (Mode.COAST, Mode.TRACK),
    (Mode.COAST, Mode.HOLD),
    (Mode.HOLD, Mode.TRACK),
    *((mode, Mode.RAMP) for mode in FLYING),
    (Mode.RAMP, Mode.DISARMED),
}
"""Those of the table in `failsafe`."""
POWERED = (*FLYING, Mode.RAMP)
LONGEST_MS = 14 * D


def inputs() -> list[FailsafeInputs]:
    """At, below and above each limit; two unusual things at once where both are of consequence."""
    well = (0, 0, 0, 0)
    silent, gone, robot = (D + 1, 0, 0, 0), (3 * D + 1, 0, 0, 0), (0, 0, 0, 3 * D + 1)
    ages = [silent, gone, robot, (D, D, D, D), (3 * D, 0, 0, 0), (D + 1, 0, 0, D + 1)]
    ages += [(0, p, 0, 0) for p in (D + 1, 2 * D, 2 * D + 1, 3 * D, 3 * D + 1)]
    ages += [(0, 0, i, 0) for i in (D + 1, 3 * D, 3 * D + 1)]
    ages += [(0, 0, 0, r) for r in (D + 1, 3 * D)]
    fine: Said = ("", "", "", "", ())
    complaints: list[Said] = [("stood still", "", "", "", ()), ("", "spins", "", "", ())]
    complaints += [
        ("", "", "unsure", "", ()),
        ("", "", "", "a wall", ()),
        ("", "", "", "", ("no",)),
    ]
    arm, stop = Requests(arm=True), Requests(stop=True)
    wishes = [arm, Requests(disarm=True), Requests(reset=True), stop]
    wishes += [Requests(arm=True, disarm=True), Requests(stop=True, reset=True)]
    told = [(well, fine, NO_REQUESTS)]
    told += [(age, fine, NO_REQUESTS) for age in ages]
    told += [(well, complaint, NO_REQUESTS) for complaint in complaints]
    told += [(well, fine, wish) for wish in wishes]
    told += [(age, one, NO_REQUESTS) for age in (silent, gone, robot) for one in complaints]
    told += [(age, fine, wish) for age in (silent, gone, robot) for wish in wishes]
    told += [(well, one, wish) for one in complaints for wish in wishes]
    coasts = [FailsafeInputs(True, 1, *well, "deaf", robot_left_ms=left) for left in (0, D)]
    coasts += [FailsafeInputs(True, 1, *well, is_settled=False)]
    return coasts + [
        FailsafeInputs(held, press, *age, *complaint, wish)
        for held, press in product((False, True), range(2))
        for age, complaint, wish in told
    ]


class Step(NamedTuple):
    """One step of the machine: all of it that a history depends on."""

    before: Mode
    mode: Mode
    power: float
    held: bool
    press: int
    is_gone: bool
    """The phone was silent for longer than the gap."""
    is_silent: bool
    is_good: bool
    same: int
    """Number of the state that it leads to."""


class Monitor(NamedTuple):
    """What has happened, whatever the machine remembers of it."""

    over: int = 0
    """The last press that was seen to be over, or that led to TRACK."""
    lifted: bool = True
    """Since TRACK was last entered the finger was seen off that press."""
    coasted_ms: int = 0
    silent_ms: int = 0
    """For how long nothing has been good, without a break."""


def after(seen: Monitor, step: Step) -> Monitor:
    entered = step.mode == Mode.TRACK and step.before in (Mode.ARMED, Mode.HOLD)
    flew = step.before in (Mode.TRACK, Mode.COAST)
    let_go = not step.held or (flew and step.press != seen.over)
    return Monitor(
        over=step.press if entered or not step.held or step.is_gone else seen.over,
        lifted=not entered and (seen.lifted or let_go),
        coasted_ms=min(seen.coasted_ms + D, LONGEST_MS) if step.mode == Mode.COAST else 0,
        silent_ms=0 if step.is_good else min(seen.silent_ms + D, LONGEST_MS),
    )


def canonical(state: Failsafe) -> Failsafe:
    """Without words, and with timers saturated beyond the last limit that tells them apart."""
    return replace(
        state,
        mode_ms=min(state.mode_ms, LIMITS.armed_idle),
        good_ms=min(state.good_ms, LIMITS.recover),
        bad_ms=min(state.bad_ms, LIMITS.short + D),
        reason="",
    )


def is_silent(told: FailsafeInputs) -> bool:
    return max(told.robot_ms, told.operator_ms, told.phone_imu_ms) > D or bool(told.gap)


def check(before: Failsafe, told: FailsafeInputs, now: Failsafe, limits: FailsafeTimers) -> None:
    """Every law on one step that holds whatever was before."""
    power, wish = failsafe.ceiling(now, limits), told.requests
    gone = told.operator_ms > limits.gap
    if before.mode == Mode.STOPPED and wish.reset and not wish.stop and gone:
        assert now.mode == Mode.DISARMED
    assert (power > 0.0) <= (now.mode in POWERED)
    assert now.mode == before.mode or (before.mode, now.mode) in EDGES
    if wish.stop:
        assert now.mode == Mode.STOPPED
    if before.mode == Mode.STOPPED and now.mode != Mode.STOPPED:
        assert wish.reset
        assert not told.held or gone
    bad = (
        bool(told.fault or told.doubt or told.block)
        or is_silent(told)
        or told.pose_ms > limits.pose_hold
    )
    if now.mode == Mode.TRACK:
        assert told.held
        assert not bad
        if before.mode in (Mode.ARMED, Mode.HOLD):
            assert before.good_ms + D >= limits.recover_short
        if before.mode == Mode.COAST:
            assert now.good_ms >= limits.fresh + (0 if told.is_settled else limits.pose_arm)
    if now.mode == Mode.ARMED:
        assert not told.fault
        assert told.pose_ms <= limits.pose_hold
        assert not told.block
        assert not told.doubt or now.bad_ms <= limits.gap
        if before.mode == Mode.DISARMED:
            assert wish.arm
            assert not wish.disarm
            assert not told.refusals
            assert not told.held
            assert before.good_ms + D >= limits.recover_short
    if before.mode in FLYING and (told.fault or wish.disarm or told.robot_ms > limits.gap):
        assert now.mode in (Mode.RAMP, Mode.STOPPED)
    if before.mode == Mode.TRACK and now.mode == Mode.TRACK:
        assert not wish.disarm
    if before.mode == Mode.RAMP:
        assert power <= failsafe.ceiling(before, limits)
        assert now.mode != before.mode or power < failsafe.ceiling(before, limits)
    _check_words(told, now, limits)


def check_history(step: Step, seen: Monitor, later: Monitor, limits: FailsafeTimers) -> None:
    """Every law on one step that speaks of what was before."""
    if step.mode == Mode.TRACK:
        assert not later.lifted
        if step.before in (Mode.ARMED, Mode.HOLD):
            assert step.press != seen.over
        if step.before == Mode.COAST:
            assert step.press == seen.over
            assert not seen.lifted
            assert seen.coasted_ms <= limits.coast + limits.pose_arm
    assert later.coasted_ms <= limits.coast + limits.pose_arm + D
    if step.is_silent and seen.coasted_ms > limits.coast:
        assert step.mode not in (Mode.TRACK, Mode.COAST)
    if later.silent_ms > limits.hold_max + limits.ramp + 2 * D:
        assert step.power == 0.0


def _check_words(told: FailsafeInputs, now: Failsafe, limits: FailsafeTimers) -> None:
    """What the pages are told is true."""
    left = failsafe.until_ramp(now, told, limits)
    assert (left is None) == (now.mode not in (Mode.COAST, Mode.HOLD))
    assert left is None or 0 <= left <= min(limits.hold_max, told.robot_left_ms)
    if failsafe.resumes(now, told):
        assert told.held
        assert now.mode in (Mode.COAST, Mode.HOLD)


def search(limits: FailsafeTimers) -> tuple[set[Mode], set[tuple[Mode, Mode]], int]:
    """Modes and edges visited, and how many states there are, histories included."""
    every, start = inputs(), canonical(Failsafe())
    states, numbers = [start], {start: 0}

    @cache
    def steps(number: int) -> list[Step]:
        """What a state can become, each held against the laws: different ones, once each."""
        before, found = states[number], dict[Step, None]()
        for told in every:
            now = failsafe.step(before, told, D, limits)
            check(before, told, now, limits)
            same = canonical(now)
            if same not in numbers:
                numbers[same] = len(states)
                states.append(same)
            step = Step(
                before.mode,
                now.mode,
                failsafe.ceiling(now, limits),
                told.held,
                told.press,
                told.operator_ms > LIMITS.gap,
                is_silent(told),
                now.good_ms > 0,
                numbers[same],
            )
            found[step] = None
        return list(found)

    reached, new = {(0, Monitor())}, [(0, Monitor())]
    modes, edges = {Mode.DISARMED}, set[tuple[Mode, Mode]]()
    while new:
        waiting, new = new, []
        for number, seen in waiting:
            for step in steps(number):
                later = after(seen, step)
                check_history(step, seen, later, limits)
                modes.add(step.mode)
                if step.mode != step.before:
                    edges.add((step.before, step.mode))
                found = step.same, later
                if found not in reached:
                    reached.add(found)
                    new.append(found)
    return modes, edges, len(reached)


@pytest.mark.slow
@pytest.mark.parametrize("limits", [LIMITS, HOVERS], ids=["hangs", "hovers"])
def test_every_reachable_state_keeps_every_law_by_the_documented_edges_and_no_others(
    limits: FailsafeTimers,
) -> None:
    modes, edges, states = search(limits)
    assert modes == {*Mode}
    assert edges == EDGES
    assert states > 1_000


def test_the_searched_limits_are_in_the_order_of_the_shipped_ones() -> None:
    hangs, hovers = (FailsafeTimers.of(FailsafeConfig(), 2.3, hangs=one) for one in (True, False))
    assert LIMITS.gap == LIMITS.phone_ramp
    assert hangs.gap == hangs.phone_ramp
    assert HOVERS.phone_ramp == hovers.phone_ramp == FOREVER_MS
    for limits in (LIMITS, HOVERS, hangs, hovers):
        assert limits.fresh < limits.recover_short < limits.recover
        assert limits.silent < limits.gap
        assert limits.silent <= limits.pose_arm < limits.pose_hold < limits.pose_ramp
        assert limits.short < limits.coast
        assert limits.coast + limits.pose_arm < limits.hold_max < limits.armed_idle


def test_the_table_in_the_docstring_and_in_the_architecture_is_the_one_searched() -> None:
    text = failsafe.__doc__ or ""
    listed = set[tuple[Mode, Mode]]()
    for line in text.splitlines():
        cells = [cell.strip() for cell in line.split("|")]
        if len(cells) == 5 and cells[2] in Mode.__members__:
            one, to = cells[1], Mode[cells[2]]
            sources = [m for m in Mode if m != to] if one == "any other" else one.split(", ")
            listed |= {(Mode[m] if isinstance(m, str) else m, to) for m in sources}
    assert listed == EDGES
