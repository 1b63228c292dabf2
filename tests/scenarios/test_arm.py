"""A SO-101 led by a phone in virtual time: how well, how fast it stands, and what its border is."""

from __future__ import annotations

from functools import cache, partial

import numpy as np
import pytest
from scipy.interpolate import make_interp_spline

from hardware.arm.bounds import MARGIN_RAD
from hardware.robot_file import COMMANDS, load_robot
from hardware.sim.hand import Hand, make_hand
from hardware.sim.plant.arm_plant import ArmPlant
from pipeline.config import PERIOD_S, TeleopConfig
from pipeline.frames import Array, exp
from pipeline.signals import Mode
from server.experiments.forked import forked
from server.simulation.virtual_time import SimulationOptions, VirtualTimeSimulation

pytestmark = pytest.mark.slow
SO101 = load_robot("so101", takes=COMMANDS)
DRIVE, ARM = SO101.robot.twist, SO101.plant.arm
assert DRIVE is not None
assert ARM is not None
SEEDS = (1012, 1013)
"""Kept apart: no number was chosen with them."""
STANDS_M_S = 0.005
FOLLOWS_S = 8.0


class ArmFlight:
    """A flight, and what its arm was told, how it moved and what people were told."""

    def __init__(
        self, latency_s: float, seed: int, hand: Hand | None = None, kind: str = "filming"
    ) -> None:
        scene = SimulationOptions(
            hand=kind,
            seed=seed,
            led_noise_px=0.1,
            gains="phone",
            latency_s=(latency_s, latency_s),
        )
        self.loop = VirtualTimeSimulation(SO101, TeleopConfig(), scene, hand=hand)
        body = self.loop.follower.body
        assert isinstance(body, ArmPlant)
        self.arm = body
        self.told: list[Array] = []
        self.angles: list[Array] = []
        self.speeds: list[float] = []
        self.at_limit: list[bool] = []
        self.modes: list[Mode] = []

    def fly(self, seconds: float) -> ArmFlight:
        until = self.loop.t + seconds - 1e-9
        while self.loop.t < until:
            output = self.loop.advance()
            assert output.twist_in_b is not None
            self.told.append(output.twist_in_b)
            self.angles.append(self.arm.angles)
            self.speeds.append(float(np.linalg.norm(self.arm.twist_in_b[:3])))
            self.at_limit.append(output.at_limit)
            self.modes.append(output.failsafe.mode)
        return self

    def stays_within(self) -> None:
        angles, model = np.array(self.angles), self.arm.arm
        assert (angles > model.low + 0.5 * MARGIN_RAD).all()
        assert (angles < model.high - 0.5 * MARGIN_RAD).all()
        assert np.abs(np.diff(angles, axis=0)).max() < ARM.rate * PERIOD_S
        assert not any(DRIVE.exceeds(twist, 1.000001) for twist in self.told)


@cache
def flown(latency_s: float, seed: int) -> ArmFlight:
    return ArmFlight(latency_s, seed).fly(FOLLOWS_S)


def rms(rows: list[Array]) -> float:
    return float(np.sqrt(np.square(rows).sum(axis=1).mean()))


@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize("latency_s", [0.06, 0.12])
def test_it_follows_a_hand_within_its_limits_and_nobody_is_told_of_its_reach(
    latency_s: float, seed: int
) -> None:
    flight = flown(latency_s, seed)
    trace = flight.loop.trace
    assert trace.left == ""
    assert len(trace.t) > 1000
    assert rms(trace.error_in_f) < 0.010
    assert np.degrees(rms(trace.turn)) < 2.0
    assert max(flight.speeds) > 0.03  # and the hand did move
    assert not any(flight.at_limit)
    flight.stays_within()


def vanish(flight: ArmFlight) -> tuple[float, float]:
    """The phone is gone; after how long it is told zero and stands, for good [s]."""
    flight.loop.lost = {"motion", "picture", "touch"}
    flight.told, flight.speeds = [], []
    flight.fly(1.0)
    told = [k for k, twist in enumerate(flight.told) if twist.any()]
    moves = [k for k, speed in enumerate(flight.speeds) if speed > STANDS_M_S]
    return PERIOD_S * (max(told, default=-1) + 1), PERIOD_S * (max(moves, default=-1) + 1)


@pytest.mark.parametrize("kind", ["filming", "walking"])
def test_it_stands_a_fifth_of_a_second_after_the_phone_has_vanished(kind: str) -> None:
    flight = ArmFlight(0.12, SEEDS[0], kind=kind).fly(6.0)
    for _ in range(6):
        flight.fly(0.115)
        told_s, stands_s = forked(partial(vanish, flight))
        assert told_s <= 0.17
        assert stands_s <= 0.20


class FarHand:
    """The usual one, which goes a way off at 2.5 s within two seconds, stays, and comes back."""

    def __init__(self, way_in_f: tuple[float, float, float], roll: float = 0.0) -> None:
        """`roll` [rad]: meanwhile it turns the phone about its line of sight."""
        self._hand = make_hand("steady", seed=SEEDS[0], start=SO101.start)
        t = np.array([0.0, 2.5, 4.5, 6.5, 8.5, 20.0])
        share = np.array([0.0, 0.0, 1.0, 1.0, 0.0, 0.0])
        smooth = np.linspace(0.0, 20.0, 801)
        window = np.hanning(41) / np.hanning(41).sum()
        gone = np.convolve(np.pad(np.interp(smooth, t, share), 20, mode="edge"), window, "valid")
        self._gone = make_interp_spline(smooth, gone, k=5)
        self._way_in_f, self._roll = np.array(way_in_f), np.array([roll, 0.0, 0.0])

    def _turned(self, t: float) -> Array:
        turned: Array = exp(self._gone(t) * self._roll)
        return turned

    def pose(self, t: float) -> tuple[Array, Array]:
        R_fc, p_cf_in_f = self._hand.pose(t)
        return R_fc @ self._turned(t), p_cf_in_f + self._gone(t) * self._way_in_f

    def omega_in_c(self, t: float) -> Array:
        omega: Array = self._turned(t).T @ self._hand.omega_in_c(t)
        return omega + self._gone(t, 1) * self._roll

    def specific_force_in_c(self, t: float) -> Array:
        beside_in_f = self._gone(t, 2) * self._way_in_f
        force: Array = self._turned(t).T @ self._hand.specific_force_in_c(t)
        return force + self.pose(t)[0].T @ beside_in_f


@pytest.mark.parametrize(
    "way_m", [(0.35, 0.0, 0.0), (-0.30, 0.0, 0.0), (0.0, 0.0, 0.3), (0.0, 0.0, -0.25)]
)
def test_led_beyond_its_reach_it_stops_there_says_so_and_comes_back(
    way_m: tuple[float, float, float],
) -> None:
    flight = ArmFlight(0.09, SEEDS[0], FarHand(way_m)).fly(6.4)
    assert flight.loop.trace.left == ""
    beyond = np.linalg.norm(flight.loop.trace.error_in_f[-1])
    assert beyond > 0.05
    assert all(flight.at_limit[-200:])
    assert max(flight.speeds[-200:]) < 0.1
    assert not any(flight.at_limit[: round(2.6 / PERIOD_S)])
    flight.fly(4.6)
    assert flight.loop.trace.left == ""
    assert rms(flight.loop.trace.error_in_f[-100:]) < 0.010
    assert not any(flight.at_limit[-100:])
    assert Mode.RAMP not in flight.modes
    flight.stays_within()


def test_rolled_as_far_as_a_hand_turns_it_flies_on_and_keeps_its_place() -> None:
    flight = ArmFlight(0.09, SEEDS[0], FarHand((0.0, 0.0, 0.0), 0.8)).fly(11.0)
    trace = flight.loop.trace
    assert trace.left == ""
    assert np.degrees(np.ptp(np.array(flight.angles)[:, 4])) > 38.0
    assert rms(trace.error_in_f) < 0.010
    assert np.degrees(rms(trace.turn)) < 2.0
    assert not any(flight.at_limit)
    flight.stays_within()


def test_rolled_beyond_what_its_joints_can_do_it_keeps_its_place_says_so_and_comes_back() -> None:
    flight = ArmFlight(0.09, SEEDS[0], FarHand((0.0, 0.0, 0.0), 1.5)).fly(11.0)
    trace = flight.loop.trace
    assert trace.left == ""
    assert np.degrees(np.linalg.norm(trace.turn, axis=1)).max() > 10.0
    assert np.linalg.norm(trace.error_in_f, axis=1).max() < 0.030
    assert any(flight.at_limit)
    assert not any(flight.at_limit[-100:])
    assert np.degrees(rms(trace.turn[-100:])) < 2.0
    flight.stays_within()
