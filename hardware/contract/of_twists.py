"""What every follower of a robot that takes a twist must do, beside what all must.

A level of 1 is 0.1 m/s and 0.1 rad/s along and about x; its robot is that of
`hardware/robots/twister.toml`, or as quick. One that can't be told to turn about x says by `leads`
what it is told instead.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from hardware.contract.of_all import FollowerContract, Rig
from hardware.follower import (
    BodySample,
    FollowerError,
    FollowerState,
    RobotCommand,
    ThrustCommand,
    TwistCommand,
)
from pipeline.frames import Array

LEVEL = 0.1
"""[m/s, rad/s]."""
STILL = 1e-6
"""Along and about what it isn't led: by float32 [m/s, rad/s]."""
SILENT_S = 0.17
"""After the last command the robot is told to stand still."""
SETTLE_S = 0.15
"""Of its own delay and lag, until it does."""


class TwistFollowerContract(FollowerContract):
    """Of a robot that takes a twist."""

    deaf = FollowerState.REFUSING
    leads = (0, 3)
    """Of its twist (6,): one of its velocity, one of its rates."""

    @classmethod
    def command(cls, rig: Rig, level: float) -> RobotCommand:  # noqa: ARG003 (as of thrusts)
        twist_in_b = np.zeros(6)
        twist_in_b[list(cls.leads)] = LEVEL * level
        return TwistCommand(twist_in_b, armed=level > 0.0)

    @classmethod
    def given(cls, sample: BodySample) -> Array:
        assert sample.twist_in_b is not None
        assert sample.thrusts.shape == (0,)
        others = np.delete(sample.twist_in_b, cls.leads)
        assert others == pytest.approx(0.0, abs=STILL)
        return sample.twist_in_b[list(cls.leads)] / LEVEL

    def test_silence_ends_in_zero_that_only_a_new_handshake_ends(self, rig: Rig) -> None:
        self.ready(rig)
        self.fly(rig, 4.0, 0.5)
        rig.follower.receive()
        silent = self.listen(rig, SILENT_S + SETTLE_S)
        assert self.given(silent[8]).min() > 3.5
        assert self.given(silent[-1]).max() < 0.2
        rig.advance(0.2)
        assert rig.follower.receive()[-1].state == FollowerState.REFUSING
        assert self.given(self.fly(rig, 2.0, 0.5)[-1]).max() < 1e-6
        self.ready(rig)

    def test_a_silence_of_a_tenth_of_a_second_is_coasted_through(self, rig: Rig) -> None:
        self.ready(rig)
        self.fly(rig, 2.0, 0.3)
        rig.advance(0.100)
        samples = self.fly(rig, 2.0, 0.4)
        assert FollowerState.COAST in {s.state for s in samples}
        assert samples[-1].state == FollowerState.RUNNING
        assert self.given(samples[-1]) == pytest.approx(2.0, abs=0.01)

    def test_a_jump_is_followed_within_its_accelerations(self, rig: Rig) -> None:
        self.ready(rig)
        rig.follower.send(self.command(rig, 4.0))
        rig.advance(0.005)
        speeds = 0.1 * np.array([self.given(s)[0] for s in self.fly(rig, 4.0, 0.5)])
        assert np.diff(speeds).max() < 5.0 * 0.005 * 1.01
        assert speeds[-1] == pytest.approx(0.4, abs=1e-3)

    @pytest.mark.parametrize("thrust", [-6.0, np.nan, np.inf, 1e3])
    def test_refuses_to_send_what_no_robot_may_be_told(self, rig: Rig, thrust: float) -> None:
        with pytest.raises(FollowerError):
            rig.follower.send(TwistCommand(np.full(6, 0.1 * thrust), armed=True))

    def test_refuses_wrong_shapes_and_thrust_without_arming(self, rig: Rig) -> None:
        with pytest.raises(FollowerError, match="shape"):
            rig.follower.send(TwistCommand(np.zeros(3), armed=True))
        with pytest.raises(FollowerError, match="armed"):
            rig.follower.send(replace(self.command(rig, 1.0), armed=False))
        with pytest.raises(FollowerError, match="armed"):
            rig.follower.send(replace(self.command(rig, 1.0), stop=True))

    def test_refuses_what_another_kind_of_robot_takes(self, rig: Rig) -> None:
        with pytest.raises(FollowerError, match="takes nothing else"):
            rig.follower.send(ThrustCommand(np.zeros(8), armed=False))
