"""What every follower of a robot that takes attitude and thrust must do, beside what all must.

A level of 1 is 1 N of each thruster, and a lean that moves nothing that stands; its robot is that
of `hardware/robots/copter.toml` with `ramp_s = 2.0`, or one as heavy that leans no farther.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from hardware.contract.of_all import FollowerContract, Rig, exchange
from hardware.follower import (
    AttitudeCommand,
    FollowerError,
    FollowerState,
    RobotCommand,
    ThrustCommand,
    TwistCommand,
)

LEAN = 0.01
"""[rad]; to the right, nose down."""
TURN = 0.05
"""[rad/s]."""


class AttitudeFollowerContract(FollowerContract):
    """Of a robot that takes attitude and thrust."""

    @classmethod
    def command(cls, rig: Rig, level: float) -> RobotCommand:
        if level == 0.0:
            return AttitudeCommand.zero()
        thrust = level * rig.follower.thrusters
        return AttitudeCommand(np.array([LEAN, LEAN, TURN, thrust]), armed=True)

    @pytest.mark.parametrize(
        "told",
        [
            [0.0, 0.0, 0.0, -0.1],
            [0.0, 0.0, 0.0, 1e3],
            [0.0, 0.0, 0.0, np.nan],
            [0.3, 0.3, 0.0, 4.0],
            [0.0, -0.5, 0.0, 4.0],
            [0.0, 0.0, 4.0, 4.0],
            [0.0, 0.0, -4.0, 4.0],
            [np.inf, 0.0, 0.0, 4.0],
        ],
    )
    def test_refuses_to_send_attitudes_that_none_may_be_told(
        self, rig: Rig, told: list[float]
    ) -> None:
        with pytest.raises(FollowerError):
            rig.follower.send(AttitudeCommand(np.array(told), armed=True))

    def test_refuses_wrong_shapes_and_thrust_without_arming(self, rig: Rig) -> None:
        with pytest.raises(FollowerError, match="shape"):
            rig.follower.send(AttitudeCommand(np.zeros(3), armed=True))
        led = self.command(rig, 1.0)
        with pytest.raises(FollowerError, match="armed"):
            rig.follower.send(replace(led, armed=False))
        with pytest.raises(FollowerError, match="armed"):
            rig.follower.send(replace(led, stop=True))

    def test_refuses_what_another_kind_of_robot_takes(self, rig: Rig) -> None:
        thrusts = np.zeros(rig.follower.thrusters)
        for command in (ThrustCommand(thrusts, armed=False), TwistCommand.zero()):
            with pytest.raises(FollowerError, match="takes nothing else"):
                rig.follower.send(command)

    def test_a_lean_alone_is_taken_and_gives_no_thrust(self, rig: Rig) -> None:
        self.ready(rig)
        leans, samples = AttitudeCommand(np.array([LEAN, LEAN, TURN, 0.0]), armed=True), []
        for _ in range(20):
            samples += exchange(rig.follower, leans)
            rig.advance(0.005)
        assert samples[-1].state == FollowerState.RUNNING
        assert not samples[-1].thrusts.any()
