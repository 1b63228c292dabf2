"""Each parser bears its seeds, what once broke it and some thousand mutants; a bug is found."""

import re
import subprocess
import sys
from importlib.util import find_spec
from pathlib import Path

import pytest

from hardware.follower import FollowerState, Refusal
from hardware.link.robot_end import RobotEnd
from server.protocol import wire
from tests.fuzz import __main__ as command
from tests.fuzz.link_targets import RobotRig
from tests.fuzz.mutate import mutants
from tests.fuzz.planted import PLANTED
from tests.fuzz.sequence import pieces
from tests.fuzz.target import FOUND
from tests.fuzz.targets import TARGETS

one_round = command._round
ROOT = Path(__file__).parents[2]
SEED = 13


def mutate(target, count=None):
    """Check mutated seeds; fails with the first finding and its bytes."""
    for data in mutants(target.seeds, count or target.mutants, SEED, target.max_bytes):
        try:
            target.check(data)
        except Exception as error:
            raise AssertionError(f"{target.name} does not bear {data!r}") from error


def fuzz(*arguments, cwd):
    words = [sys.executable, "-m", "tests.fuzz", *arguments]
    return subprocess.run(words, cwd=cwd, capture_output=True, text=True, timeout=300)


@pytest.mark.parametrize("name", TARGETS)
def test_a_parser_bears_its_seeds_and_what_once_broke_it(name):
    target = TARGETS[name]
    assert target.seeds
    for data in [*target.seeds, *(path.read_bytes() for path in target.found())]:
        target.check(data)


@pytest.mark.parametrize("name", TARGETS)
def test_a_parser_bears_mutated_seeds(name):
    mutate(TARGETS[name])


@pytest.mark.parametrize("name", TARGETS)
def test_a_seed_is_taken_by_its_parser(name):
    """Else everything behind the first check would go untried."""
    target = TARGETS[name]

    def is_taken(data):
        try:
            target.run(data)
        except target.allowed:
            return False
        return True

    assert any(map(is_taken, target.seeds))


def test_the_robots_seeds_fly_so_that_its_laws_say_something():
    states = set()
    for seed in TARGETS["robot_end"].seeds:
        rig = RobotRig()
        for piece in pieces(seed):
            rig.step(piece)
            states.add(rig.end.state)
    assert states == set(FollowerState)


def test_thrust_that_nobody_asked_for_is_found(monkeypatch):
    monkeypatch.setattr(RobotEnd, "_judge_values", lambda *_: Refusal.NONE)
    with pytest.raises(AssertionError, match="robot_end does not bear"):
        mutate(TARGETS["robot_end"])


def test_every_stored_input_belongs_to_a_target():
    assert {path.name for path in FOUND.iterdir()} <= set(TARGETS)


def test_mutants_are_the_same_for_a_seed_and_no_longer_than_allowed():
    seeds = TARGETS["records"].seeds
    made = list(mutants(seeds, 300, 1, 100))
    assert made == list(mutants(seeds, 300, 1, 100))
    assert made != list(mutants(seeds, 300, 2, 100))
    assert max(map(len, made)) == 100
    assert len(set(made)) > 200


def test_mutants_find_a_planted_bug():
    with pytest.raises(AssertionError, match="planted does not bear") as found:
        mutate(PLANTED["planted"])
    assert isinstance(found.value.__cause__, KeyError)


def test_a_check_that_is_left_out_is_found(monkeypatch):
    monkeypatch.setattr(wire, "_bounded", lambda *_: None)
    with pytest.raises(AssertionError, match="records does not bear"):
        mutate(TARGETS["records"])


@pytest.mark.skipif(find_spec("atheris") is None, reason="atheris is not installed")
@pytest.mark.long
@pytest.mark.slow
def test_the_command_finds_a_planted_bug_and_keeps_its_input(tmp_path):
    out = fuzz("planted", "--runs", "400000", "--out", str(tmp_path), cwd=ROOT)
    assert out.returncode == 1, out.stdout + out.stderr
    assert "| planted |" in out.stdout
    assert "FOUND" in out.stdout
    assert "KeyError: 'planted'" in out.stdout
    (kept,) = tmp_path.iterdir()
    assert kept.name.startswith("planted-crash-")
    with pytest.raises(KeyError):
        PLANTED["planted"].run(kept.read_bytes())


@pytest.mark.skipif(find_spec("atheris") is None, reason="atheris is not installed")
@pytest.mark.long
@pytest.mark.slow
def test_the_command_tells_executions_and_edges_of_a_sound_target(tmp_path):
    out = fuzz("trailer", "--runs", "3000", "--out", str(tmp_path), cwd=ROOT)
    assert out.returncode == 0, out.stdout + out.stderr
    row = re.search(r"\| trailer \| ([\d,]+) \| ([\d,]+) \| [\d,]+ \| (\d+) \|  \|", out.stdout)
    assert row is not None, out.stdout
    executions, calls = (int(cell.replace(",", "")) for cell in row.groups()[:2])
    assert executions >= 3000
    assert calls == executions
    assert int(row[3]) > 5
    assert not list(tmp_path.iterdir())


@pytest.mark.skipif(find_spec("atheris") is None, reason="atheris is not installed")
@pytest.mark.long
@pytest.mark.slow
def test_what_several_processes_did_is_told_as_one(monkeypatch, tmp_path):
    monkeypatch.setattr(command, "ROUND", 1_000)
    started = []
    monkeypatch.setattr(command, "_round", lambda *a: started.append(a[2]) or one_round(*a))
    done = command.fuzz("trailer", 0, 2_500, tmp_path)
    assert not done.finding
    assert started[:2] == [1_000, 1_000]
    assert done.calls == done.executions >= 2_500
    assert command.fuzz("no such one", 0, 2_500, tmp_path).finding.startswith("did not run")


def test_an_interruption_leaves_what_was_done(monkeypatch, tmp_path, capsys):
    def one_round(name, *_):
        if "200,000" in capsys.readouterr().err:
            raise KeyboardInterrupt
        return command.Outcome(name, 100_000, 300_000, 2.0, 7)

    monkeypatch.setattr(command, "_round", one_round)
    done = command.fuzz("trailer", 0, 10_000_000, tmp_path)
    assert (done.executions, done.calls, done.edges) == (200_000, 600_000, 7)
    assert done.per_second == 50_000


def test_an_unknown_target_is_named_with_those_that_there_are():
    out = fuzz("recrods", cwd=ROOT)
    assert out.returncode == 2
    assert "recrods" in out.stderr
    assert "records" in out.stderr
