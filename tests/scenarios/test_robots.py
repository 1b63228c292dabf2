"""Robots with fewer axes in the whole loop, in virtual time: they follow, and end safely.

The quadrotor takes off by the hand's lift of 0.4 m and goes sideways by tilting; the ground robot
glides and can't leave the floor.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cache, partial

import numpy as np
import pytest

from hardware.robot_file import COMMANDS, load_robot
from pipeline.config import TeleopConfig
from pipeline.frames import Array
from pipeline.signals import Mode
from server.experiments.forked import forked
from server.simulation.virtual_time import SimulationOptions, VirtualTimeSimulation

pytestmark = pytest.mark.slow
QUADROTOR, GROUND = load_robot("quadrotor"), load_robot("ground")
COPTER = load_robot("copter", takes=COMMANDS)
TAKEN_OFF_S = 7.0
"""The hand has been lifted, and the integral has learnt the weight."""


RAYS_PX = 0.05
"""Noise of LEDs' rays, where no picture is looked at: what becomes of a robot is the same."""


def loop_of(name: str, hand: str, led_noise_px: float | None = None) -> VirtualTimeSimulation:
    robot_file = {"quadrotor": QUADROTOR, "copter": COPTER, "ground": GROUND}[name]
    config = TeleopConfig(gains=robot_file.gains["phone"])
    options = SimulationOptions(hand=hand, seed=5, codec="jpeg", led_noise_px=led_noise_px)
    return VirtualTimeSimulation(robot_file, config, options)


def tilt_deg(loop: VirtualTimeSimulation) -> float:
    return float(np.degrees(np.arccos(min(1.0, loop.follower.plant.R_fb[2, 2]))))


def rms(rows: list[Array]) -> Array:
    values: Array = np.sqrt(np.mean(np.square(rows), axis=0))
    return values


@pytest.mark.parametrize("name", ["quadrotor", "copter"])
@pytest.mark.parametrize(
    ("hand", "bound_mm"), [("moving", (20.0, 20.0, 13.0)), ("demo", (12.0, 12.0, 13.0))]
)
def test_a_quadrotor_takes_off_and_follows_in_x_y_z_and_yaw(
    name: str, hand: str, bound_mm: tuple[float, ...]
) -> None:
    """Told thrusts, or attitude and thrust."""
    loop, tilts = loop_of(name, hand), []
    while loop.t < 22.0 and not loop.trace.left:
        loop.advance()
        tilts.append(tilt_deg(loop))
    trace = loop.trace
    assert trace.left == ""
    assert trace.t[-1] - trace.t[0] > 20.0
    assert trace.body_in_f[-1][2] > 0.25
    assert (1e3 * rms(trace.error_in_f) < bound_mm).all()
    assert np.degrees(rms(trace.turn)[2]) < 0.3
    assert max(tilts) < 8.0  # as much as the hand's accelerations ask for
    assert np.mean(trace.saturated) < 0.01


@pytest.mark.parametrize(("hand", "bound_mm"), [("moving", 9.0), ("demo", 7.0)])
def test_the_ground_robot_follows_in_x_y_and_yaw_and_lets_the_rest_alone(
    hand: str, bound_mm: float
) -> None:
    loop = loop_of("ground", hand)
    while loop.t < 22.0 and not loop.trace.left:
        loop.advance()
        assert loop.follower.plant.stands
    trace = loop.trace
    assert trace.left == ""
    assert trace.t[-1] - trace.t[0] > 20.0
    assert (1e3 * rms(trace.error_in_f)[:2] < bound_mm).all()
    assert np.degrees(rms(trace.turn)[2]) < 0.3
    body, intended = np.array(trace.body_in_f), np.array(trace.intended_in_f)
    assert np.abs(body[:, 2]).max() < 1e-3
    assert np.ptp(intended[:, 2]) > 0.05  # the hand went up and down, and turned ...
    assert tilt_deg(loop) < 0.1
    assert np.mean(trace.thrusts) < 0.4  # ... and no fan worked against it
    assert np.mean(trace.saturated) < 0.01


def lose_the_phone(loop: VirtualTimeSimulation) -> None:
    loop.lost |= {"picture", "motion", "touch"}


def lose_the_link(loop: VirtualTimeSimulation) -> None:
    loop.follower.connected = False


LOSSES: list[Callable[[VirtualTimeSimulation], None]] = [
    lose_the_phone,
    lose_the_link,
    lambda loop: loop.request("disarm"),
    lambda loop: None,  # the button is let go
]
WHICH = ["phone", "link", "disarm", "button"]


@cache
def flying(name: str) -> VirtualTimeSimulation:
    """8 s into a flight."""
    loop = loop_of(name, "moving", RAYS_PX)
    while loop.t < TAKEN_OFF_S + 1.0:
        loop.advance()
        assert not loop.trace.left
    return loop


def after_a_loss(
    loop: VirtualTimeSimulation, lose: Callable[[VirtualTimeSimulation], None], seconds: float
) -> list[Array]:
    """Places of the robot from then on, when it is lost, (n, 3); checked all along."""
    loop._script.operator.leaving = True
    lose(loop)
    places = []
    until = loop.t + seconds
    while loop.t < until:
        mode = loop.advance().failsafe.mode
        places.append(loop.follower.plant.p_bf_in_f)
        assert tilt_deg(loop) < 10.0
    assert mode == Mode.DISARMED
    assert loop.follower.plant.stands
    assert np.abs(loop.follower.plant.v_bf_in_f).max() < 0.01
    assert np.abs(loop.follower.plant.thrusts).max() < 0.05
    return places


def test_a_quadrotor_whose_thrusters_give_more_than_they_are_told_does_not_rise_alone() -> None:
    """What it was found to need in flight counts, not what it weighs by its file."""
    loop = loop_of("quadrotor", "moving", RAYS_PX)
    loop.follower.plant.thruster_health[:] = 1.06
    while loop.t < TAKEN_OFF_S + 1.0:
        loop.advance()
        assert not loop.trace.left
    loop._script.operator.leaving = True
    lose_the_phone(loop)
    began, highest = float(loop.follower.plant.p_bf_in_f[2]), 0.0
    while loop.t < TAKEN_OFF_S + 6.0:
        loop.advance()
        highest = max(highest, float(loop.follower.plant.p_bf_in_f[2]))
    assert highest < began + 0.15


@pytest.mark.parametrize("name", ["quadrotor", "copter"])
@pytest.mark.parametrize("lose", LOSSES, ids=WHICH)
def test_a_quadrotor_that_loses_what_leads_it_lands_upright_nearby(
    lose: Callable[[VirtualTimeSimulation], None], name: str
) -> None:
    places = np.array(forked(partial(after_a_loss, flying(name), lose, 10.0)))
    assert places[0, 2] > 0.3
    assert abs(places[-1, 2]) < 2e-3
    # 3 s of HOLD on the gyroscope alone: a degree of tilt makes a metre
    assert np.linalg.norm(places[-1, :2] - places[0, :2]) < 1.5
    assert places[:, 2].max() < places[0, 2] + 0.15
    sinking = -np.diff(places[:, 2]) / 0.005
    assert sinking.max() < 1.6


@pytest.mark.parametrize("lose", LOSSES, ids=WHICH)
def test_a_ground_robot_that_loses_what_leads_it_stops(
    lose: Callable[[VirtualTimeSimulation], None],
) -> None:
    places = np.array(forked(partial(after_a_loss, flying("ground"), lose, 5.0)))
    assert np.linalg.norm(places[-1] - places[0]) < 0.1


def test_a_quadrotor_whose_button_is_pressed_again_flies_on_from_where_it_is() -> None:
    loop = loop_of("quadrotor", "steady", RAYS_PX)
    while loop.t < TAKEN_OFF_S:
        loop.advance()
    modes = set()
    loop.lost.add("touch")
    while loop.t < TAKEN_OFF_S + 3.0:
        modes.add(loop.advance().failsafe.mode)
        if Mode.HOLD in modes:
            loop.lost.clear()
    assert Mode.RAMP not in modes
    heights = []
    while loop.t < TAKEN_OFF_S + 5.0:
        assert loop.advance().failsafe.mode == Mode.TRACK
        heights.append(loop.follower.plant.p_bf_in_f[2])
    assert np.ptp(heights) < 0.03
