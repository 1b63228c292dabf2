"""The twist that a robot is told: its law, its bounds, and none of it outside TRACK."""

from dataclasses import replace

import numpy as np
import pytest

from hardware.robot_file import COMMANDS, load_robot
from pipeline.control.acting import Moment
from pipeline.control.leading import PLAIN
from pipeline.control.leash import Leashed
from pipeline.control.pid import PoseError, Reference
from pipeline.control.tracking import Situation
from pipeline.control.twist_acting import TwistActing
from pipeline.control.twist_margins import twist_refusal
from pipeline.frames import exp
from pipeline.signals import BodyImu, Mode, RelativeState, VirtualView

ROBOT = load_robot("twister", takes=COMMANDS).robot
DRIVE = ROBOT.twist
SILENT_S, PERIOD_S = 0.150, 0.005
STILL = np.zeros(3)
R_FV, R_VB = exp(np.array([0.1, -0.2, 0.7])), exp(np.array([-0.3, 0.1, 0.4]))


def known(omega_vf_in_v=STILL):
    view = VirtualView(R_FV, omega_vf_in_v, np.array([1.5, 0.0, 0.0]), R_VB, STILL, STILL)
    relative = RelativeState(
        0.0, view.p_bv_in_v, R_VB, STILL, STILL, STILL, np.eye(3), 0.0, 0.0, 0.0, STILL, STILL
    )
    return Situation(relative, R_FV, view)


def error(e_p_in_v=STILL, e_p_rate_in_v=STILL, e_eta_in_b=STILL):
    return Leashed(PoseError(e_p_in_v, e_p_rate_in_v, e_eta_in_b, STILL))


def moment(mode=Mode.TRACK, twist_in_b=None, silence_s=0.05):
    body = BodyImu(0.0, STILL, STILL, np.zeros(6) if twist_in_b is None else twist_in_b)
    reference = Reference(np.array([1.5, 0.0, 0.0]), R_VB)
    return Moment(mode, reference, PLAIN, body, False, PERIOD_S, silence_s, True)


def settled(leashed, now, situation=None, acting=None, periods=300):
    acting = acting or TwistActing(ROBOT, DRIVE, SILENT_S)
    for _ in range(periods):
        acted = acting.act(situation or known(), leashed, now, 1.0)
    return acted.twist_in_b


def test_an_error_is_gone_after_by_its_gain_in_the_axes_of_the_body():
    e_p_in_v, e_eta_in_b = np.array([0.01, -0.02, 0.03]), np.array([0.02, 0.05, -0.04])
    twist = settled(error(e_p_in_v, e_eta_in_b=e_eta_in_b), moment())
    assert twist[:3] == pytest.approx(DRIVE.position_gain * R_VB.T @ e_p_in_v)
    assert twist[3:] == pytest.approx(DRIVE.attitude_gain * e_eta_in_b)


def test_a_robot_that_goes_along_with_its_reference_goes_on_without_an_error():
    v_b_in_b = np.array([0.1, -0.05, 0.08])
    twist = settled(error(), moment(twist_in_b=np.concatenate((v_b_in_b, STILL))))
    assert twist[:3] == pytest.approx(v_b_in_b, abs=1e-6)


def test_a_reference_that_leaves_it_behind_is_followed():
    e_p_rate_in_v = np.array([0.05, 0.02, -0.1])
    twist = settled(error(e_p_rate_in_v=e_p_rate_in_v), moment())
    assert twist[:3] == pytest.approx(R_VB.T @ e_p_rate_in_v, abs=1e-6)


def test_it_turns_with_the_virtual_camera():
    omega_vf_in_v = np.array([0.1, 0.2, -0.3])
    twist = settled(error(), moment(), known(omega_vf_in_v))
    assert twist[3:] == pytest.approx(R_VB.T @ omega_vf_in_v)


def test_a_large_error_is_gone_after_at_the_largest_speed_without_a_step():
    acting, far = TwistActing(ROBOT, DRIVE, SILENT_S), error(np.array([3.0, 4.0, 0.0]))
    twists = np.array([settled(far, moment(), acting=acting, periods=1) for _ in range(100)])
    speeds = np.linalg.norm(twists[:, :3], axis=1)
    assert speeds[-1] == pytest.approx(DRIVE.speed)
    assert speeds.max() <= DRIVE.speed * 1.000001
    assert speeds[0] == pytest.approx(DRIVE.acceleration * PERIOD_S)
    assert np.linalg.norm(np.diff(twists[:, :3], axis=0), axis=1).max() <= 0.0250001


def test_axes_that_are_let_alone_are_told_zero():
    robot = replace(ROBOT, axes=np.array([True, False, True, False, True, False]))
    acting = TwistActing(robot, DRIVE, SILENT_S)
    twist = settled(error(np.full(3, 0.01), e_eta_in_b=np.full(3, 0.01)), moment(), acting=acting)
    assert (twist[[1, 3, 5]] == 0.0).all()
    assert (twist[[0, 2, 4]] != 0.0).all()


@pytest.mark.parametrize("mode", [Mode.COAST, Mode.HOLD, Mode.RAMP])
def test_outside_track_it_brakes_to_zero_whatever_the_error(mode):
    acting, far = TwistActing(ROBOT, DRIVE, SILENT_S), error(np.array([3.0, 4.0, 0.0]))
    assert settled(far, moment(), acting=acting).any()
    periods = round(DRIVE.stop_s / PERIOD_S)
    assert settled(far, moment(mode), acting=acting, periods=periods - 2).any()
    assert not settled(far, moment(mode), acting=acting, periods=3).any()


@pytest.mark.parametrize("mode", [Mode.DISARMED, Mode.ARMED, Mode.STOPPED])
def test_a_robot_that_is_not_to_move_is_told_zero_at_once(mode):
    acting, far = TwistActing(ROBOT, DRIVE, SILENT_S), error(np.array([3.0, 4.0, 0.0]))
    assert settled(far, moment(), acting=acting).any()
    assert not settled(far, moment(mode), acting=acting, periods=1).any()


def test_news_that_grow_old_slow_it_down_before_they_are_too_old():
    leashed = error(np.array([0.05, 0.0, 0.0]))
    speeds = [
        np.linalg.norm(settled(leashed, moment(silence_s=s))) for s in (0.0, 0.09, 0.12, 0.15, 1.0)
    ]
    assert speeds == pytest.approx([0.25, 0.25, 0.125, 0.0, 0.0])


@pytest.mark.parametrize("value", [np.nan, np.inf])
def test_what_is_no_number_is_told_as_zero_and_is_forgotten(value):
    acting, good = TwistActing(ROBOT, DRIVE, SILENT_S), error(np.array([0.02, 0.0, 0.0]))
    bad = error(e_p_rate_in_v=np.array([value, 0.0, 0.0]))
    with np.errstate(invalid="ignore"):
        assert not settled(bad, moment(), acting=acting).any()
    assert np.linalg.norm(settled(good, moment(), acting=acting)) == pytest.approx(0.1)


def test_pictures_too_old_for_its_gains_are_refused_in_words():
    assert twist_refusal(DRIVE, 0.12, 0.01) == ""
    assert twist_refusal(DRIVE, 0.16, 0.01) == ""
    assert "0.17 s old" in twist_refusal(DRIVE, 0.17, 0.01)
