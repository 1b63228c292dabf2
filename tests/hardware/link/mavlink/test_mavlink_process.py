"""An autopilot in a process of its own, which comes after the link to it; datagrams are lost."""

from __future__ import annotations

import json
import subprocess
import sys
import time

import numpy as np
import pytest

pytest.importorskip("pymavlink", reason="NO PYMAVLINK: pip install pymavlink")

from hardware.follower import FollowerState, TwistCommand
from hardware.link.registry import connect
from tests.hardware.link.mavlink.mavlink_rig import LOCALHOST, free_port, mavlink_robot

pytestmark = pytest.mark.e2e
FORWARD = TwistCommand(np.array([0.25, *5 * (0.0,)]), armed=True)
PATIENCE_S = 20.0


class Autopilot:
    """The process."""

    def __init__(self, port, loss):
        module = "tests.hardware.link.mavlink.lab_autopilot"
        words = [sys.executable, "-m", module, "--port", str(port), "--loss", str(loss)]
        self.process = subprocess.Popen(words, stdout=subprocess.PIPE, text=True)

    def told(self):
        """Each twist (n, 6) that it took, and how fast it then was (m,)."""
        time.sleep(0.5)
        self.process.terminate()
        out, _ = self.process.communicate(timeout=PATIENCE_S)
        said = json.loads(out)
        return np.array([twist for _, twist in said["taken"]]), [v for _, v in said["moves"]]


@pytest.mark.parametrize("loss", [0.0, 0.02])
def test_one_that_starts_later_is_heard_led_and_told_zero_by_the_last_word(loss):
    port = free_port()
    follower = connect(mavlink_robot().reached(LOCALHOST, port), bytes(16), 1)
    autopilot, state, led = Autopilot(port, loss), FollowerState.REFUSING, 0
    end = time.monotonic() + PATIENCE_S
    while led < 200 and time.monotonic() < end:
        time.sleep(0.005)
        for sample in follower.receive():
            state = sample.state
        goes = state in (FollowerState.IDLE, FollowerState.RUNNING)
        led += goes
        follower.send(FORWARD if goes else TwistCommand.zero())
    follower.close()
    told, moves = autopilot.told()
    assert led == 200
    assert told[:, 0].max() == FORWARD.twist_in_b[0]
    assert not told[-1].any()
    assert max(moves) > 0.2
    assert abs(moves[-1]) < 1e-3
