"""Without mink an arm's simulated robot ends with a line that names the extra; others don't ask."""

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
def test_without_mink_all_others_are_as_they_are() -> None:
    assert (
        ran("import hardware.sim.robot, server.tools.robot_check, hardware.arm.arm_model").stderr
        == ""
    )
