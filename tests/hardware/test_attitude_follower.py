"""Robots that take attitude and thrust: the contract in virtual time and by UDP, refusals."""

import numpy as np
import pytest

from hardware.contract import AttitudeFollowerContract
from hardware.follower import AttitudeCommand, Refusal
from hardware.link.control_end import ControlEnd
from hardware.link.datagram import CommandDatagram, LinkError, decode_command, encode_command
from hardware.link.link_key import mac
from hardware.link.robot_end import LinkLimits, RobotEnd
from hardware.robot_file import load_robot, robot_of, robot_path, robot_table
from hardware.sim.virtual_time_follower import KEY
from tests.hardware.rigs import LockstepRig, LoopbackRig

COPTER = robot_of(robot_table(robot_path("copter")) | {"ramp_s": 2.0}, "copter")
LIMITS = LinkLimits.of(COPTER)
LEADS = (0.1, -0.05, 0.3, 6.0)


class TestInVirtualTime(AttitudeFollowerContract):
    @pytest.fixture
    def rig(self):
        return LockstepRig(COPTER)


class TestByUdp(AttitudeFollowerContract):
    @pytest.fixture
    def rig(self):
        rig = LoopbackRig(COPTER)
        yield rig
        rig.close()


def ready_end():
    """A robot's end that waits to be led, its time and the last counter."""
    end, now_us = RobotEnd(LIMITS, 1, KEY), 0
    for counter in range(1, 110):
        now_us += 5_000
        end.sample(now_us, counter, (0,) * 3, (0,) * 3, np.zeros(4))
        end.receive(datagram(counter, (0.0,) * 4, armed=False), ("here", 0), now_us)
    assert end.state.name == "IDLE"
    return end, now_us, 110


def datagram(counter, attitude, *, armed=True, **others):
    command = CommandDatagram(5, counter, counter, 9, armed, (), attitude=attitude, **others)
    return encode_command(command, KEY)


REFUSED = {
    "leans too far": (Refusal.LIMITS, (0.3, 0.3, 0.0, 6.0)),
    "turns too fast": (Refusal.LIMITS, (0.0, 0.0, -1.7, 6.0)),
    "pulls": (Refusal.LIMITS, (0.0, 0.0, 0.0, -1.0)),
    "more than all thrusters": (Refusal.LIMITS, (0.0, 0.0, 0.0, 28.1)),
    "a jump": (Refusal.RISE, (0.0, 0.0, 0.0, 8.1)),
    "not a number": (Refusal.NOT_FINITE, (0.0, float("nan"), 0.0, 6.0)),
}


@pytest.mark.parametrize("why", REFUSED)
def test_the_robot_takes_nothing_beyond_its_file(why):
    end, now_us, counter = ready_end()
    end.sample(now_us, counter, (0,) * 3, (0,) * 3, np.zeros(4))
    refusal, attitude = REFUSED[why]
    assert end.receive(datagram(counter, attitude), ("here", 0), now_us) == refusal
    assert not end.setpoint(now_us).any()
    assert end.receive(datagram(counter, LEADS), ("here", 0), now_us) == Refusal.NONE
    np.testing.assert_allclose(end.setpoint(now_us), LEADS, rtol=1e-6)


@pytest.mark.parametrize("other", [{"thrusts": (1.0,) * 4}, {"twist_in_b": (0.01,) * 6}])
def test_what_other_robots_take_is_refused_by_its_shape(other):
    end, now_us, counter = ready_end()
    command = CommandDatagram(5, counter, counter, 9, True, **({"thrusts": ()} | other))
    assert end.receive(encode_command(command, KEY), ("here", 0), now_us) == Refusal.THRUSTERS


def test_robots_of_thrusts_refuse_an_attitude():
    end = RobotEnd(LinkLimits.of(load_robot("quadrotor")), 1, KEY)
    assert end.receive(datagram(1, (0.0,) * 4, armed=False), ("here", 0), 1) == Refusal.THRUSTERS


def test_it_is_the_bytes_that_were_sent_and_of_four_numbers_alone():
    data = datagram(7, LEADS)
    assert decode_command(data, KEY).attitude == pytest.approx(LEADS)
    body = data[:5] + b"\x03" + data[6:-20]
    with pytest.raises(LinkError, match="values"):
        decode_command(body + mac(KEY, body), KEY)


def test_control_slows_down_a_thrust_that_rises_too_fast_and_no_lean():
    drive = COPTER.robot.attitude
    end = ControlEnd(4, 7.0, 0.1, 5, KEY, attitude=drive)
    command = AttitudeCommand(np.array([0.2, -0.2, 1.0, 6.0]), armed=True)
    assert end.next_command(command, 1.0).attitude == pytest.approx((0.2, -0.2, 1.0, 0.1))
    assert end.next_command(command, 1.0).attitude == pytest.approx((0.2, -0.2, 1.0, 0.2))
    assert end.limited == 2
