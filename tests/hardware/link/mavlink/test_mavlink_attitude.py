"""An autopilot that takes attitude and thrust: held to the contract, flown, and never let fall."""

from __future__ import annotations

import numpy as np
import pytest

pytest.importorskip("pymavlink", reason="NO PYMAVLINK: pip install pymavlink")

from hardware.contract import AttitudeFollowerContract
from hardware.follower import AttitudeCommand, FollowerState, Refusal
from pipeline.frames import exp
from tests.hardware.link.mavlink.copter_rig import CopterFlight, CopterRig, copter
from tests.hardware.link.mavlink.lab_autopilot import OFFBOARD, POSCTL
from tests.hardware.link.mavlink.mavlink_rig import led, told
from tests.hardware.link.mavlink.test_mavlink_flight import rms_mm

LEADS = AttitudeCommand(np.array([0.02, -0.03, 0.1, 6.0]), armed=True)
"""It stands, and goes on standing."""


@pytest.fixture
def rig():
    rig = CopterRig()
    yield rig
    rig.close()


class TestContract(AttitudeFollowerContract):
    @pytest.fixture
    def rig(self, rig):
        return rig


def lead(rig, seconds, command=LEADS):
    return led(rig, seconds, command)


def running(rig):
    lead(rig, 0.7, AttitudeCommand.zero())
    assert lead(rig, 0.4)[-1].state == FollowerState.RUNNING
    rig.autopilot.taken.clear()
    return rig


@pytest.mark.parametrize("heading", [0.0, 2.2, -1.0])
def test_each_command_comes_once_and_as_it_was_given_whatever_the_heading(rig, heading):
    rig.body.reset(R_fb=exp(np.array([0.0, 0.0, heading])))
    running(rig)
    lead(rig, 1.0)
    assert told(rig).shape == (200, 4)
    assert np.abs(told(rig) - LEADS.attitude).max() < 1e-6


@pytest.mark.parametrize("hover", [None, 0.35])
def test_a_thrust_is_said_as_a_share_of_all_or_by_that_which_hovers(hover):
    rig = running(CopterRig(copter() if hover is None else copter(hover_thrust=hover)))
    lead(rig, 0.1)
    said = [one for one in rig.autopilot.heard if one.get_type() == "SET_ATTITUDE_TARGET"][-1]
    robot = rig.robot_file.robot
    per_newton = 1.0 / (4 * robot.f_max) if hover is None else hover / robot.weight_to_carry
    assert said.thrust == pytest.approx(6.0 * per_newton, rel=1e-6)
    rig.close()


def test_while_its_motors_stand_it_is_told_zero_so_that_its_pilot_can_set_offboard():
    rig = CopterRig()
    rig.autopilot.set(POSCTL, armed=False)
    samples = lead(rig, 1.0, AttitudeCommand.zero())
    assert samples[-1].refusal == Refusal.MODE
    assert len(told(rig)) > 150
    assert not told(rig).any()
    rig.autopilot.set(OFFBOARD, armed=True)
    running(rig)
    rig.close()


def silent_from(rig, seconds):
    """Whatever control says, the autopilot hears no attitude."""
    lead(rig, seconds)
    rig.autopilot.taken.clear()
    samples = lead(rig, 1.0)
    assert rig.autopilot.taken == []
    return samples[-1]


def test_a_pilot_who_switches_away_in_the_air_is_not_followed_by_zero(rig):
    """PX4 takes OFFBOARD again only once set-points come: they would be a thrust of zero."""
    running(rig)
    rig.autopilot.set(POSCTL, armed=True)
    assert silent_from(rig, 0.02).refusal == Refusal.MODE
    rig.autopilot.set(OFFBOARD, armed=True)
    lead(rig, 0.7, AttitudeCommand.zero())
    assert lead(rig, 0.4)[-1].state == FollowerState.RUNNING


def test_one_that_says_nothing_of_its_mode_any_more_is_left_to_its_own_way_down(rig):
    running(rig)
    rig.autopilot.heartbeat = lambda: rig.autopilot.status(12_000)
    assert silent_from(rig, 3.1).refusal == Refusal.MODE


def test_one_whose_heading_is_unknown_is_left_to_its_own_way_down(rig):
    running(rig)
    motion = rig.autopilot.motion
    rig.autopilot.motion = lambda stamp: motion(stamp)[1:]
    assert silent_from(rig, 0.51).state == FollowerState.REFUSING


def test_silent_sensors_are_a_thrust_that_fades_level(rig):
    running(rig)
    motion = rig.autopilot.motion
    rig.autopilot.motion = lambda stamp: motion(stamp)[:1]
    rig.autopilot.taken.clear()
    lead(rig, 2.6)
    thrusts, leans = told(rig)[:, 3], told(rig)[:, :3]
    assert not leans[50:].any()
    assert thrusts[60] > 4.0, "not at once"
    assert (np.diff(thrusts[20:]) <= 1e-6).all()
    assert thrusts[-1] == 0.0


def test_given_back_it_hears_no_zero(rig):
    running(rig)
    lead(rig, 0.2)
    taken = len(rig.autopilot.taken)
    rig.follower.close()
    rig.autopilot.listen(rig.now, rig.stamp)
    assert len(rig.autopilot.taken) == taken


def test_stop_is_zero_at_once(rig):
    running(rig)
    rig.follower.stop()
    rig.autopilot.listen(rig.now, rig.stamp)
    assert not told(rig)[-1].any()


@pytest.mark.slow
def test_it_follows_a_hand_almost_as_by_our_own_link_with_two_of_a_hundred_datagrams_lost():
    robot_file, seed = copter(ramp_s=6.0), 1012
    ours = rms_mm(robot_file, None)
    flight = CopterFlight(robot_file, seed, loss=0.02)
    lossy = rms_mm(robot_file, flight)
    flight.close()
    print(f"{ours:.2f} mm, {lossy:.2f} mm")
    assert lossy < 1.3 * ours
