"""`lightleash experiments loop`: whose hand leads where nobody says."""

from __future__ import annotations

import argparse

import pytest

from hardware.sim.measured_hands import MEASURED
from server.experiments import loop, main
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
