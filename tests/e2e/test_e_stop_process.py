"""An emergency stop pressed in flight, by a real wire's file or a signal, over real sockets."""

from __future__ import annotations

import signal
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from hardware.contract import FollowerContract
from hardware.follower import EStop, FollowerState, Refusal
from tests.e2e.robot_rig import (
    RealTimeRig,
    compiled_watchdog,
    priority,
    simulated_robot,
    watchdog_robot,
)

pytestmark = pytest.mark.e2e
Pull = Callable[[bool], None]
WITHIN_S = 0.05


@pytest.fixture(params=["simulated", "watchdog in C"])
def wired(request: pytest.FixtureRequest, tmp_path: Path) -> Iterator[tuple[RealTimeRig, Pull]]:
    """A robot, and who presses its emergency stop."""
    wire = tmp_path / "value"
    wire.write_text("1\n")

    def write(pressed: bool) -> None:
        wire.write_text("0\n" if pressed else "1\n")

    def tell(pressed: bool) -> None:
        rig.process.send_signal(signal.SIGUSR1 if pressed else signal.SIGUSR2)

    with priority():
        if request.param == "simulated":
            rig, pull = simulated_robot("--e-stop"), tell
        else:
            rig, pull = watchdog_robot(compiled_watchdog(tmp_path), str(wire)), write
        yield rig, pull
        rig.close()


def test_pressed_in_flight_it_stops_and_released_it_needs_another_handshake(
    wired: tuple[RealTimeRig, Pull],
) -> None:
    rig, pull = wired
    contract = FollowerContract()
    contract.ready(rig)
    assert contract.fly(rig, 1.0, 0.3)[-1].state == FollowerState.RUNNING
    assert rig.follower.health is not None
    assert rig.follower.health[0].e_stop == EStop.CLOSED
    pull(True)
    samples = contract.fly(rig, 1.0, 0.3)
    stopped = [s for s in samples if s.state == FollowerState.STOPPED_BY_WIRE]
    assert len(samples) - len(stopped) <= WITHIN_S / 0.005
    assert samples[-len(stopped) :] == stopped
    assert stopped[-1].refusal == Refusal.WIRE
    assert rig.follower.health[0].e_stop == EStop.OPEN
    pull(False)
    assert {s.state for s in contract.fly(rig, 1.0, 1.0)} == {FollowerState.STOPPED_BY_WIRE}
    assert rig.follower.health[0].e_stop == EStop.CLOSED
    contract.ready(rig)
    assert contract.fly(rig, 1.0, 0.3)[-1].state == FollowerState.RUNNING


def test_pressed_at_the_start_it_never_gets_ready(wired: tuple[RealTimeRig, Pull]) -> None:
    rig, pull = wired
    pull(True)
    rig.advance(0.1)
    samples = FollowerContract.fly(rig, 0.0, 1.0)
    assert {s.state for s in samples} == {FollowerState.STOPPED_BY_WIRE}
    assert len(samples) > 100
