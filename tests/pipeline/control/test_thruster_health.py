"""Thruster health: who fails is named, alone and soon; bodies, pushes and silence name nobody."""

from __future__ import annotations

from collections import deque
from dataclasses import replace

import numpy as np
import pytest

from hardware.robot_file import load_robot
from pipeline.config import PERIOD_S, TeleopConfig
from pipeline.control.actuation import Actuation
from pipeline.control.allocation import Allocation
from pipeline.control.thruster_health import ThrusterHealth
from pipeline.frames import GRAVITY, Array
from pipeline.robot import Robot
from pipeline.signals import BodyImu

AMES, QUADROTOR = load_robot("ames").robot, load_robot("quadrotor").robot
EVERY = np.ones(8)
STILL = np.zeros(3)
FAILS_S = 1.2
SOON_S = 0.3
IDLE_N = 1.2
"""Beside what is wanted, the same for all eight: on the AMES that cancels."""


class Body:
    """A body that its controller damps; f and ω without noise, commands with lag and delay."""

    def __init__(self, robot: Robot, seed: int = 0) -> None:
        self.robot, self.gains = robot, np.ones(robot.A.shape[1])
        self.health = ThrusterHealth(AMES)
        self.t, self.omega = 0.0, np.zeros(3)
        self.push_in_b = np.zeros(6)
        self.named_s: list[float] = []
        self._allocation = Allocation(AMES)
        self._phases = np.random.default_rng(seed).uniform(0.0, 2.0 * np.pi, 3)
        self._thrusts = self._commanded = np.zeros(8)
        waits = round(robot.thrust_delay_s / PERIOD_S)
        self._on_their_way = deque(waits * [np.zeros(8)])

    def fly(self, until_s: float) -> None:
        robot = self.robot
        share = 1.0 - np.exp(-PERIOD_S / robot.thrust_lag_s)
        while self.t < until_s:
            self.t += PERIOD_S
            self._on_their_way.append(self._commanded)
            self._thrusts = self._thrusts + share * (
                self._on_their_way.popleft() * self.gains - self._thrusts
            )
            wrench = robot.A @ self._thrusts + self.push_in_b
            self.omega = self.omega + PERIOD_S * wrench[3:] / robot.inertia
            f = wrench[:3] / robot.mass + np.array([0.0, 0.0, GRAVITY])
            if self.health.follow(self._commanded, BodyImu(self.t, self.omega, f), PERIOD_S):
                self.named_s.append(self.t)
            self._commanded = self._control()

    def _control(self) -> Array:
        force = 0.6 * np.sin(3.0 * self.t + self._phases)
        wrench = np.concatenate((force, -0.5 * self.omega))
        return np.minimum(self._allocation.thrusts(wrench) + IDLE_N, AMES.f_max)


@pytest.mark.parametrize("gives", [0.0, 0.5])
@pytest.mark.parametrize("thruster", range(8))
def test_who_fails_is_named_soon_and_alone(thruster: int, gives: float) -> None:
    body = Body(AMES, thruster)
    body.fly(FAILS_S)
    body.gains[thruster] = gives
    body.fly(FAILS_S + 1.0)
    assert FAILS_S < body.named_s[0] <= FAILS_S + SOON_S
    found = body.health.gains
    assert found[thruster] == pytest.approx(gives, abs=0.15)
    assert (np.delete(found, thruster) == 1.0).all()
    (words,) = body.health.words
    assert words.startswith(f"Thruster {thruster + 1} gives ")
    assert ("no thrust" in words) == (gives == 0.0)


@pytest.mark.parametrize("seed", range(6))
def test_a_body_that_is_not_as_told_names_nobody(seed: int) -> None:
    rng = np.random.default_rng(seed)
    other = replace(
        AMES,
        mass=AMES.mass * rng.uniform(0.7, 1.3),
        inertia=AMES.inertia * rng.uniform(0.7, 1.3, 3),
        thrust_lag_s=rng.uniform(0.015, 0.045),
    )
    body = Body(other, seed)
    body.gains = rng.uniform(0.85, 1.15, 8)
    body.fly(4.0)
    assert not body.named_s


@pytest.mark.parametrize("axis", range(6))
@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_a_push_that_is_no_thrusters_names_nobody(axis: int, sign: float) -> None:
    body = Body(AMES)
    body.fly(FAILS_S)
    body.push_in_b[axis] = sign * (4.0 if axis < 3 else 0.6)
    body.fly(FAILS_S + 0.5)
    body.push_in_b[:] = 0.0
    body.fly(FAILS_S + 1.5)
    assert not body.named_s


def test_what_was_felt_before_a_silence_does_not_count() -> None:
    body = Body(AMES)
    body.fly(FAILS_S)
    body.gains[2] = 0.0
    for _ in range(100):
        body.fly(body.t + 0.01)
        body.health.start()
    assert not body.named_s


def test_a_reset_forgets_who_failed() -> None:
    body = Body(AMES)
    body.fly(FAILS_S)
    body.gains[5] = 0.0
    body.fly(FAILS_S + 0.5)
    assert len(body.health.words) == 1
    body.health.reset()
    assert body.health.words == ()
    assert (body.health.gains == 1.0).all()


def test_a_weakened_robot_is_told_more_and_gives_what_is_wanted() -> None:
    actuation, gains = Actuation(AMES, TeleopConfig()), EVERY.copy()
    gains[3] = 0.6
    actuation.weaken(gains)
    wanted = np.array([1.0, 0.5, -0.5, 0.1, -0.1, 0.1])
    given = actuation.give(wanted, np.eye(3), STILL, STILL, 0.005)
    np.testing.assert_allclose(AMES.A @ (gains * given.thrusts), wanted, atol=1e-4)
    assert not given.saturated


def test_without_a_thruster_torques_are_given_before_forces() -> None:
    actuation = Actuation(AMES, TeleopConfig())
    actuation.weaken(np.array([0.0, *EVERY[1:]]))
    for axis in range(3, 6):
        for sign in (1.0, -1.0):
            wanted = np.zeros(6)
            wanted[axis] = 0.3 * sign
            missing = actuation.give(wanted, np.eye(3), STILL, STILL, 0.005).missing_in_b
            assert np.abs(missing[3:]).max() < 0.03


@pytest.mark.parametrize(
    ("gives", "hovers"), [(1.0, True), (0.8, True), (0.1, False), (0.0, False)]
)
def test_who_flies_free_hovers_with_a_weak_thruster_and_not_without(
    gives: float, hovers: bool
) -> None:
    actuation = Actuation(QUADROTOR, TeleopConfig())
    actuation.weaken(np.array([1.0, gives, 1.0, 1.0]))
    assert actuation.can_hover == hovers
