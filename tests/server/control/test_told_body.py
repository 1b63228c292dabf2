"""A robot without motion sensors, as control has its samples."""

from dataclasses import replace

import numpy as np
import pytest

from hardware.follower import NOT_MEASURED, BodySample, FollowerState, Refusal, TwistCommand
from hardware.robot_file import COMMANDS, load_robot
from pipeline.frames import GRAVITY
from server.control.robot_clock import RobotLink
from server.control.told_body import UNTOLD, ToldBody

ROVER = load_robot("rover", takes=COMMANDS).robot
MOTION = ROVER.motion
TOLD = replace(MOTION, is_measured=False)
FORWARD = np.array([0.3, 0.0, 0.0, 0.0, 0.0, 0.4])


def sample(t, twist=FORWARD, age_s=0.04, state=FollowerState.RUNNING):
    zeros = np.zeros(3)
    return BodySample(
        round(1e6 * t), zeros, zeros, np.zeros(0), state, 1, Refusal.NONE, 0.0, twist, age_s
    )


def heard(body, seconds=1.0, command=FORWARD, **said):
    body.tell(TwistCommand(command, armed=True))
    times = np.arange(0.005, seconds, 0.005)
    return [body.hear(sample(t, **said), float(t)) for t in times]


def test_it_moves_as_measured_even_if_it_was_told_otherwise():
    body = ToldBody(ROVER.twist, MOTION)
    last = heard(body, command=np.zeros(6))[-1]
    assert last.twist_m_bf_in_b == pytest.approx(FORWARD)
    assert last.omega_m_bf_in_b == pytest.approx(FORWARD[3:])


def test_before_a_measured_twist_has_come_it_moves_as_it_was_told():
    body = ToldBody(ROVER.twist, TOLD)
    samples = heard(body, 0.5, age_s=NOT_MEASURED)
    speeds = [one.twist_m_bf_in_b[0] for one in samples]
    assert speeds[0] < 0.01
    assert np.all(np.diff(speeds) >= -1e-12)
    assert speeds[-1] == pytest.approx(0.3, abs=1e-3)


def test_one_that_does_not_obey_is_not_taken_to_move_as_told():
    body = ToldBody(ROVER.twist, TOLD)
    heard(body, 0.5, age_s=NOT_MEASURED)
    body.tell(TwistCommand(FORWARD, armed=True))
    for k in range(100):
        t = 0.5 + 0.005 * k
        last = body.hear(sample(t, age_s=NOT_MEASURED, state=FollowerState.COAST), t)
    assert np.abs(last.twist_m_bf_in_b).max() < 1e-4


def test_an_accelerometer_on_a_level_one_would_feel_gravity_and_on_another_nobody_knows():
    rest = heard(ToldBody(ROVER.twist, MOTION), command=np.zeros(6), twist=np.zeros(6))[-1]
    assert rest.a_m_bf_in_b == pytest.approx([0.0, 0.0, GRAVITY])
    tilted = heard(ToldBody(ROVER.twist, replace(TOLD, is_level=False)), age_s=NOT_MEASURED)[-1]
    assert not tilted.a_m_bf_in_b.any()


class Script:
    def __init__(self):
        self.samples, self.sent = [], []

    def receive(self):
        samples, self.samples = self.samples, []
        return samples

    def send(self, command):
        self.sent.append(command)


@pytest.mark.parametrize("age_s", [MOTION.lasts_s + 0.01, NOT_MEASURED])
def test_who_no_longer_measures_is_silent_and_said_to_be(age_s):
    script = Script()
    link = RobotLink(script, told=ToldBody.of(ROVER))
    for k in range(1, 40):
        script.samples = [sample(0.005 * k)]
        assert len(link.receive(0.005 * k)) == 1
        assert link.gap == ""
    script.samples = [sample(0.2, age_s=age_s)]
    assert link.receive(0.2) == []
    assert link.gap == UNTOLD


def test_what_it_is_told_goes_to_the_robot_and_counts_from_then_on():
    script = Script()
    link = RobotLink(script, told=ToldBody(ROVER.twist, TOLD))
    link.send(TwistCommand(FORWARD, armed=True))
    assert [one.twist_in_b.tolist() for one in script.sent] == [FORWARD.tolist()]
    for k in range(1, 200):
        script.samples = [sample(0.005 * k, age_s=NOT_MEASURED)]
        bodies = link.receive(0.005 * k)
    assert bodies[0].twist_m_bf_in_b == pytest.approx(FORWARD, abs=1e-3)


def test_a_robot_with_motion_sensors_is_taken_at_its_word():
    assert ToldBody.of(load_robot("twister", takes=COMMANDS).robot) is None
