"""How a person leads, flown: scale, locked axes, and letting go to point anew."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from scipy.interpolate import make_interp_spline

from hardware.robot_file import load_robot
from hardware.sim.hand import MovingHand
from hardware.sim.hand_parts import Keyed, MotionComponent
from hardware.sim.plant.obstacle import Obstacle
from hardware.sim.plant.plant import PlantOptions
from pipeline.config import TeleopConfig
from pipeline.control.leading import PLAIN, Leading
from pipeline.control.push import PUSHED_N
from pipeline.frames import Array, log
from pipeline.signals import Mode
from pipeline.teleop import Output
from server.simulation.virtual_time import SimulationOptions, VirtualTimeSimulation
from server.virtual_phone.phone_script import VirtualOperator

pytestmark = pytest.mark.slow
AMES = load_robot("ames")
START_IN_F = np.array([-2.5, 0.0, 0.0])
GO_S = 1.5
"""How long a motion of the hand takes."""
SETTLED_S = 2.5
"""After it the robot is where it was led."""


class Moves:
    """One motion after the other, each from rest to rest, begun when it is asked for."""

    def __init__(self) -> None:
        self._moves: list[tuple[float, MotionComponent]] = []

    def go(self, t: float, row: Array, seconds: float = GO_S) -> None:
        """From `t` [s] on by `row` (6,) [m, rad] more, jerk without jumps."""
        still = [(1, np.zeros(6)), (2, np.zeros(6)), (3, np.zeros(6))]
        ends = np.array([np.zeros(6), row])
        spline = make_interp_spline([0.0, seconds], ends, k=7, bc_type=(still, still))
        self._moves.append((t, Keyed(spline)))

    def at(self, t: float) -> Array:
        """(3, 6): value, rate and acceleration."""
        rows = np.zeros((3, 6))
        for start, move in self._moves:
            rows += move.at(t - start)
        return rows


class Finger(VirtualOperator):
    """A person whose finger is down or not, as the test says."""

    down = False

    def _wants_to_hold(self, t: float) -> bool:
        return self.down


class LedFlight:
    """A flight whose hand and finger the test moves."""

    def __init__(self, leading: Leading, seed: int = 3, obstacle: Obstacle | None = None) -> None:
        self.moves, self.finger = Moves(), Finger()
        hand = MovingHand((self.moves,), START_IN_F, np.zeros(3), 0.0)
        scene = SimulationOptions(seed=seed, led_noise_px=0.02, knows_clock=True)
        plant = PlantOptions(obstacle=obstacle)
        self.sim = VirtualTimeSimulation(AMES, TeleopConfig(), scene, self.finger, hand, plant)
        self.sim.controller.teleop.lead(leading)
        self.until(lambda output: output.failsafe.mode == Mode.ARMED)

    def run(self, seconds: float) -> list[Output]:
        return [self.sim.advance() for _ in range(round(seconds / 0.005))]

    def until(self, done: Callable[[Output], bool]) -> Output:
        for _ in range(2000):
            output = self.sim.advance()
            if done(output):
                return output
        raise AssertionError("it never came to that")

    def press(self, settle_s: float = 1.0) -> None:
        self.finger.down = True
        self.until(lambda output: output.failsafe.mode == Mode.TRACK)
        self.run(settle_s)

    def release(self) -> None:
        self.finger.down = False
        self.until(lambda output: output.failsafe.mode == Mode.HOLD)

    @property
    def body(self) -> tuple[Array, Array]:
        """(R_fb, p_bf_in_f)."""
        return self.sim.truth()[1]

    def led_by(self, *row: float, seconds: float = GO_S) -> tuple[Array, Array]:
        """Move the hand by (x, y, z [m], roll, pitch, yaw [deg]); (turn [deg], way [m]) of the
        robot in f, once it has settled."""
        R_before, p_before = self.body
        wanted = np.array(row)
        wanted[3:] = np.deg2rad(wanted[3:])
        self.moves.go(self.sim.t, wanted, seconds)
        outputs = self.run(seconds + SETTLED_S)
        assert {output.failsafe.mode for output in outputs} == {Mode.TRACK}
        places = []
        for _ in range(100):
            self.sim.advance()
            places.append(self.body[1])
        R_fb = self.body[0]
        return np.rad2deg(log(R_fb @ R_before.T)), np.mean(places, axis=0) - p_before


@pytest.mark.parametrize(("scale", "stay_s"), [(0.25, 0.0), (0.5, 15.0)])
def test_the_robot_goes_its_share_of_the_hands_way_and_keeps_the_place(
    scale: float, stay_s: float
) -> None:
    flight = LedFlight(Leading(scale))
    flight.press()
    turn_deg, way_m = flight.led_by(0.0, 0.10, 0.0, 0.0, 0.0, 0.0)
    assert way_m[1] == pytest.approx(scale * 0.10, abs=0.012)
    assert np.abs(way_m[[0, 2]]).max() < 0.012
    assert np.abs(turn_deg).max() < 1.0
    before = flight.body[1]
    flight.run(stay_s)
    assert np.linalg.norm(flight.body[1] - before) < 0.01
    _, up_m = flight.led_by(0.0, 0.0, 0.05, 0.0, 0.0, 0.0)
    assert up_m[2] == pytest.approx(scale * 0.05, abs=0.012)


def test_with_turns_locked_the_phones_turns_move_and_turn_nothing() -> None:
    flight = LedFlight(Leading(axes="shift"))
    flight.press()
    for row in ((0.0, 0.0, 0.0, 30.0, 0.0, 0.0), (0.0, 0.0, 0.0, 0.0, 0.0, 20.0)):
        turn_deg, way_m = flight.led_by(*row)
        assert np.abs(turn_deg).max() < 1.0
        assert np.linalg.norm(way_m) < 0.03


def test_with_turns_locked_it_follows_the_hand_that_shifts_while_it_turns() -> None:
    flight = LedFlight(Leading(axes="shift"))
    flight.press()
    _, way_m = flight.led_by(0.0, -0.10, 0.0, 0.0, 0.0, 10.0)
    np.testing.assert_allclose(way_m, [0.0, -0.10, 0.0], atol=0.015)


def test_unlocked_the_same_turn_swings_the_robot() -> None:
    flight = LedFlight(PLAIN)
    flight.press()
    _, way_m = flight.led_by(0.0, 0.0, 0.0, 0.0, 0.0, 3.0)
    assert way_m[1] == pytest.approx(2.5 * np.sin(np.deg2rad(3.0)), abs=0.012)


def test_with_places_locked_the_robot_turns_where_it_is() -> None:
    flight = LedFlight(Leading(axes="turn"))
    flight.press()
    angle = np.deg2rad(20.0)
    aside, nearer = -2.5 * np.sin(angle), 2.5 * (1.0 - np.cos(angle))
    turn_deg, way_m = flight.led_by(nearer, aside, 0.0, 0.0, 0.0, 20.0, seconds=6.0)
    assert turn_deg[2] == pytest.approx(20.0, abs=1.5)
    assert np.linalg.norm(way_m) < 0.04


def test_with_the_height_locked_the_robot_goes_sideways_alone() -> None:
    flight = LedFlight(Leading(axes="level"))
    flight.press()
    _, way_m = flight.led_by(0.0, 0.08, 0.15, 0.0, 0.0, 0.0)
    assert way_m[1] == pytest.approx(0.08, abs=0.012)
    assert abs(way_m[2]) < 0.015


def test_what_is_chosen_in_flight_counts_from_the_next_press_on() -> None:
    flight = LedFlight(PLAIN)
    flight.press()
    flight.sim.controller.teleop.lead(Leading(0.25))
    before = flight.run(0.2)[-1]
    assert before.leading == PLAIN
    _, way_m = flight.led_by(0.0, 0.06, 0.0, 0.0, 0.0, 0.0)
    assert way_m[1] == pytest.approx(0.06, abs=0.012)
    flight.release()
    flight.press(0.1)
    assert flight.sim.advance().leading == Leading(0.25)


def assert_a_press_elsewhere_moves_nothing(flight: LedFlight) -> None:
    """Let go, point anew, press again: the robot takes up where it is, thrust without a jump."""
    flight.release()
    flight.moves.go(flight.sim.t, np.array([0.0, -0.08, 0.0, 0.0, 0.0, 0.05]), 0.4)
    flight.run(0.5)
    flight.finger.down = True
    first = flight.until(lambda output: output.failsafe.mode == Mode.TRACK)
    assert first.error is not None
    assert np.linalg.norm(first.error.e_p_in_v) < 1e-9
    place, reference = flight.body[1], first.reference
    for output in flight.run(0.5):
        assert output.reference is not None
        assert reference is not None
        assert np.linalg.norm(output.reference.p_rv_in_v - reference.p_rv_in_v) < 0.005
    assert np.linalg.norm(flight.body[1] - place) < 0.01


def test_a_press_moves_nothing() -> None:
    flight = LedFlight(PLAIN)
    flight.press()
    flight.led_by(0.0, 0.08, 0.0, 0.0, 0.0, 0.0)
    assert_a_press_elsewhere_moves_nothing(flight)


def test_three_presses_that_move_nothing_bring_the_robot_three_times_as_far() -> None:
    flight = LedFlight(Leading(0.5))
    rest = flight.body[1]
    flight.press(0.3)
    for press in range(3):
        _, way_m = flight.led_by(0.0, 0.08, 0.0, 0.0, 0.0, 0.0, seconds=1.0)
        assert way_m[1] == pytest.approx(0.04, abs=0.012)
        if press < 2:
            assert_a_press_elsewhere_moves_nothing(flight)
    assert flight.body[1][1] - rest[1] == pytest.approx(3.0 * 0.04, abs=0.02)


def test_with_turns_locked_a_phone_at_rest_leads_by_no_more_than_its_gyroscopes_drift() -> None:
    flight = LedFlight(Leading(axes="shift"), seed=1002)
    flight.press()
    before = flight.body[1]
    flight.run(15.0)
    drift_m = flight.body[1] - before
    assert np.abs(drift_m[:2]).max() < 15.0 * 0.004
    assert abs(drift_m[2]) < 0.05


@pytest.mark.parametrize("scale", [0.25, 0.5])
def test_who_is_led_by_a_share_against_a_wall_comes_to_rest_there_in_place_of_bouncing(
    scale: float,
) -> None:
    """A touch is no motion, so the law asks for no more; a knock is held after, and says why."""
    flight = LedFlight(Leading(scale), obstacle=Obstacle(gap_m=0.02))
    flight.press()
    plant = flight.sim.follower.plant
    flight.moves.go(flight.sim.t, np.array([0.03 / scale, 0.0, 0.0, 0.0, 0.0, 0.0]))
    flight.until(lambda _: plant.touched.peak_n > 0.0)
    peaks = []
    for _ in range(800):
        output = flight.sim.advance()
        peaks.append(plant.touched.peak_n)
        if max(peaks) > PUSHED_N:
            assert output.failsafe.mode != Mode.TRACK or len(peaks) < 30
            assert output.failsafe.mode != Mode.HOLD or "touches" in output.failsafe.reason
    assert max(peaks) < 8.0
    assert max(peaks[250:]) < 1.0
