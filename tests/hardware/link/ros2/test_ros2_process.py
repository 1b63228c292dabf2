"""A base of ROS 2 in a process of its own: messages are bytes on a wire, some of them lost."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import time

import numpy as np
import pytest

pytest.importorskip("cyclonedds", reason="NO CYCLONE DDS: pip install 'lightleash[ros2]'")

from hardware.follower import FollowerState, TwistCommand
from hardware.link.base_end import HeardOdometry
from hardware.link.registry import connect
from hardware.link.ros2.ports import RosPorts
from tests.hardware.link.ros2.ros2_rig import (
    BELOW,
    LOCALHOST,
    PATIENCE_S,
    TIMELESS,
    patiently,
    ros2_robot,
)

pytestmark = pytest.mark.e2e
LOSSY = (
    "<CycloneDDS><Domain><Internal><Test><XmitLossiness>{}</XmitLossiness></Test></Internal>"
    "</Domain></CycloneDDS>"
)
"""Of a thousand packets that Cyclone DDS would send."""
FORWARD = TwistCommand(np.array([0.25, *5 * (0.0,)]), armed=True)


class Base:
    """The process, which starts after the link to it."""

    def __init__(self, domain, *options):
        words = ["--domain", str(domain), "--below", BELOW, *options]
        module = "tests.hardware.link.ros2.lab_base"
        self.process = subprocess.Popen(
            [sys.executable, "-m", module, *words],
            stdout=subprocess.PIPE,
            env=dict(os.environ),
            text=True,
        )

    def told(self):
        """Each twist (n, 6) that it took."""
        time.sleep(0.5)
        self.process.terminate()
        out, _ = self.process.communicate(timeout=PATIENCE_S)
        return np.array([twist for _, twist in json.loads(out)["taken"]])


@pytest.mark.parametrize("per_mille", [0, 100])
def test_what_is_told_comes_in_order_and_once(monkeypatch, per_mille):
    monkeypatch.setenv("CYCLONEDDS_URI", LOSSY.format(per_mille))
    topics = ros2_robot().link.ros2
    # else a base that is kept waiting would miss some
    ports = RosPorts(topics, LOCALHOST, tells=TIMELESS)
    base = Base(topics.domain)
    for _ in patiently():
        ports.tell(np.array([1e-4, *5 * (0.0,)]))
        moves = [one.twist_in_b[0] for one in ports.heard() if isinstance(one, HeardOdometry)]
        if any(moves):  # so it hears us
            break
    for k in range(1, 301):
        assert ports.tell(np.array([1e-3 * k, *5 * (0.0,)]))
        time.sleep(0.005)
    ports.close()
    forward = base.told()[:, 0]
    forward = forward[forward > 1e-4]
    assert (np.diff(forward) > 0.0).all()
    assert (len(forward) == 300) == (per_mille == 0)
    assert len(forward) > 200


@pytest.mark.parametrize("options", [(), ("--multicast",)])
def test_a_base_that_starts_later_is_found_led_and_told_zero_by_the_last_word(monkeypatch, options):
    monkeypatch.setenv("CYCLONEDDS_URI", LOSSY.format(20))
    robot_file = ros2_robot()
    follower = connect(robot_file, bytes(16), 1)
    base = Base(robot_file.link.ros2.domain, *options)
    states, forward = [FollowerState.REFUSING], 0
    for _ in patiently():
        states += [sample.state for sample in follower.receive()]
        goes = states[-1] in (FollowerState.IDLE, FollowerState.RUNNING)
        forward += goes
        follower.send(FORWARD if goes else TwistCommand.zero())
        if forward > 100 and states[-1] == FollowerState.RUNNING:
            break
    follower.close()
    told = base.told()
    assert told[:, 0].max() == FORWARD.twist_in_b[0]
    assert not told[-1].any()
