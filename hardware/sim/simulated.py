"""A whole simulated robot without sockets and clocks: plant, watchdog, memory of where it was."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from dataclasses import replace
from typing import Protocol, runtime_checkable

import numpy as np

from hardware.follower import NOT_MEASURED, EStop, RobotHealth
from hardware.link.blink_end import NO_LED, BlinkEnd
from hardware.link.datagram import U64
from hardware.link.health_end import HealthEnd
from hardware.link.robot_end import LinkLimits, Peer, RobotEnd
from hardware.link.robot_server import TICK_US
from hardware.link.tool_end import ToolEnd
from hardware.robot_file import RobotFile
from hardware.sim.battery import DrainingBattery
from hardware.sim.plant.attitude_plant import AttitudePlant
from hardware.sim.plant.odometry import Odometry
from hardware.sim.plant.plant import Plant, PlantOptions
from hardware.sim.plant.twist_plant import TwistPlant
from pipeline.frames import Array, triple

NO_FORCE = (0.0, 0.0, 0.0)
"""Of motion sensors that there are not."""
HISTORY = 50
"""Poses remembered: 0.25 s."""


class SimulatedBody(Protocol):
    """The truth of a simulated robot, whatever it takes."""

    @property
    def p_bf_in_f(self) -> Array:
        """(3,) [m]."""

    @property
    def R_fb(self) -> Array:
        """(3, 3)."""

    @property
    def wxyz_fb(self) -> Array:
        """(4,)."""

    @property
    def thrusts(self) -> Array:
        """(m,) [N]."""

    @property
    def given(self) -> Array:
        """What the robot reports of itself: thrusts (m,) [N] or its twist (6,) in b."""

    def step(self, command: Array, dt: float = 0.005, /) -> None:
        """Go on by `dt` [s] with a command."""

    def ahead(self, seconds: float, every: float = 0.005) -> list[tuple[float, Array, Array]]:
        """Where it goes within `seconds`: rows (in how long [s], wxyz_fb, p_bf_in_f [m])."""

    def imu(self) -> tuple[Array, Array]:
        """What its motion sensors read."""


@runtime_checkable
class Gripping(Protocol):
    """A `SimulatedBody` with a tool that opens and closes."""

    def use_tool(self, wanted: float | None, dt: float = 0.005, /) -> None:
        """Open it towards `wanted`, 0 to 1, for `dt` [s]; None: it stays as it is."""

    @property
    def opening(self) -> float:
        """How far it is open."""


Nonces = Callable[[], int]


def seeded_nonces(seed: int) -> Nonces:
    """Repeatable nonces, for virtual time."""
    rng = np.random.default_rng((seed, 1))
    return lambda: int(rng.integers(1, U64, dtype=np.uint64))


class SimulatedRobot:
    """Ticks at 200 Hz of whatever clock its owner has."""

    def __init__(
        self,
        robot_file: RobotFile,
        seed: int,
        boot_id: int,
        nonces: Nonces,
        key: bytes,
        options: PlantOptions | None = None,
        battery: DrainingBattery | None = None,
    ) -> None:
        """Hanging or standing at rest, refusing thrust; without a battery it tells of none.

        Raises:
            ArmError: of an arm whose model can't be used, or for which mink is missing.
        """
        robot = robot_file.robot
        rng = np.random.default_rng(seed)
        self.body = _body_of(robot_file, rng, options)
        self.gripper = self.body if isinstance(self.body, Gripping) else None
        """The truth of its tool; None: it has none, or one that is not simulated."""
        self.end = RobotEnd(LinkLimits.of(robot_file), boot_id, key)
        self._blink = BlinkEnd(key) if robot.blinks else None
        self._tool = ToolEnd(key) if robot.tool else None
        self.battery, self._health = battery, HealthEnd(boot_id, key)
        self.e_stop = EStop.NOT_WIRED
        """Of its wire; whoever sets this presses or releases it."""
        self.history: deque[tuple[int, Array, Array]] = deque(maxlen=HISTORY)
        """(robot time [µs], wxyz_fb (4,), p_bf_in_f (3,) [m]) of the last ticks, oldest first."""
        self.dark: deque[int] = deque(maxlen=HISTORY)
        """The LED that was dark then, −1: none."""
        self._tells_motion, odometry = robot.motion is not None, robot_file.plant.odometry
        self._odometry, self._twist_late_s = None, 0.0 if options is None else options.twist_late_s
        if odometry is not None:  # encoders have a noise of their own
            noisy = robot.axes & (robot_file.plant.arm is None)
            late = replace(odometry, latency_s=odometry.latency_s + self._twist_late_s)
            self._odometry = Odometry(late, noisy, rng)
        self._nonces, self._boot_id = nonces, boot_id
        self._setpoint = self.end.setpoint(0)

    @property
    def plant(self) -> Plant:
        """The body of a robot with thrusters, and the place for disturbances."""
        assert isinstance(self.body, Plant)
        return self.body

    def receive(self, data: bytes, peer: Peer, now_us: int) -> None:
        """A datagram has come from `peer`."""
        others = (one for one in (self._blink, self._tool) if one is not None)
        if not any(other.receive(data, self.end, now_us) for other in others):
            self.end.receive(data, peer, now_us)

    def tick(self, now_us: int) -> tuple[bytes, ...]:
        """Move on to `now_us`, one tick after the last; gives the sample, and what else is due."""
        self.body.step(self._setpoint, 1e-6 * TICK_US)
        if self.e_stop != EStop.NOT_WIRED:
            self.end.wire(is_open=self.e_stop == EStop.OPEN)
        self._setpoint = self.end.setpoint(now_us)
        if self._tool is not None and self.gripper is not None:
            self.gripper.use_tool(self._tool.wanted(self.end, now_us))
        self.history.append((now_us, self.body.wxyz_fb, self.body.p_bf_in_f))
        self.dark.append(NO_LED if self._blink is None else self._blink.dark(now_us))
        sample = self._sample(now_us, self.body.given)
        volts = None if self.battery is None else self.battery.volts(1e-6 * now_us)
        return sample, *self._health.due(RobotHealth(volts, self.end.e_stop), now_us)

    def restart(self, robot_file: RobotFile, key: bytes) -> None:
        """Start anew, refusing thrust; the body goes on as it was."""
        self._boot_id += 1
        self.end = RobotEnd(LinkLimits.of(robot_file), self._boot_id, key)
        self._blink = BlinkEnd(key) if robot_file.robot.blinks else None
        self._tool = ToolEnd(key) if robot_file.robot.tool else None
        self._health = HealthEnd(self._boot_id, key)

    def shut_down(self, now_us: int) -> bytes:
        """Zero, at once; gives the last sample."""
        self.end.halt()
        self._setpoint = np.zeros_like(self._setpoint)
        return self._sample(now_us, self._setpoint)

    def _sample(self, now_us: int, given: Array) -> bytes:
        nonce = self._nonces()
        if not self._tells_motion:
            omega, a = self.body.imu()
            return self.end.sample(now_us, nonce, triple(omega), triple(a), given)
        given, age_s = self._setpoint, NOT_MEASURED
        if self._odometry is not None:
            given, age_s = self._odometry.read(now_us, self.body.given)
            age_s = max(age_s - self._twist_late_s, 0.0)
        return self.end.sample(now_us, nonce, NO_FORCE, NO_FORCE, given, age_s)


def _body_of(
    robot_file: RobotFile, rng: np.random.Generator, options: PlantOptions | None
) -> SimulatedBody:
    robot, plant = robot_file.robot, robot_file.plant
    if robot.attitude is not None:
        return AttitudePlant(plant, robot.attitude, rng, options)
    if robot.twist is None:
        return Plant(plant, rng, options)
    if plant.arm is None:
        return TwistPlant(robot.twist, plant.imu, rng, options, plant.slip)
    from hardware.sim.plant.arm_plant import ArmPlant  # needs an extra

    return ArmPlant(plant.arm, robot.twist, robot.axes, plant.imu, rng, options)
