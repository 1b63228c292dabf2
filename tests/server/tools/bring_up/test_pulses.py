"""What a robot is told while it is brought up, and what ends that: in virtual time, by the link."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from hardware.follower import FollowerState
from hardware.robot_file import BatteryParameters, load_robot
from hardware.sim.battery import DrainingBattery
from hardware.sim.virtual_time_follower import VirtualTimeFollower
from server.control.robot_clock import RobotLink
from server.control.robot_health import PRESSED
from server.tools.bring_up import session
from server.tools.bring_up.pulses import BringUpError, PulseProgramme, level_of

AMES = load_robot("ames")
pytestmark = pytest.mark.slow


class Hanging:
    """A simulated robot, its programme, and what it was told and did."""

    def __init__(self, robot_file=AMES, battery=None, limits=None):
        self.follower = VirtualTimeFollower(robot_file, battery=battery)
        self.link = RobotLink(self.follower, battery=limits)
        self.programme = PulseProgramme(robot_file)
        self.states, self.gives, self.happens = [], [], {}
        self.asked = ""

    def run(self, seconds=60.0):
        def wait():
            self.follower.advance()
            t = self.follower.t
            assert t < seconds
            for due in [due for due in self.happens if due <= t]:
                self.happens.pop(due)(self)
            self.gives.append((t, self.follower.plant.thrusts, self.follower.state))
            return t

        def keep(status, _):
            self.states.append(status)

        said = []
        session.run(
            self.programme, self.follower, self.link, wait, keep, lambda: self.asked, said.append
        )
        return said

    def zero_after(self, t):
        """Seconds from `t` until thrusts are told to be zero for good [s]."""
        rows = [row for state in self.states for row in state.commands]
        return max((row[0] for row in rows if any(row[1:])), default=t) - t


@pytest.fixture(scope="module")
def whole():
    rig = Hanging()
    said = rig.run()
    return rig, said


def test_each_thruster_has_its_turn_alone_and_none_gives_more_than_a_tenth(whole):
    rig, said = whole
    rows = np.array([row[1:] for state in rig.states for row in state.commands])
    assert rig.programme.is_done
    assert rig.programme.stopped == ""
    assert ((rows > 0.0).sum(axis=1) <= 1).all()
    assert rows.max() <= 0.1 * AMES.robot.f_max
    assert (rows > 0.0).any(axis=0).all()
    assert sum("thruster" in line for line in said) == 8
    assert not rows[-10:].any()


def test_what_was_told_and_felt_is_kept_whole_and_is_no_flight(whole):
    rig, _ = whole
    rows = [row for state in rig.states for row in state.commands]
    samples = [row for state in rig.states for row in state.body_samples]
    np.testing.assert_allclose(np.diff([row[0] for row in rows]), 0.005, atol=1e-6)
    np.testing.assert_allclose(np.diff([row[0] for row in samples]), 0.005, atol=1e-6)
    assert {state.mode for state in rig.states} == {0, 1}  # DISARMED, ARMED


def test_the_next_thruster_brakes_the_turn_of_the_last():
    """Nothing else brings a turn about the vertical to rest."""
    rig = Hanging()
    fastest = 0.0

    def look(_):
        nonlocal fastest
        fastest = max(fastest, abs(float(rig.follower.plant.omega_bf_in_b[2])))
        rig.happens[rig.follower.t + 0.1] = look

    rig.happens[0.1] = look
    rig.run()
    assert fastest < 1.9


@pytest.mark.parametrize(
    ("happens", "why"),
    [
        (lambda rig: rig.follower.press_e_stop(pressed=True), "emergency stop"),
        (lambda rig: setattr(rig, "asked", "Somebody pressed Ctrl-C."), "Ctrl-C"),
        (lambda rig: setattr(rig.follower, "connected", False), "silent"),
        (lambda rig: rig.follower.restart(), "just started"),
        (lambda rig: rig.follower.plant.push(np.array((0, 0, 0, 0, 0, 2.0)), 1.0), "turns by"),
        (lambda rig: rig.follower.plant.push(np.array((60.0, 0, 0, 0, 0, 0)), 1.0), "feels"),
    ],
)
def test_whatever_is_not_as_it_should_be_ends_it_with_zero_at_once(happens, why):
    rig = Hanging()
    rig.happens[6.0] = happens
    rig.run()
    assert why in rig.programme.stopped
    assert not rig.programme.is_done
    pushed = why in ("turns by", "feels")
    assert rig.zero_after(6.0) <= (1.0 if pushed else 0.1)
    assert rig.states[-1].mode == 5  # STOPPED
    assert why in rig.states[-1].reason


def test_after_a_gap_it_begins_anew_from_rest_and_not_for_ever():
    rig = Hanging()
    for t in (8.0, 8.2, 60.0, 60.5):  # it swings on for some time
        rig.happens[t] = lambda rig: setattr(rig.follower, "connected", not rig.follower.connected)
    said = rig.run(240.0)
    assert rig.programme.is_done
    assert sum("anew" in line for line in said) == 2
    assert sum("(1 of 8)" in line for line in said) == 3
    commands = [row for state in rig.states for row in state.commands if any(row[1:])]
    assert len({round(row[0]) for row in commands}) > 30

    def cut(rig):
        rig.follower.connected = not rig.follower.connected
        rig.happens[rig.follower.t + (4.5 if rig.follower.connected else 0.2)] = cut

    never = Hanging()
    never.happens[4.0] = cut
    never.run(60.0)
    assert "It began anew 3 times" in never.programme.stopped


def test_stopped_by_the_wire_thrust_is_zero_within_a_tick():
    rig = Hanging()
    rig.happens[6.0] = lambda rig: rig.follower.press_e_stop(pressed=True)
    rig.run()
    after = [state for t, _, state in rig.gives if t > 6.006]
    assert set(after) == {FollowerState.STOPPED_BY_WIRE}


def test_an_empty_battery_or_a_pressed_stop_lets_nothing_begin():
    limits = BatteryParameters(10.5, 9.9)
    rig = Hanging(battery=DrainingBattery(9.0), limits=limits)
    rig.run()
    assert "battery is empty" in rig.programme.stopped
    pressed = Hanging()
    pressed.follower.press_e_stop(pressed=True)
    pressed.run()
    assert pressed.programme.stopped == PRESSED
    for one in (rig, pressed):
        assert one.zero_after(0.0) == 0.0


def test_a_robot_that_swings_is_waited_for_and_one_that_never_rests_refused():
    rig = Hanging()
    rig.follower.plant.reset(p_bf_in_f=np.array((0.3, 0.0, 0.0)))

    def push(_):
        rig.follower.plant.push(np.array((1.0, 0, 0, 0, 0, 0)), 0.3)
        rig.happens[rig.follower.t + 2.0] = push

    rig.happens[1.0] = push
    rig.run(90.0)
    assert "did not hang still" in rig.programme.stopped
    assert rig.zero_after(0.0) == 0.0


def test_a_robot_whose_thrusters_can_t_idle_so_low_is_refused():
    heavy = replace(AMES, robot=replace(AMES.robot, f_min=0.5))
    with pytest.raises(BringUpError, match=r"f_min_n: 0\.5 N is more than 10 % of f_max_n"):
        level_of(heavy, 0.1)


def test_a_light_robot_is_told_less():
    light = replace(AMES, robot=replace(AMES.robot, inertia=0.1 * AMES.robot.inertia, f_min=0.01))
    assert level_of(light, 0.1) < 0.5 * level_of(AMES, 0.1)
