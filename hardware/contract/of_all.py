"""What every follower must do; those that keep it, and how, stand in `tests/`."""

from __future__ import annotations

from typing import Protocol

import numpy as np
import pytest

from hardware.follower import (
    BodySample,
    Follower,
    FollowerError,
    FollowerState,
    RobotCommand,
    ThrustCommand,
    TwistCommand,
)
from pipeline.frames import Array


class Rig(Protocol):
    """A follower with its robot, and time that passes when told."""

    follower: Follower

    def advance(self, dt: float) -> None:
        """Let both live on for `dt` [s], a multiple of 5 ms; the follower's own clock, too."""

    def cut_link(self) -> None:
        """From now on nothing comes through, either way."""


def exchange(follower: Follower, command: RobotCommand) -> list[BodySample]:
    """Send, then take what has come."""
    follower.send(command)
    return follower.receive()


class FollowerContract:
    """Of a robot that takes thrusts, with at least 2 N each."""

    deaf = FollowerState.RAMP
    """Of a robot that has taken nothing for 0.4 s, after thrust."""

    @pytest.fixture
    def rig(self) -> Rig:
        """A new robot that has heard nothing, and its follower: to be given."""
        raise NotImplementedError

    @classmethod
    def command(cls, rig: Rig, level: float) -> RobotCommand:
        return ThrustCommand(np.full(rig.follower.thrusters, level), armed=level > 0.0)

    @classmethod
    def given(cls, sample: BodySample) -> Array:
        return sample.thrusts

    @classmethod
    def fly(cls, rig: Rig, level: float, duration: float) -> list[BodySample]:
        samples: list[BodySample] = []
        for _ in range(round(duration / 0.005)):
            samples += exchange(rig.follower, cls.command(rig, level))
            rig.advance(0.005)
        return samples

    @staticmethod
    def listen(rig: Rig, duration: float) -> list[BodySample]:
        """Say nothing; take what comes as it comes: a serial line's buffer holds 4 KiB of it."""
        samples: list[BodySample] = []
        for _ in range(round(duration / 0.005)):
            rig.advance(0.005)
            samples += rig.follower.receive()
        return samples

    def ready(self, rig: Rig) -> None:
        samples = self.fly(rig, 0.0, 0.7)
        assert samples[-1].state == FollowerState.IDLE

    def test_is_ready_after_half_a_second_of_zero_and_not_before(self, rig: Rig) -> None:
        early = self.fly(rig, 0.0, 0.4)
        assert {s.state for s in early} == {FollowerState.REFUSING}
        assert self.fly(rig, 0.0, 0.4)[-1].state == FollowerState.IDLE

    def test_refuses_thrust_that_did_not_begin_with_zero(self, rig: Rig) -> None:
        samples = self.fly(rig, 1.0, 1.0)
        assert {s.state for s in samples} == {FollowerState.REFUSING}
        assert max(self.given(s).max() for s in samples) == 0.0

    def test_follows_thrust_and_says_so(self, rig: Rig) -> None:
        self.ready(rig)
        samples = self.fly(rig, 1.0, 0.5)
        assert samples[-1].state == FollowerState.RUNNING
        assert self.given(samples[-1]) == pytest.approx(1.0, abs=1e-3)

    def test_samples_come_in_order_of_the_robots_clock_with_a_round_trip(self, rig: Rig) -> None:
        self.ready(rig)
        samples = self.fly(rig, 0.5, 0.5)
        times = np.array([s.t_us for s in samples])
        assert (np.diff(times) > 0).all()
        assert len({s.boot_id for s in samples}) == 1
        known = [s.round_trip_s for s in samples if s.round_trip_s is not None]
        assert len(known) > len(samples) // 2
        assert min(known) >= 0.0

    def test_stop_is_zero_at_once(self, rig: Rig) -> None:
        self.ready(rig)
        self.fly(rig, 2.0, 0.4)
        rig.follower.stop()
        # silence alone is answered by COAST, RAMP and REFUSING
        assert FollowerState.IDLE in {s.state for s in self.listen(rig, 0.05)}
        samples = self.fly(rig, 0.0, 0.3)
        assert samples[-1].state == FollowerState.IDLE
        assert self.given(samples[-1]).max() < 1e-2

    def test_silence_ends_in_zero_that_only_a_new_handshake_ends(self, rig: Rig) -> None:
        self.ready(rig)
        self.fly(rig, 2.0, 0.2)
        rig.advance(0.450)
        ramp = self.fly(rig, 2.0, 0.3)
        assert ramp[-1].state == FollowerState.RAMP
        assert 1.0 < self.given(ramp[-1]).max() < 2.0
        refused = self.fly(rig, 2.0, 2.5)
        assert refused[-1].state == FollowerState.REFUSING
        assert self.given(refused[-1]).max() < 1e-2
        self.ready(rig)

    def test_a_silence_of_a_tenth_of_a_second_is_coasted_through(self, rig: Rig) -> None:
        self.ready(rig)
        self.fly(rig, 2.0, 0.2)
        rig.advance(0.100)
        samples = self.fly(rig, 2.0, 0.3)
        assert FollowerState.COAST in {s.state for s in samples}
        assert samples[-1].state == FollowerState.RUNNING
        assert min(self.given(s).min() for s in samples) > 1.8

    def test_a_command_made_of_old_samples_is_not_taken(self, rig: Rig) -> None:
        self.ready(rig)
        self.fly(rig, 1.0, 0.2)
        for _ in range(80):
            rig.follower.send(self.command(rig, 1.0))
            rig.advance(0.005)
        rig.follower.receive()  # a line whose buffer is full keeps the oldest
        rig.advance(0.050)  # a rig in real time that is late by 20 ms makes that up here
        assert rig.follower.receive()[-1].state == self.deaf

    def test_a_lost_link_is_no_error_but_silence(self, rig: Rig) -> None:
        self.ready(rig)
        rig.cut_link()
        self.fly(rig, 1.0, 0.1)
        assert self.fly(rig, 1.0, 0.2) == []

    @pytest.mark.parametrize("thrust", [-0.1, np.nan, np.inf, 1e3])
    def test_refuses_to_send_what_no_robot_may_be_told(self, rig: Rig, thrust: float) -> None:
        thrusts = np.zeros(rig.follower.thrusters)
        thrusts[-1] = thrust
        with pytest.raises(FollowerError):
            rig.follower.send(ThrustCommand(thrusts, armed=True))

    def test_refuses_wrong_shapes_and_thrust_without_arming(self, rig: Rig) -> None:
        with pytest.raises(FollowerError, match="shape"):
            rig.follower.send(ThrustCommand(np.zeros(3), armed=True))
        with pytest.raises(FollowerError, match="armed"):
            rig.follower.send(ThrustCommand(np.ones(rig.follower.thrusters), armed=False))

    def test_refuses_what_another_kind_of_robot_takes(self, rig: Rig) -> None:
        with pytest.raises(FollowerError, match="takes nothing else"):
            rig.follower.send(TwistCommand(np.full(6, 0.01), armed=True))

    def test_a_closed_one_sends_nothing_and_closes_again(self, rig: Rig) -> None:
        rig.follower.close()
        rig.follower.close()
        rig.follower.stop()
        with pytest.raises(FollowerError, match="closed"):
            rig.follower.send(self.command(rig, 0.0))
        with pytest.raises(FollowerError, match="closed"):
            rig.follower.receive()
