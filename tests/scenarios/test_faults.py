"""One fault each, in a flight of the whole loop in virtual time: which mode follows, and how soon.

The flights track a steady hand for a second, then something goes wrong. `after(seconds)` gives the
modes that were passed through and the largest thrust commanded at the end.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from hardware.follower import EXPLANATIONS, FollowerState, Refusal
from hardware.link.robot_end import SILENCE
from hardware.robot_file import load_robot
from hardware.sim.virtual_time_follower import whole
from pipeline.config import TeleopConfig
from pipeline.signals import Mode
from server.simulation.virtual_time import SimulationOptions, VirtualTimeSimulation

pytestmark = pytest.mark.slow
ROBOT = load_robot("ames")


RAYS = SimulationOptions(hand="steady", seed=8, led_noise_px=0.05)
"""No picture is looked at: LEDs' rays come with this noise."""
PICTURES = replace(RAYS, codec="jpeg", led_noise_px=None)


def tracking(scene: SimulationOptions = RAYS) -> VirtualTimeSimulation:
    loop = VirtualTimeSimulation(ROBOT, TeleopConfig(), scene)
    while len(loop.trace.t) < 200:
        loop.advance()
        assert loop.t < 8.0, "never tracked"
    return loop


def after(loop: VirtualTimeSimulation, seconds: float) -> tuple[dict[str, float], float]:
    """When each mode was entered [s after now], and the largest thrust at the end [N]."""
    started, entered = loop.t, {}
    while loop.t < started + seconds:
        output = loop.advance()
        entered.setdefault(output.failsafe.mode.name, round(loop.t - started, 3))
    return entered, float(output.thrusts.max())


LOSSES: list[tuple[str, Callable[[VirtualTimeSimulation], None], str, float]] = [
    ("picture", lambda loop: loop.lost.add("picture"), "HOLD", 2.6),
    ("motion", lambda loop: loop.lost.add("motion"), "COAST", 0.17),
    ("touch", lambda loop: loop.lost.add("touch"), "COAST", 0.17),
    ("disarm", lambda loop: loop.request("disarm"), "RAMP", 0.011),
    ("stop", lambda loop: loop.request("stop"), "STOPPED", 0.011),
]


@pytest.mark.parametrize(("what", "happen", "mode", "within"), LOSSES, ids=lambda v: str(v)[:8])
def test_a_loss_leaves_tracking_in_time_and_ends_in_zero_thrust(
    what: str, happen: Callable[[VirtualTimeSimulation], None], mode: str, within: float
) -> None:
    loop = tracking()
    loop._script.operator.leaving = what in ("disarm", "stop")
    happen(loop)
    entered, thrust = after(loop, 8.0 if what == "picture" else 4.5)
    assert entered[mode] <= within
    if mode == "COAST":
        assert entered["RAMP"] <= 1.1
    assert thrust == 0.0
    assert ("STOPPED" if what == "stop" else "DISARMED") in entered
    assert float(np.abs(loop.follower.plant.thrusts).max()) < 0.02


def test_a_lost_link_ramps_down_on_both_sides() -> None:
    """The robot by its own watchdog, control because the robot is silent for longer than a gap."""
    loop = tracking()
    loop.follower.connected = False
    entered, _ = after(loop, 3.5)
    assert entered["COAST"] <= 0.17
    assert entered["RAMP"] <= 1.1
    assert float(np.abs(loop.follower.plant.thrusts).max()) < 0.02
    loop.follower.connected = True
    entered, thrust = after(loop, 0.4)
    assert thrust == 0.0


def test_a_link_lost_for_a_tenth_of_a_second_is_coasted_through() -> None:
    """The robot lets its thrust fade a little and takes the next command: no flight ends."""
    loop = tracking()
    loop.follower.connected = False
    entered, _ = after(loop, 0.1)
    loop.follower.connected = True
    later, thrust = after(loop, 1.0)
    assert entered.keys() | later.keys() <= {"TRACK", "COAST"}
    assert loop.follower.state == FollowerState.RUNNING
    assert thrust > 0.0


def test_a_robot_that_hears_nothing_ends_the_flight_with_its_reason_when_it_ramps() -> None:
    """It coasts before, which is no reason; but control must not seem to go on."""
    loop = tracking()
    loop.follower.to_robot = lambda _data: ()
    loop._script.operator.leaving = True
    entered, _ = after(loop, 0.45)
    loop.follower.to_robot = whole
    begun = SILENCE.back_s - SILENCE.ramps_s
    assert 0.28 + begun <= entered["RAMP"] <= 0.31 + begun
    assert loop.trace.left == EXPLANATIONS[Refusal.SILENT]
    entered, thrust = after(loop, 5.0)
    assert "DISARMED" in entered
    assert thrust == 0.0
    loop._script.operator.leaving = False
    entered, thrust = after(loop, 3.0)
    assert set(entered) == {"DISARMED", "ARMED", "TRACK"}
    assert thrust > 0.0


@pytest.mark.parametrize("lost", ["commands", "samples", "both"])
def test_the_countdown_is_the_robots_own_where_that_ends_first(lost: str) -> None:
    """Its thrust fades 280 ms after its last command, whatever else could wait for longer."""
    loop = tracking()
    if lost != "samples":
        loop.follower.to_robot = lambda _data: ()
    if lost != "commands":
        loop.follower.to_control = lambda _data: ()
    ends, begin = [], loop.t
    while loop.follower.state != FollowerState.RAMP:
        output = loop.advance()
        if output.until_ramp_s is not None:
            ends.append(loop.t + output.until_ramp_s)
    assert loop.t - begin < 0.35
    assert len(ends) > 20
    assert loop.t - 0.05 <= min(ends)  # without samples: its last nonce is good for 40 ms more
    assert max(ends) <= loop.t + 0.011


def test_leds_hidden_for_a_second_are_flown_through() -> None:
    """The IMUs bridge it: still tracking, and hardly farther from the reference."""
    everything = tuple(range(len(ROBOT.robot.leds_in_b)))
    loop = tracking(replace(PICTURES, hidden=((3.5, 4.5, everything),)))
    entered, _ = after(loop, 5.5 - loop.t)
    assert set(entered) == {"TRACK"}
    assert 25 <= loop.trace.leds.count(0) <= 32
    assert np.linalg.norm(np.array(loop.trace.error_in_f), axis=1).max() < 0.04


def test_one_led_is_enough_to_fly_on_for_two_seconds() -> None:
    loop = tracking(replace(PICTURES, hidden=((3.5, 5.5, (0, 1, 3, 4)),)))
    entered, _ = after(loop, 6.0 - loop.t)
    assert set(entered) == {"TRACK"}
    assert 55 <= loop.trace.leds.count(1) <= 62
    assert np.linalg.norm(np.array(loop.trace.error_in_f), axis=1).max() < 0.06


def test_a_released_button_holds_and_a_new_press_goes_on_from_there() -> None:
    loop = tracking()
    loop.lost.add("touch")
    loop._script.operator._held = False
    entered, _ = after(loop, 0.3)
    assert "COAST" in entered  # nobody knows yet
    loop.lost.clear()
    entered, _ = after(loop, 2.5)
    assert "HOLD" in entered
    assert entered["HOLD"] < entered["TRACK"]  # the virtual operator presses anew
    assert "RAMP" not in entered


def test_a_push_is_held_against() -> None:
    """−4 N along y for good, the paper's disturbance: back within 3 cm in 3 s, still tracking."""
    loop = tracking()
    loop.follower.plant.external_wrench_in_f = np.array([0.0, -4.0, 0.0, 0.0, 0.0, 0.0])
    entered, _ = after(loop, 4.0)
    assert set(entered) == {"TRACK"}
    distances = np.linalg.norm(np.array(loop.trace.error_in_f[-100:]), axis=1)
    assert distances.max() < 0.03


def test_the_machine_never_commands_thrust_outside_its_modes() -> None:
    loop = VirtualTimeSimulation(
        ROBOT, TeleopConfig(), SimulationOptions(hand="steady", seed=9, codec="jpeg")
    )
    while loop.t < 3.0:
        output = loop.advance()
        if output.failsafe.mode in (Mode.DISARMED, Mode.ARMED, Mode.STOPPED):
            assert not output.thrusts.any()
        else:
            assert output.thrusts.max() <= ROBOT.robot.f_max
