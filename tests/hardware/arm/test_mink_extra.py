"""Without mink an arm is refused, before it is started, by the name of the extra; others go."""

from __future__ import annotations

import os
import subprocess
import sys

import pytest

from hardware.link.link_key import KEY_VARIABLE

WITHOUT = "import sys; sys.modules['mink'] = None\n"


def ran(code: str) -> subprocess.CompletedProcess[str]:
    words, key = [sys.executable, "-c", WITHOUT + code], {KEY_VARIABLE: bytes(16).hex()}
    return subprocess.run(words, capture_output=True, text=True, check=False, env=os.environ | key)


@pytest.mark.slow
def test_without_mink_an_arm_is_refused_by_the_name_of_its_extra() -> None:
    code = "from hardware.sim.robot import main; sys.exit(main(['--robot', 'so101']))"
    done = ran(code)
    assert done.returncode == 2
    assert done.stderr.startswith("simulated robot: arm: mink is missing: `make arm`")
    assert done.stderr.count("\n") == 1


@pytest.mark.slow
def test_without_mink_an_arm_is_not_even_started() -> None:
    code = "from server.cli import main; sys.exit(main(['serve', '--robot', 'so101']))"
    done = ran(code)
    assert done.returncode == 2
    assert done.stderr == (
        "lightleash serve: so101: arm: mink is missing: `make arm`, or pip install "
        "'lightleash[arm]'; docs/arm.md\n"
    )


@pytest.mark.slow
def test_without_mink_all_others_are_as_they_are() -> None:
    assert (
        ran("import hardware.sim.robot, server.tools.robot_check, hardware.arm.arm_model").stderr
        == ""
    )
