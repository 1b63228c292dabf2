"""A pause of the server is blamed on the machine as far as the witness proves it, no farther."""

from __future__ import annotations

import os
import signal
import time
from contextlib import closing

import pytest

from tests.e2e.flight_log import FlightLog, Said
from tests.e2e.server_pauses import own_s, pauses
from tests.e2e.serving import serving
from tests.e2e.test_serve import processes
from tests.e2e.witness import Hole, Witness

pytestmark = pytest.mark.e2e


def said(*stalls_ms: float, mode: str = "TRACK") -> list[Said]:
    """Ten a second from 10 s on; each tells of a stall that ended 20 ms before it."""
    return [
        Said(
            10.0 + 0.1 * n,
            mode,
            "",
            {"recent_stall_ms": ms, "recent_stall_until_ms": 9_980.0 + 100.0 * n},
        )
        for n, ms in enumerate((0.0, *stalls_ms))
    ]


def test_each_pause_that_is_too_long_is_told_also_behind_a_longer_one() -> None:
    assert [one.s for one in pauses(said(300.0, 19.0, 20.0, 45.0))] == pytest.approx([0.3, 0.045])
    assert own_s(said(300.0, 45.0), [Hole("machine", 10.08, 0.3)]) == pytest.approx(0.045)
    assert pauses(said(300.0, mode="DISARMED")) == []
    assert own_s(said(12.0), []) == 0.0


@pytest.mark.parametrize(
    ("holes", "own_ms"),
    [
        ([], 80.0),
        ([Hole("machine", 10.08, 0.07)], 10.0),
        ([Hole("machine", 10.04, 0.03), Hole("machine", 10.08, 0.03)], 20.0),
        ([Hole("machine", 10.2, 0.5)], 0.0),
        ([Hole("machine", 10.02, 0.5)], 50.0),
        ([Hole("machine", 10.2, 0.07)], 80.0),
        ([Hole("stolen", 10.5, 0.12)], 0.0),
        ([Hole("stolen", 10.7, 0.12)], 80.0),
        ([Hole("others", 10.08, 0.5), Hole("page", 10.08, 0.5), Hole("slow", 10.08, 0.5)], 80.0),
    ],
)
def test_only_the_machine_excuses_and_only_as_long_as_it_was_away_then(holes, own_ms) -> None:
    assert own_s(said(80.0), holes) == pytest.approx(1e-3 * own_ms)


@pytest.mark.flight
def test_a_server_that_is_stopped_from_outside_has_paused_by_itself(tmp_path) -> None:
    """The machine was there: its witness ticked on."""
    with serving(tmp_path) as server, closing(Witness()) as witness:
        pid, began = processes(server.process.pid)["server"], time.monotonic()
        with closing(FlightLog(server)) as log:
            while len(log.said) < 3:
                time.sleep(0.01)
            os.kill(pid, signal.SIGSTOP)
            time.sleep(0.2)
            os.kill(pid, signal.SIGCONT)
            count = len(log.said) + 5
            while len(log.said) < count:
                time.sleep(0.01)
        armed = [Said(one.t, "ARMED", "", one.server) for one in log.said]
        assert own_s(armed, witness.holes(began)) > 0.15
