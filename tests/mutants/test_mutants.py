"""The command that asks whether tests notice a change, asked of weak tests and of strong ones."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path

import pytest

from tests.mutants.c_mutants import c_mutants
from tests.mutants.python_mutants import python_mutants

ROOT = Path(__file__).parents[2]
SOURCE = '''\
from enum import Enum


Light = Enum("Light", "RED GREEN")


def light(speed: int) -> Light:
    """For a car at `speed`."""
    if speed < 50:
        return Light.GREEN
    return Light.RED
'''
WEAK = """\
from planted import light


def test_a_car_that_stands_gets_some_light():
    assert light(0)
"""
STRONG = """\
import pytest

from planted import Light, light


@pytest.mark.parametrize("speed", range(-100, 100))
def test_only_the_slow_get_green(speed):
    assert light(speed) is (Light.GREEN if speed < 50 else Light.RED)
"""
C = """\
#include "x.h"
/* a < b */
static int f(int a, int b)
{
    a = 1;
    return a < b ? 0 : 10;
}
"""


def mutants(
    directory: Path, test: str, *arguments: str, name: str = ""
) -> subprocess.CompletedProcess[str]:
    """`name`: of the only test that is asked; all by default."""
    (directory / "planted.py").write_text(SOURCE)
    (directory / "test_planted.py").write_text(test)
    targets = directory / "targets.toml"
    targets.write_text(f'["planted.py"]\ntests = ["test_planted.py{name}"]\n')
    places = ("--root", str(directory), "--targets", str(targets))
    return subprocess.run(
        (sys.executable, "-m", "tests.mutants", *places, *arguments),
        cwd=directory,
        env=os.environ | {"PYTHONPATH": str(ROOT)},
        capture_output=True,
        text=True,
    )


def equivalent(directory: Path, *entries: dict[str, str]) -> Sequence[str]:
    path = directory / "equivalent.toml"
    tables = ("\n".join(f"{k} = {json.dumps(v)}" for k, v in one.items()) for one in entries)
    path.write_text("".join(f"[[mutant]]\n{table}\n" for table in tables))
    return "--equivalent", str(path)


@pytest.mark.slow
def test_a_weak_test_lets_mutants_live_which_are_shown_and_fail_the_command(tmp_path):
    done = mutants(tmp_path, WEAK, *equivalent(tmp_path))
    assert done.returncode == 1, done.stderr
    assert "-    if speed < 50:\n+    if speed >= 50:" in done.stdout
    assert "-        return Light.GREEN\n+        return Light.RED" in done.stdout
    assert (tmp_path / "planted.py").read_text() == SOURCE


@pytest.mark.slow
def test_a_strong_test_kills_them_all(tmp_path):
    done = mutants(tmp_path, STRONG, *equivalent(tmp_path))
    assert done.returncode == 0, done.stderr
    assert "100.0%" in done.stdout
    assert "@@" not in done.stdout


@pytest.mark.long
@pytest.mark.slow
def test_what_is_listed_as_equivalent_is_not_run_and_what_is_listed_must_exist(tmp_path):
    line = {"file": "planted.py", "operator": "comparison", "line": "if speed < 50:"}
    done = mutants(tmp_path, STRONG, *equivalent(tmp_path, line))
    assert done.returncode == 0, done.stderr
    made, listed, run = (int(cell) for cell in done.stdout.splitlines()[-1].split("|")[2:5])
    assert listed == 2
    assert made == listed + run
    done = mutants(tmp_path, STRONG, *equivalent(tmp_path, line | {"line": "if speed < 51:"}))
    assert done.returncode != 0
    assert "no mutant any more" in done.stderr


@pytest.mark.long
@pytest.mark.slow
def test_tests_that_fail_without_a_mutant_are_an_error_and_no_score(tmp_path):
    done = mutants(tmp_path, WEAK.replace("assert light(0)", "assert False"), *equivalent(tmp_path))
    assert done.returncode != 0
    assert "fail without a mutant" in done.stderr


@pytest.mark.long
@pytest.mark.slow
def test_a_mutant_with_which_a_named_tests_module_fails_to_load_is_killed(tmp_path):
    """Only a name that exists with no mutant is no error."""
    loads = STRONG + "\nassert light(0) is Light.GREEN\n"
    name = "::test_only_the_slow_get_green"
    done = mutants(tmp_path, loads, *equivalent(tmp_path), name=name)
    assert (done.returncode, "100.0%" in done.stdout) == (0, True), done.stderr
    done = mutants(tmp_path, loads, *equivalent(tmp_path), name=f"{name}_")
    assert done.returncode != 0
    assert "pytest ended with status 4" in done.stderr


def test_a_mutant_is_known_by_its_change_wherever_it_stands():
    here = {mutant.order for mutant in python_mutants("x.py", SOURCE)}
    below = {mutant.order for mutant in python_mutants("x.py", "\n\n" + SOURCE)}
    assert len(here) > 5
    assert here == below


def test_python_mutants_are_python_and_none_is_the_original():
    for file in ("pipeline/control/failsafe.py", "hardware/link/robot_end.py"):
        source = (ROOT / file).read_text()
        for mutant in python_mutants(file, source):
            assert mutant.mutated != source
            compile(mutant.mutated, file, "exec")


def test_c_is_changed_in_bodies_of_functions_and_never_in_comments():
    becomes = {mutant.becomes for mutant in c_mutants("x.c", C)}
    assert becomes == {
        ";",
        "a = 2;",
        "a = 0;",
        "return a <= b ? 0 : 10;",
        "return a >= b ? 0 : 10;",
        "return a < b ? 1 : 10;",
        "return a < b ? 0 : 11;",
        "return a < b ? 0 : 9;",
    }
