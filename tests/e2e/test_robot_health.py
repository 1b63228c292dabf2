"""What a robot tells of itself, through every process and socket, to pages, metrics and records."""

from __future__ import annotations

import contextlib
import json
import signal
from collections.abc import Iterator
from contextlib import closing
from pathlib import Path

import pytest

from hardware.robot_file import ROBOTS
from hardware.sim.truth import TruthClient
from server.control.robot_health import PRESSED
from server.recording.reader import read
from server.recording.writer import STATUS
from tests.e2e.serving import Serving, serving
from tests.e2e.test_serve import (
    ANSWER_S,
    RAMP_S,
    ZERO_N,
    flight,
    kill,
    mode,
    status,
    thrust,
    until,
)

pytestmark = pytest.mark.e2e
FULL_V, LOW_V, EMPTY_V, DRAIN_V_MIN = 11.4, 10.5, 9.9, 2.7
"""Low after 20 s, empty after 33 s, and what the judgement takes."""


@pytest.fixture(scope="module")
def server(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Serving]:
    folder = tmp_path_factory.mktemp("health")
    robot = folder / "mine.toml"
    limits = f"[battery]\nlow_v = {LOW_V}\nempty_v = {EMPTY_V}\n\n[link]"
    robot.write_text((ROBOTS / "ames.toml").read_text().replace("\n[link]", f"\n{limits}"))
    battery = ("--simulated.battery-v", str(FULL_V), "--simulated.drain-v-min", str(DRAIN_V_MIN))
    with serving(folder, "--robot", str(robot), *battery, "--simulated.e-stop") as running:
        until(lambda: mode(running) == "DISARMED", 20.0, "DISARMED")
        yield running


def battery(server: Serving) -> str:
    """Its level, as the server says; "" while it says nothing."""
    with contextlib.suppress(OSError, TypeError):
        return str(status(server)["battery"])
    return ""


def volts(server: Serving) -> float:
    """As its status says [V]; 0 while it is not known."""
    with contextlib.suppress(OSError, TypeError):
        return float(str(status(server)["battery_v"] or 0.0))
    return 0.0


def recorded(path: Path) -> list[list[object]]:
    """(level, voltage) of each status of a recording."""
    said = (json.loads(entry.data)["health"] for entry in read(path).entries(STATUS))
    return [health[:2] for health in said]


@pytest.mark.flight
def test_a_battery_drains_in_flight_is_told_everywhere_and_keeps_the_robot_from_the_next_one(
    server: Serving,
) -> None:
    until(lambda: volts(server) > 0.0, 5.0, "its battery: it may be DISARMED before it tells of it")
    before = volts(server)
    kill(server, "robot")
    until(lambda: volts(server) > before, 20.0, "the full battery of the next one")
    server.request("POST", "/api/recording")
    with flight(server):
        until(lambda: battery(server) == "low", 60.0, "low")
        shown = status(server)
        assert shown["mode"] == "TRACK"
        assert shown["health"] == [
            f"The robot's battery is low ({shown['battery_v']:.1f} V): bring it to rest soon."
        ]
        until(lambda: battery(server) == "empty", 60.0, "empty")
        shown = status(server)
        assert shown["mode"] == "TRACK"
        assert "bring it to rest now" in str(shown["health"])
        assert server.metric("lightleash_robot_battery_volts") == pytest.approx(EMPTY_V, abs=0.2)
    refused = str(status(server)["refusals"])
    assert "battery is empty" in refused
    assert "charge it before arming" in refused
    server.request("DELETE", "/api/recording")
    (path,) = (server.state / "recordings").glob("*.mcap")
    levels = [str(level) for level, _ in recorded(path)]
    assert list(dict.fromkeys(levels)) == ["good", "low", "empty"]
    said = str(status(server)["events"])
    assert "battery is low" in said
    assert "battery is empty" in said


@pytest.mark.flight
def test_an_emergency_stop_pressed_in_flight_stops_it_is_named_and_must_be_released_and_armed(
    server: Serving,
) -> None:
    kill(server, "robot")  # for a full battery
    until(lambda: battery(server) == "good", 20.0, "a full battery")
    with (
        closing(TruthClient(server.truth_port, timeout=ANSWER_S)) as truth,
        flight(server) as phone,
    ):
        kill(server, "robot", signal.SIGUSR1)
        until(lambda: thrust(truth) < ZERO_N, 1.0, "no thrust")
        phone.send_signal(signal.SIGSTOP)  # it would arm again
        try:
            until(lambda: status(server)["e_stop"] == "pressed", 2.0, "the pages know")
            assert status(server)["health"] == [PRESSED]
            until(lambda: mode(server) == "DISARMED", RAMP_S, "DISARMED")
            assert PRESSED in str(status(server)["refusals"])
            assert PRESSED in str(status(server)["events"])
            kill(server, "robot", signal.SIGUSR2)
            until(lambda: PRESSED not in str(status(server)["refusals"]), 2.0, "released")
            assert mode(server) == "DISARMED"
            assert thrust(truth) < ZERO_N
        finally:
            phone.send_signal(signal.SIGCONT)
        until(lambda: mode(server) == "TRACK", 30.0, "TRACK, armed anew by its phone")
