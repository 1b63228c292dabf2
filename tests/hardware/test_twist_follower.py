"""Robots that take a twist: the contract in virtual time and by UDP, and what moves nothing."""

from dataclasses import replace

import numpy as np
import pytest

from hardware.contract import TwistFollowerContract, exchange
from hardware.follower import FollowerError, Refusal, ThrustCommand, TwistCommand
from hardware.link.control_end import ControlEnd
from hardware.link.datagram import (
    CommandDatagram,
    LinkError,
    decode_command,
    decode_sample,
    encode_command,
)
from hardware.link.link_key import mac
from hardware.link.registry import connect, link_kind
from hardware.link.robot_end import SILENCE_US, LinkLimits, RobotEnd
from hardware.plant_parameters import NO_SENSORS
from hardware.robot_file import COMMANDS, load_robot, robot_of, robot_path, robot_table
from hardware.sim.plant.plant import PlantOptions
from hardware.sim.plant.twist_plant import TwistPlant
from hardware.sim.virtual_time_follower import KEY, VirtualTimeFollower
from pipeline.frames import GRAVITY
from tests.hardware.rigs import LockstepRig, LoopbackRig

TWISTER = load_robot("twister", takes=COMMANDS)
DRIVE = TWISTER.robot.twist
PEER = ("here", 0)


def told_twister():
    table = robot_table(robot_path("twister"))
    del table["body_imu"]
    return robot_of(
        table | {"motion": {"twist": "commanded", "stands_level": False}}, "told twister"
    )


class TestInVirtualTime(TwistFollowerContract):
    @pytest.fixture
    def rig(self):
        return LockstepRig(TWISTER)


class TestToldInVirtualTime(TwistFollowerContract):
    """Of one without motion sensors, which says what it was told."""

    @pytest.fixture
    def rig(self):
        return LockstepRig(told_twister())


class TestByUdp(TwistFollowerContract):
    @pytest.fixture
    def rig(self):
        rig = LoopbackRig(TWISTER)
        yield rig
        rig.close()


class Robot:
    """A robot's end that is followed, with a way to say anything to it in good time."""

    def __init__(self):
        self.end = RobotEnd(LinkLimits.of(TWISTER), 1, KEY)
        self.now_us, self.counter, self.nonce = 0, 0, 0
        while self.end.state.name != "IDLE":
            self.say()
        for k in range(1, 5):
            self.say(twist_in_b=(0.02 * k, 0.0, 0.0, 0.0, 0.0, 0.0))

    def datagram(self, **changes):
        command = CommandDatagram(5, self.counter, self.nonce, 9, False, (), False, (0.0,) * 6)
        command = replace(command, **changes)
        return replace(command, armed=changes.get("armed", any(command.values)))

    def pass_tick(self):
        self.now_us += 5_000
        self.nonce += 1
        data = self.end.sample(self.now_us, self.nonce, (0,) * 3, (0,) * 3, np.zeros(6))
        assert decode_sample(data, KEY).twist_in_b == (0.0,) * 6

    def say(self, key=KEY, **changes):
        self.pass_tick()
        self.counter += 1
        data = encode_command(self.datagram(**changes), key)
        return self.end.receive(data, PEER, self.now_us)

    @property
    def speed(self):
        return float(self.end.setpoint(self.now_us)[0])


FAST = (0.095, 0.0, 0.0, 0.0, 0.0, 0.0)
NOT_TAKEN = {
    "not a number": (Refusal.NOT_FINITE, {"twist_in_b": (np.nan, *5 * (0.0,))}),
    "infinite": (Refusal.NOT_FINITE, {"twist_in_b": (0.08, np.inf, *4 * (0.0,))}),
    "too fast": (Refusal.LIMITS, {"twist_in_b": (0.4, 0.4, 0.0, 0.0, 0.0, 0.0)}),
    "turning too fast": (Refusal.LIMITS, {"twist_in_b": (0.08, 0.0, 0.0, 1.2, 1.2, 0.0)}),
    "a jump": (Refusal.RISE, {"twist_in_b": (0.3, 0.0, 0.0, 0.0, 0.0, 0.0)}),
    "the other way": (Refusal.RISE, {"twist_in_b": (-0.08, 0.0, 0.0, 0.0, 0.0, 0.0)}),
    "not armed": (Refusal.LIMITS, {"twist_in_b": FAST, "armed": False}),
    "of another process": (Refusal.EPOCH, {"twist_in_b": FAST, "epoch": 4}),
    "repeated": (Refusal.COUNTER, {"twist_in_b": FAST, "counter": 100}),
    "made of nothing": (Refusal.NONCE, {"twist_in_b": FAST, "nonce": 1 << 40}),
    "made of old samples": (Refusal.STALE, {"twist_in_b": FAST, "nonce": 95}),
    "forged": (Refusal.MALFORMED, {"twist_in_b": FAST, "key": bytes(range(16))}),
    "thrusts": (Refusal.THRUSTERS, {"twist_in_b": (), "thrusts": (1.0,) * 6}),
}


@pytest.mark.parametrize("why", NOT_TAKEN)
def test_what_may_not_be_taken_changes_nothing(why):
    refusal, changes = NOT_TAKEN[why]
    robot = Robot()
    before = robot.speed
    assert before == pytest.approx(0.08)
    assert robot.say(**changes) == refusal
    assert robot.speed == before


def test_the_next_good_one_is_taken():
    robot = Robot()
    assert robot.say(twist_in_b=FAST) == Refusal.NONE
    assert robot.speed == pytest.approx(FAST[0])


def test_a_command_replayed_byte_for_byte_moves_nothing():
    robot = Robot()
    robot.pass_tick()
    robot.counter += 1
    data = encode_command(robot.datagram(twist_in_b=FAST), KEY)
    assert robot.end.receive(data, PEER, robot.now_us) == Refusal.NONE
    robot.say(twist_in_b=(0.08, 0.0, 0.0, 0.0, 0.0, 0.0))
    assert robot.end.receive(data, PEER, robot.now_us) == Refusal.COUNTER
    assert robot.speed == pytest.approx(0.08)


@pytest.mark.parametrize("twist", [np.eye(6)[0] * 0.5, np.eye(6)[5] * 1.5, np.array([0.05] * 6)])
def test_a_silent_robot_is_told_to_stand_still_in_time_and_never_brakes_too_hard(twist):
    robot, told = Robot(), 0.08 * np.eye(6)[0]
    while (told != twist).any():
        told = DRIVE.toward(told, twist, 0.0049)
        assert robot.say(twist_in_b=tuple(told)) == Refusal.NONE
    since_us = robot.now_us
    setpoints = [robot.end.setpoint(us) for us in range(since_us, since_us + 170_001, 5_000)]
    assert all((one == setpoints[0]).all() for one in setpoints[: SILENCE_US // 5_000])
    assert not setpoints[-1].any()
    changes = np.diff(setpoints, axis=0)
    assert np.linalg.norm(changes[:, :3], axis=1).max() <= DRIVE.acceleration * 0.005 * 1.001
    most = DRIVE.angular_acceleration * 0.005 * 1.001
    assert np.linalg.norm(changes[:, 3:], axis=1).max() <= most


def test_datagrams_of_twists_and_of_thrusts_are_never_taken_for_each_other():
    said = CommandDatagram(5, 1, 2, 3, True, (), False, (0.25,) * 6)
    data = encode_command(said, KEY)
    assert decode_command(data, KEY) == said
    swapped = b"LLcm" + data[4:]
    with pytest.raises(LinkError, match="mac"):
        decode_command(swapped, KEY)


def test_a_twist_has_six_numbers():
    data = encode_command(CommandDatagram(5, 1, 2, 3, True, (), False, (0.25,) * 5), KEY)
    with pytest.raises(LinkError, match="values: 6"):
        decode_command(data, KEY)
    assert len(mac(KEY, data)) == 16


def test_links_that_carry_no_twist_refuse_such_a_robot_before_anything_is_sent():
    rpit = TWISTER.reached("127.0.0.1", 31415, "rpit")
    with pytest.raises(FollowerError, match=r"link\.takes = 'twist'.*thrusts by this one"):
        connect(rpit, KEY, 1)
    assert link_kind("udp").takes == COMMANDS


def test_the_robot_itself_never_goes_beyond_its_limits_whatever_it_is_told():
    plant = TwistPlant(DRIVE, TWISTER.plant.imu, np.random.default_rng(0))
    rng = np.random.default_rng(1)
    for _ in range(200):
        told = rng.normal(0.0, 3.0, 6)
        for _ in range(int(rng.integers(1, 40))):
            plant.step(told)
            twist, rate = plant.twist_in_b, plant.twist_rate_in_b
            assert np.linalg.norm(twist[:3]) <= DRIVE.speed * 1.000001
            assert np.linalg.norm(twist[3:]) <= DRIVE.rate * 1.000001
            assert np.linalg.norm(rate[:3]) <= DRIVE.acceleration * 1.000001
            assert np.linalg.norm(rate[3:]) <= DRIVE.angular_acceleration * 1.000001


def test_the_simulated_body_moves_as_its_sensors_feel():
    still = PlantOptions(imu_noise=False, imu_bias=False, imu_steps=False)
    plant = TwistPlant(DRIVE, TWISTER.plant.imu, np.random.default_rng(0), still)
    rng, v_in_f = np.random.default_rng(3), np.zeros(3)
    told = np.zeros(6)
    for k in range(2000):
        if k % 100 == 0:
            told = rng.normal(0.0, 0.3, 6)
        plant.step(told, 0.001)
        omega_in_b, a_in_b = plant.imu()
        v_in_f = v_in_f + 0.001 * (plant.R_fb @ a_in_b - np.array([0.0, 0.0, GRAVITY]))
        assert omega_in_b == pytest.approx(plant.twist_in_b[3:])
    assert v_in_f == pytest.approx(plant.R_fb @ plant.twist_in_b[:3], abs=0.003)


def test_what_it_says_of_the_time_ahead_comes_true_and_moves_nothing():
    plant = TwistPlant(DRIVE, NO_SENSORS, np.random.default_rng(0))
    rng = np.random.default_rng(4)
    for _ in range(20):
        told = rng.normal(0.0, 0.3, 6)
        plant.step(told)
        before = plant.p_bf_in_f
        ahead = plant.ahead(0.06)
        np.testing.assert_array_equal(plant.p_bf_in_f, before)
        assert [round(t, 6) for t, _, _ in ahead] == [0.005 * k for k in range(1, 13)]
        for _, wxyz, p in ahead:
            plant.step(told)
            assert plant.p_bf_in_f == pytest.approx(p, abs=5e-4)
            assert plant.wxyz_fb == pytest.approx(wxyz, abs=2e-3)


def test_who_stands_before_a_wall_goes_nowhere_whatever_it_is_told():
    plant = TwistPlant(DRIVE, NO_SENSORS, np.random.default_rng(0))
    plant.is_blocked = plant.wheels_spin = True
    for _ in range(20):
        plant.step(np.full(6, 0.1))
    for _, wxyz, p in plant.ahead(0.06):
        np.testing.assert_array_equal(p, plant.p_bf_in_f)
        np.testing.assert_array_equal(wxyz, plant.wxyz_fb)


def test_a_robot_that_has_thrusters_drops_the_samples_of_one_that_has_none():
    follower = VirtualTimeFollower(TWISTER)
    ames = VirtualTimeFollower(load_robot("ames"))
    heard = []
    ames.to_control = lambda data: (heard.append(data), (data,))[1]
    for _ in range(5):
        exchange(ames, ThrustCommand.zero(8))
        ames.advance()
    follower.to_control = lambda _: heard
    dropped = follower.dropped
    exchange(follower, TwistCommand.zero())
    follower.advance()
    assert exchange(follower, TwistCommand.zero()) == []
    assert follower.dropped >= dropped + len(heard)


def test_samples_of_a_robot_with_other_senses_than_its_file_says_are_not_its_own():
    """Each end has its own file: zeros are no gravity, and gravity is no age."""
    for ours, theirs in ((told_twister(), TWISTER), (TWISTER, told_twister())):
        follower = VirtualTimeFollower(theirs)
        follower._end = ControlEnd.of(ours, KEY, 1)
        for _ in range(20):
            follower.send(TwistCommand.zero())
            follower.advance()
            assert follower.receive() == []
        assert follower.dropped > 10
