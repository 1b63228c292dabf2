"""`lightleash experiments loop`: whose hand leads where nobody says."""

from __future__ import annotations

import argparse
from contextlib import nullcontext
from typing import Any

import pytest

from hardware.sim.measured_hands import MEASURED
from server.experiments import loop, main
from server.experiments.runner import RefusedError
from server.simulation.virtual_time import SimulationOptions
from server.virtual_phone import live_loop
from server.virtual_phone.command import make_parser
from tests.bench.blocks import PAGES


def test_hands_move_as_recorded_ones_do_if_nobody_says_otherwise() -> None:
    parser = argparse.ArgumentParser()
    loop.add_arguments(parser)
    hands = parser.parse_args([]).hands
    assert len(hands) == len(set(hands)) == 2
    assert set(hands) <= set(MEASURED)


def test_each_command_of_the_page_names_its_hands() -> None:
    """Else a block would say something else when it is made anew, by other usual hands."""
    lines = (PAGES / "loop.md").read_text().splitlines()
    commands = [line for line in lines if line.startswith(".venv/bin/lightleash experiments loop")]
    assert commands
    assert all("--hands " in command for command in commands)


@pytest.mark.parametrize(
    "words",
    [
        ["loop", "--hands", "steady", "shaky"],
        ["loop", "--hands", "shaky", "--live"],
        ["plants", "--hand", "shaky"],
        ["screen", "--hand", "shaky"],
    ],
    ids=" ".join,
)
def test_a_hand_that_there_is_not_is_refused_in_a_line(
    words: list[str], capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(words) == 2
    said = capsys.readouterr()
    assert said.err.startswith(f"lightleash experiments {words[0]}: hand: 'shaky' is neither")
    assert said.err.count("\n") == 1
    assert said.out == ""


def test_what_can_t_be_had_live_is_refused_before_a_server_starts(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.delattr(live_loop, "server")
    words = [
        "--live",
        "--misdated-ms",
        "-30",
        "--date-jitter-ms",
        "4",
        "--led-error-mm",
        "1",
        "--hide",
        "2",
        "3",
    ]
    assert main(["loop", "--hands", "still", *words]) == 2
    said = "--misdated-ms, --date-jitter-ms, --led-error-mm, --hide: not with --live\n"
    assert capsys.readouterr().err == f"lightleash experiments loop: {said}"


def test_a_phone_dates_its_pictures_as_wrongly_as_is_asked_for(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    asked: list[SimulationOptions] = []

    def fly(_robot_file: object, _config: object, scene: SimulationOptions) -> None:
        asked.append(scene)
        raise RefusedError("asked, not flown")

    monkeypatch.setattr(loop, "VirtualTimeSimulation", fly)
    words = ["--misdated-ms", "-30", "--date-jitter-ms", "4"]
    assert main(["loop", "--hands", "still", *words]) != 0
    sensors = asked[0].sensors
    assert sensors is not None
    assert (sensors.misdated_s, sensors.date_jitter_s) == pytest.approx((-0.03, 0.004))


def test_a_live_phone_is_as_asked_for(monkeypatch: pytest.MonkeyPatch) -> None:
    flown: list[tuple[object, str, float, int, list[str]]] = []
    monkeypatch.setattr(live_loop, "server", lambda *robot: nullcontext({"of": robot}))

    def fly(*flight: Any) -> dict[str, float]:
        flown.append(flight)
        return {"rms_mm": 3.0}

    monkeypatch.setattr(live_loop, "fly", fly)
    words = ["--live", "--fps", "15", "--latency-ms", "40", "80", "--codec", "jpeg"]
    words += ["--seconds", "7", "--seed", "3", "--around", "typical", "far"]
    assert main(["loop", "--robot", "copter", "--hands", "still", *words]) == 0
    phone = ["--fps", "15", "--latency-ms", "40-80", "--codec", "jpeg", "--around"]
    server = {"of": ("copter", "phone", "relative")}
    assert flown == [(server, "still", 7.0, 3, [*phone, scene]) for scene in ("typical", "far")]
    command = make_parser().parse_args(flown[0][-1])
    assert (command.fps, command.latency_ms, command.around) == (15.0, (0.04, 0.08), "typical")
