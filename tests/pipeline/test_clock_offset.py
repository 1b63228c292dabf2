"""Clock offset: right to half the asymmetry of the quickest answer, whatever the others did."""

from __future__ import annotations

import numpy as np
import pytest

from pipeline.clock_offset import ClockOffset


def test_finds_an_hour_of_offset_through_jitter_and_drift() -> None:
    rng, clock = np.random.default_rng(0), ClockOffset()
    for k in range(400):
        t = 0.05 * k
        out, back = 0.001 + rng.exponential(0.01, 2)
        remote = 3600.0 + (1 + 200e-6) * (t + out)
        clock.add(t, remote, t + out + back)
        if k > 20:
            truth = 3600.0 + 200e-6 * t
            assert clock.offset == pytest.approx(truth, abs=0.5 * clock.round_trip + 3e-4)
    assert clock.local(3600.0 + 1.0) == pytest.approx(1.0, abs=0.01)


def test_is_not_ready_before_five_answers_and_refuses_answers_before_their_question() -> None:
    clock = ClockOffset()
    for k in range(4):
        clock.add(k, k, k + 0.01)
    clock.add(5.0, 5.0, 4.0)
    assert not clock.ready
    clock.add(6.0, 6.0, 6.01)
    assert clock.ready
