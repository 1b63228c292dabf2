"""The attack bench, briefly and without a judged flight: who may is answered, memory stays."""

from __future__ import annotations

import pytest

from tests.bench.bench_attacks import run

pytestmark = pytest.mark.e2e


def test_under_attack_phone_and_supervisor_are_answered_stop_works_and_memory_and_log_stay_small():
    outcome = run(6.0, 0.3, flies=False, path="websocket")
    *goals, _missed, _led, _error = outcome.goals()
    assert [words for met, words in goals if not met] == []
    assert outcome.tally["silent sockets"] == 600
    assert outcome.did["answers: 400 sdp.candidate"] >= 1
    assert outcome.done("bombs") >= 5, "each kind at least once"
