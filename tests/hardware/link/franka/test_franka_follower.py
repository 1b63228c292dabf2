"""An arm of Franka's without its library: the contract, and what stops it or lets it go on."""

from __future__ import annotations

import numpy as np
import pytest

from hardware.contract import TwistFollowerContract, exchange
from hardware.follower import EStop, FollowerState, Refusal, TellsHealth, TwistCommand
from hardware.link.franka.arm_end import SILENT_S, ArmLimits
from hardware.link.robot_end import LinkLimits
from hardware.twist_schema import TOLD_ZERO_S
from tests.hardware.link.franka.franka_rig import MOUNT, TWISTER, FrankaRig

MOVING = TwistCommand(np.array([0.2, -0.1, 0.05, 0.1, 0.3, -0.5]), armed=True)
ZERO = TwistCommand.zero()
DRIVE = TWISTER.robot.twist
FRESH_S = LinkLimits.of(TWISTER).max_age_us / 1e6
"""So long a command may rest on the same sample."""


class TestContract(TwistFollowerContract):
    """The body where the end effector is: elsewhere each turn of a period would shift it."""

    @pytest.fixture
    def rig(self):
        return FrankaRig(MOUNT | {"body_in_ee_m": [0.0, 0.0, 0.0]})


def lead(rig, seconds, command=MOVING):
    samples = []
    for _ in range(round(seconds / 0.005)):
        samples += exchange(rig.follower, command)
        rig.advance(0.005)
    return samples


@pytest.fixture
def rig():
    """One whose arm is led."""
    rig = FrankaRig()
    lead(rig, 0.7, ZERO)
    assert lead(rig, 0.5)[-1].state == FollowerState.RUNNING
    rig.arm.told.clear()
    return rig


def moves(rig):
    return any(told.twist_in_o.any() for told in rig.arm.told)


def test_the_body_moves_as_commanded_wherever_the_arm_carries_it(rig):
    sample = lead(rig, 0.5)[-1]
    assert rig.arm.body.twist_in_b == pytest.approx(MOVING.twist_in_b, abs=1e-3)
    assert sample.twist_in_b == pytest.approx(rig.arm.body.twist_in_b, abs=1e-6)
    assert sample.twist_age_s == pytest.approx(0.0, abs=1e-6)


def test_the_arm_may_move_its_end_effector_as_the_body_needs_at_most(rig):
    limits = ArmLimits.of(DRIVE, rig.robot_file.link.franka)
    fastest = np.array([DRIVE.speed, 0.0, 0.0, 0.0, 0.0, DRIVE.rate])
    lead(rig, 1.0, TwistCommand(fastest, armed=True))
    told = np.array([told.twist_in_o for told in rig.arm.told])
    assert DRIVE.speed < np.linalg.norm(told[-1, :3]) <= limits.speed
    changes = np.linalg.norm(np.diff(told[:, :3], axis=0), axis=1) / 0.005
    centripetal = DRIVE.rate * limits.speed  # the body's axes turn, those of the arm's base don't
    assert changes.max() <= limits.acceleration + centripetal


def test_what_was_measured_over_a_time_is_as_old_as_its_middle():
    rig = FrankaRig()
    rig.advance(0.005)
    heard = rig.arm.heard()
    rig.follower._end.hear(
        type(heard)(1, heard.stamp, heard.at, heard.R_oe, heard.twist_in_e, before_s=0.01)
    )
    assert rig.follower.receive() == []  # nobody has asked yet
    rig.follower.send(ZERO)
    assert rig.follower.receive()[-1].twist_age_s == pytest.approx(0.01)


def test_an_arm_that_is_silent_is_told_to_stand_still_in_time(rig):
    heard, rig.arm.heard = rig.arm.heard, lambda: None
    lead(rig, 1.0)
    told = np.array([told.twist_in_o for told in rig.arm.told])
    assert told[round(SILENT_S / 0.005)].any()
    assert not told[round((SILENT_S + FRESH_S + TOLD_ZERO_S) / 0.005) :].any()
    rig.arm.heard = heard
    rig.arm.told.clear()
    assert lead(rig, 0.5)[-1].state == FollowerState.REFUSING
    assert not moves(rig)


def test_an_arm_that_its_controller_has_stopped_says_so_and_is_told_zero_at_once(rig):
    rig.arm.fault = "stopped by cartesian_reflex"
    samples = lead(rig, 0.5)
    assert {s.state for s in samples[2:]} == {FollowerState.REFUSING}
    assert {s.refusal for s in samples[2:]} == {Refusal.FAULT}
    assert not any(told.twist_in_o.any() for told in rig.arm.told[2:])


def test_it_is_asked_to_recover_only_while_nobody_is_armed(rig):
    rig.arm.fault = "stopped by cartesian_reflex"
    lead(rig, 0.5)
    assert not any(told.recovers for told in rig.arm.told)
    rig.arm.told.clear()
    lead(rig, 0.1, ZERO)
    assert all(told.recovers for told in rig.arm.told)


def test_recovered_it_moves_only_after_zero_of_a_new_epoch(rig):
    epoch = rig.follower.epoch
    rig.arm.fault = "stopped by cartesian_reflex"
    lead(rig, 0.3)
    rig.arm.fault = ""
    rig.arm.told.clear()
    assert lead(rig, 1.0)[-1].state == FollowerState.REFUSING
    assert not moves(rig)
    lead(rig, 0.7, ZERO)
    assert rig.follower.epoch > epoch
    assert lead(rig, 0.3)[-1].state == FollowerState.RUNNING
    assert not any(told.recovers for told in rig.arm.told)


def test_no_handshake_ends_while_it_can_not_move(rig):
    rig.arm.fault = "mode Guiding"
    samples = lead(rig, 2.0, ZERO)
    assert {s.state for s in samples[2:]} == {FollowerState.REFUSING}


def test_its_emergency_stop_is_that_of_our_own_link(rig):
    assert isinstance(rig.follower, TellsHealth)
    assert rig.follower.health[0].e_stop == EStop.CLOSED
    rig.arm.is_stopped, rig.arm.fault = True, "mode UserStopped"
    sample = lead(rig, 0.3)[-1]
    assert (sample.state, sample.refusal) == (FollowerState.STOPPED_BY_WIRE, Refusal.WIRE)
    assert rig.follower.health[0].e_stop == EStop.OPEN
    rig.arm.is_stopped, rig.arm.fault = False, ""
    assert lead(rig, 0.5)[-1].state == FollowerState.STOPPED_BY_WIRE
    lead(rig, 0.7, ZERO)
    assert lead(rig, 0.3)[-1].state == FollowerState.RUNNING


def test_connected_anew_it_has_just_started(rig):
    (before,) = {s.boot_id for s in lead(rig, 0.1)}
    rig.arm.connection += 1
    samples = lead(rig, 0.5)
    assert samples[-1].boot_id != before
    assert samples[-1].state == FollowerState.REFUSING


def test_what_is_no_number_is_not_believed(rig):
    dropped = rig.follower.dropped
    rig.arm.body.twist_in_b = np.full(6, np.nan)
    rig.arm.body.step = lambda *_: None
    lead(rig, 0.5)
    assert rig.follower.dropped == dropped + 99
    assert not rig.arm.told[-1].twist_in_o.any()


def test_commands_that_come_to_no_arm_are_counted():
    rig = FrankaRig()
    rig.cut_link()
    assert lead(rig, 0.5, ZERO) == []
    assert rig.follower.lost == 100


def test_the_last_words_are_zeros(rig):
    taken = len(rig.arm.told)
    rig.follower.close()
    last = rig.arm.told[taken:]
    assert last
    assert not any(told.twist_in_o.any() for told in last)
