"""`lightleash robot onboard` as a process, between a real link and the real firmware."""

import os
import signal
import subprocess
import sys
import threading
import time
from pathlib import Path

import numpy as np
import pytest

from hardware.follower import FollowerState, ThrustCommand
from hardware.link import udp
from hardware.link.link_key import new_key, write_key
from hardware.robot_file import load_robot, robot_path
from tests.counterparts.betaflight import MSP_PORT, Firmware, NoFirmwareError

pytestmark = pytest.mark.counterpart
AMES = load_robot("ames")
WIRING = """
[flight_controller]
stopped_by = "the test that feeds its sensors"
motors = [1, 2, 3, 4, 5, 6, 7, 8]
acc_per_g = 256.0
"""


@pytest.fixture
def firmware(tmp_path):
    try:
        running = Firmware(tmp_path)
    except NoFirmwareError as error:
        pytest.skip(str(error))
    resting = threading.Event()

    def rest() -> None:
        while not resting.is_set():
            running._rest(0.02)

    thread = threading.Thread(target=rest)
    thread.start()
    yield running
    resting.set()
    thread.join()
    running.close()


@pytest.fixture
def onboard(firmware, tmp_path):
    file, key = tmp_path / "ames.toml", new_key()
    file.write_text(robot_path("ames").read_text() + WIRING)
    write_key(tmp_path / "ames.key", key)
    command = [sys.executable, "-m", "server", "robot", "onboard", str(file)]
    command += ["--at", f"tcp:127.0.0.1:{MSP_PORT}", "--key", str(tmp_path / "ames.key")]
    process = subprocess.Popen(
        [*command, "--listen", "127.0.0.1", "--port", "0"],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        env={**os.environ, "PYTHONPATH": str(Path(__file__).parents[2])},
    )
    port = int(process.stdout.readline().removeprefix("ready port="))
    follower = udp.connect(AMES.reached("127.0.0.1", port), key, 1)
    yield process, follower
    follower.close()
    process.kill()
    process.communicate()


def fly(follower, thrust: float, seconds: float):
    command = ThrustCommand(np.full(8, thrust), armed=thrust > 0.0)
    samples, until = [], time.monotonic() + seconds
    while time.monotonic() < until:
        samples += follower.receive()
        follower.send(command)
        time.sleep(0.005)
    return samples


def motors_of(firmware) -> np.ndarray:
    firmware.motors()
    time.sleep(0.05)
    return firmware.motors()[:8]


def test_it_says_who_answers_turns_the_motors_and_ends_with_them_off(firmware, onboard):
    process, follower = onboard
    assert fly(follower, 0.0, 2.0)[-1].state == FollowerState.IDLE
    assert fly(follower, 0.75, 0.5)[-1].state == FollowerState.RUNNING
    assert motors_of(firmware) == pytest.approx(1500.0, abs=1.0)
    process.send_signal(signal.SIGTERM)
    said, _ = process.communicate(timeout=10.0)
    assert process.returncode == 0
    assert "The flight controller answers." in said
    assert motors_of(firmware) == pytest.approx(1000.0, abs=1.0)


def test_without_its_flight_controller_it_ends_and_says_so(firmware, onboard):
    process, follower = onboard
    fly(follower, 0.0, 1.0)
    firmware._process.kill()
    _, said = process.communicate(timeout=10.0)
    assert process.returncode == 1
    assert "flight controller" in said
