"""Clock offset: within its own bound whatever the delays did, smooth, and back after a jump."""

from __future__ import annotations

import re
from dataclasses import dataclass

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from pipeline.timing.clock_line import MAX_DRIFT
from pipeline.timing.clock_synchronisation import (
    CONTRADICTIONS,
    LATEST_S,
    MAX_SLEW,
    SURE_S,
    ClockSynchronisation,
)

PERIOD_S = 0.05


@dataclass
class Remote:
    """Another machine, and the network to it."""

    seed: int = 0
    offset: float = 3600.0
    drift: float = 200e-6
    delay: tuple[float, float] = (0.005, 0.080)
    """One way [s]."""
    spikes: float = 0.1
    """Share of the answers that wait up to 0.4 s longer, one way only."""

    def __post_init__(self):
        self.rng = np.random.default_rng(self.seed)

    def reads(self, t):
        return t + self.offset + self.drift * t

    def answer(self, t):
        """(asked, remote, answered) of a question at `t`."""
        there, back = self.rng.uniform(*self.delay, 2) + self._spike()
        return t, self.reads(t + there), t + there + back

    def answers(self, t_from, t_to, period=PERIOD_S):
        """To questions all the time, in the order in which they come."""
        answers = [self.answer(t) for t in np.arange(t_from, t_to, period)]
        return sorted(answers, key=lambda a: a[2])

    def _spike(self):
        waits = np.zeros(2)
        if self.rng.uniform() < self.spikes:
            waits[self.rng.integers(2)] = self.rng.uniform(0.0, 0.4)
        return waits


def ask(clock, remote, t_from, t_to, period=PERIOD_S):
    """Questions, their answers taken. Gives [(t, error of `local`, bound)]."""
    return taken(clock, remote, remote.answers(t_from, t_to, period))


def taken(clock, remote, answers):
    """Answers taken. Gives [(t, error of `local`, bound)]."""
    rows = []
    for answer in answers:
        clock.add(*answer)
        t = answer[2]
        if clock.ready:
            rows.append((t, clock.local(remote.reads(t)) - t, clock.error))
    return np.array(rows)


def test_ten_minutes_of_drift_jitter_and_spikes():
    t, error, bound = ask(ClockSynchronisation(), Remote(), 0.0, 600.0, period=0.1).T
    assert (np.abs(error) <= bound).all()
    assert np.abs(error[t > 5.0]).max() < 6e-3
    assert np.abs(error[t > 60.0]).max() < 2e-3
    assert np.sqrt(np.square(error[t > 60.0]).mean()) < 5e-4


@settings(max_examples=20, deadline=None)
@given(
    seed=st.integers(0, 10_000),
    offset=st.floats(-1e5, 2e9),
    ppm=st.floats(-400.0, 400.0),
    least=st.floats(1e-4, 0.02),
    jitter=st.floats(0.0, 0.08),
    spikes=st.floats(0.0, 0.3),
)
def test_the_error_is_never_beyond_its_bound(seed, offset, ppm, least, jitter, spikes):
    remote = Remote(seed, offset, 1e-6 * ppm, (least, least + jitter), spikes)
    clock = ClockSynchronisation()
    t, error, bound = ask(clock, remote, 0.0, 20.0).T
    assert len(t) > 390
    assert (np.abs(error) <= bound + 1e-4).all()
    assert np.abs(error[t > 10.0]).max() <= 0.5 * least + 0.15 * jitter + 1e-4
    assert clock.restarts == 0


def test_delays_that_always_differ_are_within_the_bound_nobody_can_beat():
    remote, clock = Remote(spikes=0.0, delay=(0.002, 0.002)), ClockSynchronisation()
    for t in np.arange(0.0, 5.0, PERIOD_S):
        clock.add(t, remote.reads(t + 0.010), t + 0.012)
    error = clock.local(remote.reads(5.0)) - 5.0
    assert abs(error) == pytest.approx(0.004, abs=3e-4)
    assert abs(error) <= clock.error
    assert clock.round_trip == pytest.approx(0.012)


@settings(max_examples=15, deadline=None)
@given(seed=st.integers(0, 10_000), jump=st.sampled_from((-3000.0, -2.0, -0.5, 0.5, 2.0, 3000.0)))
def test_a_jump_is_found_and_mended_within_a_second(seed, jump):
    remote, clock = Remote(seed, delay=(0.0025, 0.04)), ClockSynchronisation()
    ask(clock, remote, 0.0, 10.0)
    before = clock.error
    remote.offset += jump
    answers = remote.answers(10.5, 11.5)
    rows = taken(clock, remote, answers)
    assert clock.restarts == 1
    # those who found it bound it from both sides; beyond that nobody can know
    found = [
        (remote.reads(answered) - told, told - remote.reads(asked))
        for asked, told, answered in answers[:CONTRADICTIONS]
    ]
    room = sum(np.min(found, axis=0))
    told = float(re.findall(r"jumped by (\S+) s", clock.reason)[0])
    assert told == pytest.approx(jump, abs=0.5 * room + before + 0.006)
    assert clock.ready
    assert (np.abs(rows[:, 1]) < 0.5 * abs(jump)).all(), "not even one date by the old clock"
    assert abs(rows[-1, 1]) <= rows[-1, 2] < 0.03


def test_one_false_answer_dates_nothing_and_changes_nothing():
    remote, clock = Remote(delay=(0.002, 0.004), spikes=0.0), ClockSynchronisation()
    ask(clock, remote, 0.0, 5.0)
    before = clock.local(remote.reads(5.0))
    clock.add(5.0, remote.reads(5.0) + 7.0, 5.004)
    assert not clock.ready
    ask(clock, remote, 5.05, 5.1)
    assert clock.ready
    assert clock.restarts == 0
    assert clock.local(remote.reads(5.0)) == pytest.approx(before, abs=1e-6)


def test_a_clock_that_is_slewed_is_followed():
    remote, clock = Remote(delay=(0.002, 0.008), drift=0.0), ClockSynchronisation()
    ask(clock, remote, 0.0, 60.0)
    remote.drift = 500e-6
    remote.offset -= 500e-6 * 60.0
    t, error, bound = ask(clock, remote, 60.0, 100.0).T
    assert (np.abs(error) <= bound + 1e-3).all()
    assert np.abs(error[t > 80.0]).max() < 2e-3
    assert clock.drift == pytest.approx(500e-6, abs=1e-4)
    assert clock.restarts == 0


@settings(max_examples=15, deadline=None)
@given(seed=st.integers(0, 10_000))
def test_dates_keep_their_order_and_never_step(seed):
    remote, clock = Remote(seed), ClockSynchronisation()
    ask(clock, remote, 0.0, 1.0)
    step = 1e-3
    t_remote, last = remote.reads(1.6), None
    answers = [remote.answer(t) for t in np.arange(1.6, 6.0, PERIOD_S)]
    for answer in sorted(answers, key=lambda a: a[2]):
        clock.add(*answer)
        while clock.ready and t_remote < remote.reads(answer[2]):
            t = clock.local(t_remote)
            if last is not None:
                told_early = 2 * MAX_SLEW * max(0.0, last - answer[2])  # what is to come may change
                assert t - last > (1 - MAX_SLEW - MAX_DRIFT) * step - told_early
                assert t - last < (1 + 2 * MAX_SLEW) * step + told_early
            last, t_remote = t, t_remote + step


@pytest.mark.parametrize("hung_s", [0.2, 0.7, 2.5])
def test_a_page_that_hangs_as_it_begins_misdates_nothing(hung_s):
    """All that was asked meanwhile is answered at once, and the first answer leaves much open."""
    remote, clock = Remote(delay=(0.002, 0.004), spikes=0.0), ClockSynchronisation()
    late = [remote.answer(t) for t in np.arange(0.0, hung_s, 1.0 / 60.0)]
    hung = [(asked, remote.reads(hung_s), hung_s + 0.003) for asked, _, _ in late]
    rows = taken(clock, remote, hung + remote.answers(hung_s, hung_s + 2.0, 1.0 / 60.0))
    assert len(rows) > 110
    assert np.abs(rows[:, 1]).max() <= SURE_S
    assert np.abs(rows[rows[:, 0] > hung_s + 0.2, 1]).max() < 3e-3


def test_a_network_that_is_slow_for_good_is_waited_for_no_longer_than_it_helps():
    remote, clock = Remote(delay=(0.18, 0.2), spikes=0.0), ClockSynchronisation()
    t, error, bound = ask(clock, remote, 0.0, 10.0).T
    assert LATEST_S < t[0] < LATEST_S + 0.5
    assert (np.abs(error) <= bound).all()


def test_is_not_ready_before_five_answers_and_refuses_answers_before_their_question():
    clock = ClockSynchronisation()
    with pytest.raises(ValueError, match="no answer"):
        _ = clock.offset
    for k in range(4):
        clock.add(k, k, k + 0.01)
    clock.add(5.0, 5.0, 4.0)
    clock.add(5.0, np.nan, 5.01)
    clock.add(-np.inf, 5.0, 5.01)
    assert not clock.ready
    clock.add(6.0, 6.0, 6.01)
    assert clock.ready
    assert clock.offset == pytest.approx(-0.005, abs=1e-3)
