"""A process kept alive: back-off, patience, and an end with its parent."""

from __future__ import annotations

import errno
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from server.common.child import BACKOFF_S, STEADY_S, Child, die_with

ROOT = Path(__file__).resolve().parents[3]
NAME = "lightleash_test_program"
SLEEPER = "import time; time.sleep(60)"
STUBBORN = "import signal, time; signal.signal(signal.SIGTERM, signal.SIG_IGN); time.sleep(60)"
WRITER = """
import errno
import os
for descriptor in ({given}, {kept}):
    try:
        os.write(descriptor, os.environ["WORD"].encode())
    except OSError:
        pass
"""
PARENT = f"""
import sys, time
sys.platform = sys.argv[1]
from server.common.child import Child
child = Child("c", ["{NAME}"])
child.revive(0.0)
print(child.process.pid, flush=True)
time.sleep(60)
"""


@pytest.fixture
def program(tmp_path, monkeypatch):
    """Gives arguments that make `python -m` run a text."""
    monkeypatch.setenv("PYTHONPATH", f"{tmp_path}:{ROOT}")

    def arguments(text):
        (tmp_path / f"{NAME}.py").write_text(text)
        return [NAME]

    return arguments


def wait_for(condition):
    end = time.monotonic() + 10.0
    while not condition():
        assert time.monotonic() < end, "it never came"
        time.sleep(0.005)


def die(child, now):
    """Start it, wait for its death, and hear what is said of it."""
    assert child.revive(now) == ""
    wait_for(lambda: not child.alive)
    return child.revive(now)


def test_what_dies_at_once_is_started_with_growing_patience(program):
    child, now = Child("c", program("raise SystemExit(3)")), 100.0
    for wait in (*BACKOFF_S, BACKOFF_S[-1]):
        said = die(child, now)
        assert said == f"The c process ended (exit code 3); starting it again in {wait:g} s."
        dead = child.process
        assert child.revive(now + 0.99 * wait) == ""
        assert child.process is dead
        now += wait
    assert child.deaths == len(BACKOFF_S) + 1


def test_what_can_not_be_started_is_tried_again_with_the_same_patience(program, monkeypatch):
    def no_room(*_args, **_options):
        raise BlockingIOError(errno.EAGAIN, "Resource temporarily unavailable")

    child = Child("c", program(SLEEPER))
    with monkeypatch.context() as short:
        short.setattr(subprocess, "Popen", no_room)
        said = child.revive(100.0)
        assert "Resource temporarily unavailable" in said
        assert said.endswith(f"trying again in {BACKOFF_S[0]:g} s.")
        assert child.revive(100.0 + 0.99 * BACKOFF_S[0]) == ""
    assert child.deaths == 1
    assert child.revive(100.0 + BACKOFF_S[0]) == ""
    assert child.alive
    child.stop()


def test_what_has_lived_long_is_started_soon(program):
    child = Child("c", program(SLEEPER), deaths=4)
    child.revive(0.0)
    os.kill(child.process.pid, signal.SIGKILL)
    wait_for(lambda: not child.alive)
    assert "SIGKILL" in child.revive(STEADY_S + 1.0)
    assert child.deaths == 1


def test_what_lives_is_left_alone(program):
    child = Child("c", program(SLEEPER))
    child.revive(0.0)
    process = child.process
    assert child.revive(1e6) == ""
    assert child.process is process
    child.stop()


def test_it_is_asked_to_end(program):
    child = Child("c", program(SLEEPER))
    child.revive(0.0)
    child.stop()
    assert child.process.returncode == -signal.SIGTERM


def test_what_does_not_end_is_made_to(program, monkeypatch):
    monkeypatch.setattr("server.common.child.GRACE_S", 0.05)
    child = Child("c", program(STUBBORN))
    child.revive(0.0)
    wait_for(lambda: ignores_term(child.process.pid))
    child.stop()
    assert child.process.returncode == -signal.SIGKILL


def test_what_never_started_and_what_has_ended_can_be_stopped(program):
    Child("c", program(SLEEPER)).stop()
    child = Child("c", program("pass"))
    die(child, 0.0)
    child.stop()


@pytest.mark.parametrize("platform", ["linux", "darwin"])
def test_it_ends_with_its_parent_however_that_ends_and_whatever_the_kernel_does(program, platform):
    program(SLEEPER)
    command = [sys.executable, "-c", PARENT, platform]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as parent:
        stat = Path(f"/proc/{int(parent.stdout.readline())}/stat")
        assert stat.exists()
        parent.kill()
    wait_for(lambda: not stat.exists() or stat.read_text().split()[2] == "Z")


def test_where_the_kernel_ends_no_orphans_a_process_watches_its_parent_and_is_what_it_would_be(
    program, monkeypatch, capfd
):
    def no_prctl(name):
        raise AssertionError("prctl is of Linux alone")

    monkeypatch.setattr("sys.platform", "darwin")
    monkeypatch.setattr("ctypes.CDLL", no_prctl)
    text = "import sys; print(__name__, sys.argv[1:], file=sys.stderr); raise SystemExit(7)"
    said = die(Child("c", [*program(text), "--word", "x"]), 0.0)
    assert "exit code 7" in said
    assert capfd.readouterr().err == "__main__ ['--word', 'x']\n"
    die_with(os.getppid())


def test_it_inherits_the_files_and_words_it_is_given_and_no_other_files(program):
    given, kept = os.pipe(), os.pipe()
    text = WRITER.format(given=given[1], kept=kept[1])
    child = Child("c", program(text), {"WORD": "hello"}, (given[1],))
    die(child, 0.0)
    os.set_blocking(kept[0], False)
    assert os.read(given[0], 9) == b"hello"
    with pytest.raises(BlockingIOError):
        os.read(kept[0], 9)
    for descriptor in (*given, *kept):
        os.close(descriptor)


def ignores_term(pid):
    lines = Path(f"/proc/{pid}/status").read_text().splitlines()
    mask = next(line.split()[1] for line in lines if line.startswith("SigIgn"))
    return int(mask, 16) >> (signal.SIGTERM - 1) & 1


def oom_score(pid):
    return int(Path(f"/proc/{pid}/oom_score_adj").read_text())


@pytest.mark.skipif(not Path("/proc/self/oom_score_adj").exists(), reason="NO LINUX, not tested")
def test_when_memory_runs_out_the_server_goes_before_what_flies(program):
    flies = Child("flies", program(SLEEPER), oom_score=-900)
    serves = Child("serves", program(SLEEPER), oom_score=300)
    own = oom_score("self")
    try:
        for child in (flies, serves):
            child.revive(0.0)
        wait_for(lambda: oom_score(serves.process.pid) == 300)
        assert oom_score(flies.process.pid) in (-900, own)  # without the right to it: as it was
        assert oom_score(flies.process.pid) < oom_score(serves.process.pid)
    finally:
        for child in (flies, serves):
            child.stop()


def asked(*lines):
    """What a process of its own prints, which may ask for what this one must not keep."""
    command = [sys.executable, "-c", "\n".join(("import os", *lines))]
    return subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False).stdout


RR_1 = "os.sched_setscheduler(0, os.SCHED_RR, os.sched_param(1))"
CLASS = "print(os.sched_getscheduler(0))"
NICENESS = "print(os.getpriority(os.PRIO_PROCESS, 0))"


def test_what_hears_the_phone_runs_before_others_where_that_is_permitted(program):
    child = Child("listens", program(SLEEPER), is_prompt=True)
    policy = int(asked(RR_1, CLASS) or os.SCHED_OTHER)
    niceness = int(
        asked("os.setpriority(os.PRIO_PROCESS, 0, -10)", NICENESS)
        or os.getpriority(os.PRIO_PROCESS, 0)
    )
    group = Path(f"/proc/{os.getpid()}/autogroup")
    try:
        child.revive(0.0)
        pid = child.process.pid
        wait_for(lambda: os.getpriority(os.PRIO_PROCESS, pid) == niceness)
        wait_for(lambda: os.sched_getscheduler(pid) == policy)
        assert os.sched_getparam(pid).sched_priority == (1 if policy == os.SCHED_RR else 0)
        if group.exists() and "nice" in group.read_text():
            words = Path(f"/proc/{pid}/autogroup")
            wait_for(lambda: int(words.read_text().split()[-1]) == niceness)
    finally:
        child.stop()


@pytest.mark.parametrize("by", ["raise_niceness(0)", "set_niceness(-10)"])
def test_no_child_keeps_real_time_that_it_inherited(by):
    """Whatever its niceness: a bomb that a decoder works on is not to go before others."""
    ask = f"from server.common.child import {by.partition('(')[0]}"
    inherited = ["import contextlib", "with contextlib.suppress(OSError):", f"    {RR_1}"]
    assert int(asked(*inherited, ask, by, CLASS)) == os.SCHED_OTHER


@pytest.mark.parametrize(
    "start",
    [
        ("from server.media.decoding import _Running", "pid = _Running(1.0).process.pid"),
        (
            "from server.web.app import VirtualPhoneProcess",
            "phone = VirtualPhoneProcess()",
            "phone.start()",
            "pid = phone._process.pid",
        ),
    ],
    ids=["decoder", "virtual phone"],
)
def test_no_child_loads_its_modules_in_real_time(start):
    """A decoder that is started anew in flight would take whole turns from who hears the phone."""
    inherited = ["import contextlib", "with contextlib.suppress(OSError):", f"    {RR_1}"]
    told = asked(
        "import signal",
        *start[:1],
        *inherited,
        *start[1:],
        "print(os.sched_getscheduler(pid))",
        "os.kill(pid, signal.SIGKILL)",
    )
    assert int(told) == os.SCHED_OTHER


@pytest.mark.parametrize("inherited", [-10, 0, 15])
def test_what_only_computes_runs_behind_others_whatever_it_inherited(inherited):
    lines = [
        "import contextlib",
        "from server.common.child import raise_niceness",
        "with contextlib.suppress(PermissionError):",
        f"    os.setpriority(os.PRIO_PROCESS, 0, {inherited})",
        NICENESS,
        "raise_niceness(10)",
        NICENESS,
    ]
    before, after = map(int, asked(*lines).split())
    assert after == max(10, before)
    assert before == inherited or os.geteuid() != 0
