"""What a rig needs beside to be the follower of a flight in virtual time."""

from __future__ import annotations

from hardware.follower import BodySample, Follower, RobotCommand


class FollowerFlight:
    """Beside a rig: hands on what its follower does."""

    follower: Follower
    now: float
    dark = -1
    """None of its LEDs."""

    @property
    def thrusters(self) -> int:
        return self.follower.thrusters

    @property
    def t(self) -> float:
        return self.now - 50.0

    @property
    def epoch(self) -> int:
        return self.follower.epoch

    @property
    def dropped(self) -> int:
        return self.follower.dropped

    def receive(self) -> list[BodySample]:
        return self.follower.receive()

    def send(self, command: RobotCommand) -> None:
        self.follower.send(command)
