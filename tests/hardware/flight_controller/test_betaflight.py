"""What Betaflight is told and what its answers mean, without it; with it: tests/counterparts."""

import struct
from dataclasses import replace

import numpy as np
import pytest

from hardware.flight_controller import msp
from hardware.flight_controller.betaflight import Betaflight
from hardware.flight_controller.robot_computer import RobotComputer
from hardware.follower import BodySample, FollowerState, RobotHealth, ThrustCommand
from hardware.link.control_end import ControlEnd
from hardware.robot_file import (
    FlightControllerParameters,
    RobotFileError,
    load_robot,
    robot_of,
    robot_path,
    robot_table,
)
from hardware.sim.simulated import seeded_nonces
from tests.hardware.flight_controller.test_msp import IMU, VARIANT, answer_of

AMES = load_robot("ames")
KEY, PEER = bytes(range(16)), ("control", 1)
WIRING = FlightControllerParameters(tuple(range(8, 0, -1)), 2.0, np.eye(3), 16.4, 256.0)
WIRED = replace(AMES, flight_controller=WIRING)


def motor_config(motors: int) -> bytes:
    return answer_of(msp.MOTOR_CONFIG, struct.pack("<3HBBBB", 1070, 2000, 1000, motors, 14, 0, 0))


def status(*, armed: bool) -> bytes:
    return answer_of(msp.STATUS, struct.pack("<3HI", 125, 0, 33, int(armed)) + bytes(12))


FIT = VARIANT + motor_config(8) + status(armed=False)


def motors_of(sent: bytes) -> list[int]:
    assert sent[:5] == b"$M<" + bytes([sent[3], msp.SET_MOTOR])
    return list(struct.unpack_from(f"<{sent[3] // 2}H", sent, 5))


def fit(parameters: FlightControllerParameters = WIRING) -> Betaflight:
    one = Betaflight(parameters, 3.0)
    one.feed(FIT, 0)
    assert one.unfit == ""
    return one


def test_thrust_reaches_its_own_motor_by_the_square_root():
    thrusts = np.array([3.0, 0.75, 0.0, 0.0, 0.0, 0.0, 0.0, 0.03])
    assert motors_of(fit().tick(thrusts, 0)) == [1100, 1000, 1000, 1000, 1000, 1000, 1500, 2000]


@pytest.mark.parametrize(
    ("said", "why"),
    [
        (b"", "has not said yet"),
        (motor_config(8) + status(armed=False), "has not said yet"),
        (
            VARIANT.replace(
                b"BTFL\x1a", b"INAV" + bytes([0x06 ^ ord("I") ^ ord("N") ^ ord("A") ^ ord("V")])
            )
            + motor_config(8),
            "has not said yet",
        ),
        (VARIANT + motor_config(4), "has 4 motors; the robot file uses 8"),
        (FIT + status(armed=True), "armed by its radio"),
    ],
)
def test_who_is_not_fit_gets_no_thrust_and_says_why(said, why):
    one = Betaflight(WIRING, 3.0)
    one.feed(said, 0)
    assert why in one.unfit
    assert set(motors_of(one.tick(np.full(8, 3.0), 0))) == {1000}


def test_motors_that_no_thruster_has_are_told_to_stop():
    few = replace(WIRING, motors=(1, 3))
    one = Betaflight(few, 3.0)
    one.feed(FIT, 0)
    assert motors_of(one.tick(np.full(2, 3.0), 0)) == [2000, 1000, 2000, *5 * [1000]]


def test_sensors_are_turned_into_the_bodys_axes_and_dated_between_question_and_answer():
    one = fit(replace(WIRING, R_bi=np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])))
    one.tick(np.zeros(8), 10_000)
    one.feed(IMU, 14_000)
    (reading,) = one.readings
    assert reading.t_us == 12_000
    turn = np.radians(np.array([93.0, -187.0, -281.0]) / 16.4)
    assert reading.omega_in_b == pytest.approx([-turn[1], turn[0], turn[2]])
    assert reading.a_in_b == pytest.approx([0.0, 0.0, 255.0 / 256.0 * 9.80665], rel=1e-3)


def test_answers_that_come_together_are_dated_one_after_the_other():
    one = fit()
    one.tick(np.zeros(8), 10_000)
    one.tick(np.zeros(8), 15_000)
    one.feed(IMU + IMU + IMU, 16_000)
    times = [reading.t_us for reading in one.readings]
    assert times == sorted(set(times))
    assert times[:2] == [13_000, 15_500]


def test_a_lost_answer_dates_no_later_one():
    one = fit()
    for k in range(1, 4):
        one.tick(np.zeros(8), 5_000 * k)
        one.feed(IMU if k > 1 else IMU[:-1] + b"?", 5_000 * k + 1_000)
    assert [reading.t_us for reading in one.readings] == [10_500, 15_500]


def test_nothing_more_is_sent_to_one_that_owes_answers_until_they_must_be_lost():
    one = fit()
    sent = [one.tick(np.full(8, 1.0), 5_000 * k) for k in range(40)]
    told = [k for k, frames in enumerate(sent) if frames]
    assert told[:4] == [0, 1, 2, 3]
    assert told[4] * 5_000 > 100_000
    assert len(told) < 10
    assert motors_of(one.off()) == 8 * [1000]


@pytest.mark.parametrize("command", [msp.RAW_IMU, msp.MOTOR_CONFIG, msp.STATUS, msp.BATTERY_STATE])
def test_an_answer_that_is_too_short_says_nothing(command):
    one = fit()
    one.feed(answer_of(command, b"\x01"), 0)
    assert one.unfit == ""
    assert one.readings == []


def battery(cells, centivolts):
    state = struct.pack("<BHBHhBH", cells, 1500, 160, 0, 0, 0, centivolts)
    return answer_of(msp.BATTERY_STATE, state)


def test_the_battery_is_read_if_there_is_one():
    one = fit()
    assert one.battery_v(0) is None
    one.feed(battery(4, 1605), 0)
    assert one.battery_v(0) == pytest.approx(16.05)
    one.feed(battery(0, 0), 5_000)
    assert one.battery_v(5_000) is None


def test_a_voltage_of_a_second_ago_is_not_known_any_more():
    one = fit()
    one.feed(battery(4, 1605), 10_000)
    assert one.battery_v(1_010_000) == pytest.approx(16.05)
    assert one.battery_v(1_010_001) is None


class Rig:
    """Control's end, the robot's computer, and what a fit flight controller would answer."""

    def __init__(self) -> None:
        self.computer = RobotComputer(WIRED, 7, seeded_nonces(0), KEY)
        self.control = ControlEnd.of(AMES, KEY, 1, seeded_nonces(1))
        self.now_us, self.answers, self.samples = 0, True, 0
        self.newest: BodySample | None = None
        self.motors = 8 * [1000]

    def tick(self, thrust: float) -> list[int]:
        self.now_us += 5_000
        sent = self.computer.tick(self.now_us)
        said = (FIT if self.now_us == 5_000 else b"") + IMU
        for data in self.computer.feed(said, self.now_us) if self.answers else ():
            sample = self.control.receive(data, 1e-6 * self.now_us)
            self.newest = sample or self.newest
            self.samples += sample is not None
        command = ThrustCommand(np.full(8, thrust), armed=thrust > 0.0)
        self.computer.receive(self.control.command(command, 1e-6 * self.now_us), PEER, self.now_us)
        self.motors = motors_of(sent) if sent else self.motors
        return self.motors

    def run(self, thrust: float, seconds: float) -> list[list[int]]:
        return [self.tick(thrust) for _ in range(round(seconds / 0.005))]


def test_the_whole_way_from_thrust_to_motors_and_back():
    rig = Rig()
    rig.run(0.0, 0.7)
    assert rig.newest is not None
    assert rig.newest.state == FollowerState.IDLE
    assert rig.run(0.75, 0.3)[-1] == 8 * [1500]
    assert rig.newest.thrusts == pytest.approx(0.75)
    assert rig.newest.a_in_b[2] == pytest.approx(9.77, abs=0.01)


def test_its_battery_reaches_control_while_it_is_told_of():
    rig = Rig()
    rig.run(0.0, 0.5)
    assert rig.control.health is None
    rig.computer.feed(battery(3, 1150), rig.now_us)
    rig.run(0.0, 0.5)
    assert rig.control.health is not None
    assert rig.control.health[0].battery_v == pytest.approx(11.5)
    rig.run(0.0, 1.5)
    assert rig.control.health[0] == RobotHealth()


def test_a_flight_controller_that_falls_silent_ends_the_flight_by_the_robots_own_ramp():
    rig = Rig()
    rig.run(0.0, 0.7)
    rig.run(0.75, 0.3)
    rig.answers = False
    before = rig.samples
    motors = np.array(rig.run(0.75, 3.5))[:, 0]
    assert rig.samples == before
    assert (np.diff(motors[20:]) <= 0).all()
    assert motors[-1] == 1000


def test_one_that_is_armed_by_its_radio_in_flight_is_stopped_at_once():
    rig = Rig()
    rig.run(0.0, 0.7)
    rig.run(0.75, 0.3)
    rig.computer.feed(status(armed=True), rig.now_us)
    assert set(map(tuple, rig.run(0.75, 0.5))) == {tuple(8 * [1000])}
    rig.computer.feed(status(armed=False), rig.now_us)
    assert set(map(tuple, rig.run(0.75, 0.5))) == {tuple(8 * [1000])}


def test_a_robot_without_one_has_no_computer_before_it():
    with pytest.raises(RobotFileError, match="who stops the motors"):
        RobotComputer(AMES, 7, seeded_nonces(0), KEY)


def wired_table(**changes):
    table = robot_table(robot_path("ames"))
    section = {"stopped_by": "a relay on the battery", "motors": list(range(1, 9))}
    table["flight_controller"] = {**section, **changes}
    return table


@pytest.mark.parametrize(
    ("has", "named"), [({"tool": "gripper"}, "tool"), ({"blinks": True}, "blinks")]
)
def test_what_a_flight_controller_does_not_do_is_refused_before_anybody_relies_on_it(has, named):
    wired = replace(WIRED, robot=replace(WIRED.robot, **has))
    with pytest.raises(RobotFileError, match=f"{named}: not allowed beside .flight_controller"):
        RobotComputer(wired, 7, seeded_nonces(0), KEY)


def test_a_robot_file_tells_how_it_is_wired():
    wiring = robot_of(wired_table(imu_axes=["y", "-x", "z"]), "f").flight_controller
    assert wiring.motors == tuple(range(1, 9))
    assert wiring.R_bi @ [1.0, 2.0, 3.0] == pytest.approx([2.0, -1.0, 3.0])
    assert np.linalg.det(wiring.R_bi) == pytest.approx(1.0)


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"motors": [1, 2]}, "8 different numbers"),
        ({"motors": [1, 1, 2, 3, 4, 5, 6, 7]}, "8 different numbers"),
        ({"imu_axes": ["x", "x", "z"]}, "each of x, y, z once"),
        ({"imu_axes": ["x", "-y", "z"]}, "right-handed"),
        ({"imu_axes": ["y", "x", "z"]}, "right-handed"),
        ({"stopped_by": ""}, "stopped_by"),
    ],
)
def test_a_wiring_that_can_not_be_is_refused_by_name(changes, words):
    with pytest.raises(RobotFileError, match=words):
        robot_of(wired_table(**changes), "f")
