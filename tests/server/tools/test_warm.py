"""What flies is compiled by one process, once, and the next ones know it."""

import os
import subprocess
import sys

import pytest

from server.tools import warm


def warmed(**settings: str) -> tuple[int, str]:
    """Exit code of `lightleash warm`, and all it said."""
    done = subprocess.run(
        [sys.executable, "-m", "server", "warm"],
        env={**os.environ, **settings},
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        check=False,
    )
    return done.returncode, done.stdout


def test_where_nothing_can_be_kept_it_says_what_to_do_and_compiles_nothing():
    code, said = warmed(NUMBA_CACHE_DIR="/proc/nowhere", XDG_CACHE_HOME="/proc/nowhere")
    assert code == 1
    assert said == warm.NOWHERE + "\n"


def test_what_was_compiled_and_cannot_be_kept_is_told_with_the_reason(monkeypatch, capsys):
    def full():
        raise OSError(28, "No space left on device", "/kernels/warm-0")

    monkeypatch.setattr(warm, "kernel_sources", dict)
    monkeypatch.setattr(warm, "_in_flight", lambda: None)
    monkeypatch.setattr(warm, "raise_niceness", lambda least: None)
    monkeypatch.setattr(warm, "are_kernels_kept", lambda: False)
    monkeypatch.setattr(warm, "note_kernels_kept", full)
    assert warm.main([]) == 1
    told = capsys.readouterr()
    assert "NUMBA_CACHE_DIR" in told.err
    assert "No space left on device: '/kernels/warm-0'" in told.err
    assert told.out == ""


def test_a_second_time_nothing_is_compiled(monkeypatch, capsys):
    compiled = []
    kept = [False, True]
    monkeypatch.setattr(warm, "compile_kernels", lambda: compiled.append(1))
    monkeypatch.setattr(warm, "raise_niceness", lambda least: None)
    monkeypatch.setattr(warm, "are_kernels_kept", lambda: kept.pop(0))
    assert warm.main([]) == warm.main([]) == 0
    assert compiled == [1]
    assert "about a minute" in capsys.readouterr().err


LISTENING = """
from pipeline.jit import numba
compiled = []
numba.core.event.register("numba:compile", type("", (numba.core.event.Listener,), {
    "on_start": lambda self, event: compiled.append((event.data["dispatcher"], event.data["args"])),
    "on_end": lambda self, event: None,
})())
from server.tools import warm
"""
ALL = """
warm.compile_kernels()
names = [(one.py_func.__module__, one.py_func.__qualname__, args) for one, args in compiled]
ours = [name for name in names if not name[0].startswith("numba.")]
print(len(ours), len(set(ours)), len({name[:2] for name in ours}))
"""
IN_FLIGHT = """
warm._in_flight()
print(len(compiled), *compiled)
"""


def printed(program: str, **settings: str) -> str:
    """What a process prints that listens to the compiler."""
    command = [sys.executable, "-c", LISTENING + program]
    environment = {**os.environ, **settings}
    done = subprocess.run(command, env=environment, capture_output=True, text=True, check=True)
    return done.stdout


@pytest.mark.slow
def test_a_warm_process_compiles_nothing(tmp_path):
    assert warmed()[0] == 0
    said = printed(IN_FLIGHT)
    assert said.split()[0] == "0", said


@pytest.mark.long
@pytest.mark.slow
def test_a_clean_start_compiles_each_kernel_once(tmp_path):
    clean = {"NUMBA_CACHE_DIR": str(tmp_path)}
    compilations, signatures, kernels = map(int, printed(ALL, **clean).split())
    print(f"{compilations} compilations of {kernels} kernels")
    assert compilations == signatures
    assert kernels > 150
    assert printed(ALL, **clean).split()[0] == "0"
