"""A robot that is asked for its set-point: by whoever is silent, it comes to rest and says so."""

import time
from dataclasses import replace

import numpy as np
import pytest

from hardware.follower import FollowerState, TwistCommand
from hardware.link.control_end import ControlEnd
from hardware.link.polled_robot import OLDEST_S, UNASKED_US, PolledRobot
from hardware.link.polled_server import PolledServer
from hardware.link.robot_end import SILENCE_US
from hardware.link.robot_server import TICK_US
from hardware.link.udp import UdpFollower
from hardware.robot_file import COMMANDS, RobotFileError, load_robot
from hardware.sim.simulated import seeded_nonces
from hardware.twist_schema import TOLD_ZERO_S
from tests.hardware.rigs import KEY
from tests.sources import ROOT

TIP = load_robot(str(ROOT / "deploy" / "lerobot" / "tip.toml"), takes=COMMANDS)
PEER = ("control", 0)
FORWARD = np.array([0.2, 0.0, -0.05, 0.0, 0.3, 0.0])
PERIOD_US = 33_000
"""Of who asks: 30 Hz, not a multiple of a tick."""


class Line:
    """Control at 200 Hz, the robot's end, and who asks at 30 Hz, in virtual time."""

    def __init__(self) -> None:
        tip = replace(TIP, robot=replace(TIP.robot, tool="Gripper"))
        self.robot = PolledRobot(tip, 7, seeded_nonces(0), KEY)
        self.control = ControlEnd.of(TIP, KEY, 1)
        self.now_us, self.speaks, self.asks, self.ticks = 0, True, True, True
        self.opening: float | None = None
        self.wants, self.samples, self.answers, self.sent = np.zeros(6), [], [], []

    def advance(self, seconds: float) -> None:
        for _ in range(round(1e6 * seconds / TICK_US)):
            self.now_us += TICK_US
            if self.ticks:
                self._tick()
            if self.speaks:
                command = TwistCommand(self.wants, armed=bool(self.wants.any()))
                data = self.control.command(command, 1e-6 * self.now_us)
                self.robot.receive(data, PEER, self.now_us)
                if self.opening is not None:
                    self.robot.receive(self.control.tool(self.opening), PEER, self.now_us)
            if self.asks and self.now_us % PERIOD_US < TICK_US:
                self.answers.append((self.now_us, self.robot.ask(self.now_us)))

    def _tick(self) -> None:
        for data in self.robot.tick(self.now_us):
            if self.robot.end.recipients(self.now_us):
                sample = self.control.receive(data, 1e-6 * self.now_us)
                self.samples += [] if sample is None else [sample]

    @property
    def answer(self):
        return self.answers[-1][1]


@pytest.fixture
def led():
    line = Line()
    line.advance(1.0)
    line.wants = FORWARD
    line.advance(1.0)
    return line


def test_it_answers_what_control_says_with_its_age_and_tells_control_what_it_answered(led):
    assert np.allclose(led.answer.twist_in_b, FORWARD, atol=1e-6)
    assert led.answer.enabled
    assert led.answer.age_s <= 2e-6 * TICK_US
    assert led.samples[-1].state == FollowerState.RUNNING
    assert np.allclose(led.samples[-1].twist_in_b, FORWARD, atol=1e-6)
    told = {tuple(np.float32(one.twist_in_b)) for one in led.samples}
    assert told <= {tuple(np.float32(one.twist_in_b)) for _, one in led.answers}


def test_before_anybody_spoke_it_is_at_rest_not_enabled_and_says_the_oldest_age():
    line = Line()
    line.speaks = False
    line.advance(1.0)
    assert not line.answer.twist_in_b.any()
    assert not line.answer.enabled
    assert line.answer.age_s == OLDEST_S


@pytest.mark.parametrize("silent", ["control", "its own thread"])
def test_after_a_silence_it_is_not_enabled_at_once_and_soon_zero(led, silent):
    begun_us, heard = led.now_us, len(led.answers)
    if silent == "control":
        led.speaks = False
    else:
        led.ticks = False
    led.advance(1.0)
    since = [(now_us - begun_us, one) for now_us, one in led.answers[heard:]]
    assert len(since) >= 30
    assert all(not one.enabled for after_us, one in since if after_us > SILENCE_US + TICK_US)
    still = [one for after_us, one in since if after_us > 1e6 * TOLD_ZERO_S + TICK_US]
    assert still
    assert not any(one.twist_in_b.any() for one in still)
    ages = [one.age_s for _, one in since]
    assert ages == sorted(ages)


def test_one_whom_nobody_asks_refuses_and_needs_to_be_begun_anew(led):
    led.asks = False
    led.advance(1e-6 * UNASKED_US - 0.05)
    assert led.samples[-1].state == FollowerState.RUNNING
    led.advance(0.15)
    assert led.samples[-1].state == FollowerState.REFUSING
    led.asks = True
    led.advance(1.0)  # control still means motion: it is not armed anew
    assert led.samples[-1].state == FollowerState.REFUSING
    assert not led.answer.twist_in_b.any()
    led.wants = np.zeros(6)
    led.advance(1.0)
    assert led.samples[-1].state == FollowerState.IDLE
    led.wants = FORWARD
    led.advance(0.5)
    assert led.answer.enabled


@pytest.mark.parametrize("silent", ["slider", "control", "its own thread"])
def test_its_tool_is_asked_for_by_the_slider_and_stays_in_every_silence(led, silent):
    assert led.answer.opening is None
    led.opening = 0.25
    led.advance(0.2)
    assert led.answer.opening == 0.25
    if silent == "slider":
        led.opening = None
    elif silent == "control":
        led.speaks = False
    else:
        led.ticks = False
    led.advance(0.2)
    assert led.answer.opening is None
    assert led.answer.enabled == (silent == "slider")


@pytest.mark.parametrize(("robot", "key"), [("ames", "link.takes"), ("rover", "motion.twist")])
def test_a_robot_that_it_can_not_stand_for_is_refused_by_name(robot, key):
    with pytest.raises(RobotFileError) as refused:
        PolledRobot(load_robot(robot, takes=COMMANDS), 7, seeded_nonces(0), KEY)
    assert refused.value.key == key


@pytest.mark.e2e
def test_by_udp_and_in_a_thread_of_its_own_it_follows_and_says_so_when_it_is_closed():
    server = PolledServer(TIP, KEY, ("127.0.0.1", 0))
    follower = UdpFollower("127.0.0.1", server.port, ControlEnd.of(TIP, KEY, 1))
    samples, answer = [], server.ask()
    for _ in range(4_000):
        ready = bool(samples) and samples[-1].state in (FollowerState.IDLE, FollowerState.RUNNING)
        follower.send(TwistCommand(FORWARD, armed=True) if ready else TwistCommand.zero())
        time.sleep(0.005)
        samples += follower.receive()
        answer = server.ask()
        if answer.enabled and np.allclose(answer.twist_in_b, FORWARD, atol=1e-6):
            break
    assert answer.enabled
    assert server.is_alive
    server.close()
    assert not server.is_alive
    assert (samples + follower.receive())[-1].state == FollowerState.REFUSING
    follower.close()
