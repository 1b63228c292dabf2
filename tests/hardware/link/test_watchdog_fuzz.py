"""Anything at all thrown at the watchdog in C, under sanitizers: its laws hold, memory is its own.

`LIGHTLEASH_FUZZ_S` lets it run for so many seconds of CPU time, as `make test-all` does.
"""

import os
import resource
import shutil
import subprocess
from pathlib import Path

import pytest

pytestmark = pytest.mark.slow
SOURCE = Path(__file__).parents[3] / "deploy" / "watchdog"
NAMES = ("fuzz.c", "watchdog.c", "blink.c", "health.c", "tool.c", "attitude.c", "hmac.c")
GCC = ("gcc", "-std=c99", "-g", "-O1", "-Wall", "-Wextra", "-Werror")
SANITIZED = ("-fsanitize=address,undefined", "-fno-sanitize-recover=all")
EXECUTIONS = 50_000
SECONDS = float(os.environ.get("LIGHTLEASH_FUZZ_S", "0"))


@pytest.fixture(scope="module", autouse=True)
def compiler():
    if shutil.which("gcc") is None:
        pytest.skip("NO COMPILER, not tested: gcc is not installed")


@pytest.fixture(scope="module", params=[3, 16], ids="{} thrusters".format)
def fuzz(request, tmp_path_factory):
    path = tmp_path_factory.mktemp("fuzz") / "fuzz"
    sources = [str(SOURCE / name) for name in NAMES]
    words = (*GCC, *SANITIZED, f"-DN={request.param}")
    done = subprocess.run(
        (*words, "-o", str(path), *sources, "-lm"), check=False, capture_output=True, text=True
    )
    if "cannot find" in done.stderr:
        pytest.skip("NO SANITIZERS, not tested: libasan, libubsan are not installed")
    assert done.returncode == 0, done.stderr
    return path


def test_the_entry_for_a_fuzzer_compiles_too():
    words = ("gcc", "-std=c99", "-Wall", "-Wextra", "-Werror", "-DLIBFUZZER", "-fsyntax-only")
    subprocess.run((*words, str(SOURCE / "fuzz.c")), check=True)


def run(fuzz, executions, seed):
    done = subprocess.run(
        (str(fuzz), str(executions), str(seed)), check=False, capture_output=True, text=True
    )
    assert done.returncode == 0, done.stdout + done.stderr


def spent_s():
    usage = resource.getrusage(resource.RUSAGE_CHILDREN)
    return usage.ru_utime + usage.ru_stime


def test_its_laws_hold_in_every_state_whatever_arrives(fuzz):
    seed, begin = 1, spent_s()
    run(fuzz, EXECUTIONS, seed)
    while spent_s() - begin < SECONDS:
        seed += 1
        run(fuzz, 10 * EXECUTIONS, seed)


@pytest.mark.parametrize(
    ("law", "good", "broken"),
    [
        ("wrong MAC", "!ll_hmac_fits(&w->hmac, data, size, data + size)", "false"),
        ("limits", "thrust > w->limits.f_max * ROUNDING", "false"),
        ("finite", "if (!isfinite(c->thrusts[i]))", "if (false)"),
        ("refuses", "memset(w->base, 0, sizeof w->base);", ""),
    ],
)
def test_it_finds_a_watchdog_that_is_broken(fuzz, tmp_path, law, good, broken):
    text = (SOURCE / "watchdog.c").read_text()
    assert good in text
    (tmp_path / "watchdog.c").write_text(text.replace(good, broken))
    others = [str(SOURCE / name) for name in NAMES if name != "watchdog.c"]
    words = ("gcc", "-std=c99", "-O1", f"-I{SOURCE}", "-o", str(tmp_path / "fuzz"))
    subprocess.run((*words, str(tmp_path / "watchdog.c"), *others, "-lm"), check=True)
    with pytest.raises(AssertionError, match="broken:"):
        run(tmp_path / "fuzz", 20 * EXECUTIONS, 1)
