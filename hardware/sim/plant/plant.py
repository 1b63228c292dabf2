"""A robot as a rigid body in MuJoCo: thrusters with lag and delay, drag, IMU, cable or floor, wall.

World axes f: z up, origin where the robot's centre of mass is at rest with zero thrust, hanging or
standing, which is also the start: `R_fb` = I, `p_bf_in_f` = 0. An anchor is straight above.
"""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass
from math import sqrt

import mujoco
import numpy as np

from hardware.plant_parameters import BodyImuParameters, PlantParameters
from hardware.sim.plant.laser_task import Tube
from hardware.sim.plant.model import STEP_MS, mjcf
from hardware.sim.plant.obstacle import Obstacle
from hardware.sim.plant.touch import ContactForce, ContactForceSensor
from hardware.sim.plant.vibration import Shaking, Vibration
from pipeline.frames import Array, R_from_wxyz, wxyz_from_R

SETTLE_MS = 1000


@dataclass(frozen=True, slots=True)
class PlantOptions:
    """Effects of reality that are switched on."""

    imu_noise: bool = True
    imu_bias: bool = True
    imu_steps: bool = True
    """The rounding of the flight controller."""
    imu_rate_hz: float = 200.0
    """How often `imu` is asked: white noise of the density's bandwidth, half of this."""
    vibration: Vibration | None = None
    """Of propellers, felt by the body's sensors."""
    R_sb: Array | None = None
    """(3, 3) from b to the axes in which its sensors give samples; None: to those of b."""
    twist_late_s: float = 0.0
    """So much older than it says is the twist that a robot without motion sensors measures [s]."""
    obstacle: Obstacle | None = None
    """A tool on the robot and a wall before it."""
    tube: Tube | None = None
    """Stands in the world; the robot can't touch it, beams can."""


class Plant:
    """A robot. Deterministic for a seed of `rng`; nothing in it knows the time of day."""

    def __init__(
        self,
        parameters: PlantParameters,
        rng: np.random.Generator,
        options: PlantOptions | None = None,
    ) -> None:
        """Hanging or standing at rest, thrusters off."""
        self.parameters = parameters
        options = options or PlantOptions()
        scenery = options.tube.mjcf() if options.tube is not None else ""
        self._model = mujoco.MjModel.from_xml_string(mjcf(parameters, options.obstacle, scenery))
        self._model.dof_damping[:3] = parameters.air_damping
        self._model.dof_damping[3:6] = parameters.air_damping_rotation
        self._data = mujoco.MjData(self._model)
        self._imu = BodyImuErrors(parameters.imu, rng, options)
        shakes = options.vibration  # by draws of its own: all else stays as it would be
        self._R_sb = options.R_sb
        self._shaking = Shaking(shakes, rng.spawn(1)[0]) if shakes is not None else None
        self._touch = ContactForceSensor(self._model, self._data) if options.obstacle else None
        thrusters = len(parameters.thruster_torques)
        self._delay_ms = round(1e3 * parameters.delay)
        self._on_their_way: deque[tuple[int, Array]] = deque()
        self._now_ms = 0
        self._push: tuple[int, Array] = (0, np.zeros(6))
        self.external_wrench_in_f = np.zeros(6)
        """Force and torque on the centre of mass, lasting [N, N m]."""
        self.wind_in_f = np.zeros(3)
        """[m/s]; acts through the drag."""
        self.thruster_health = np.ones(thrusters)
        """What each gives of what it is told: 1 all, 0 dead."""
        if parameters.stand is not None:
            self._settle()
        self.reset()

    def _settle(self) -> None:
        """Put the floor where the robot, which sinks into it a little, comes to rest at z = 0."""
        mujoco.mj_step(self._model, self._data, SETTLE_MS)
        self._model.geom("floor").pos[2] -= self._data.qpos[2]

    def reset(self, p_bf_in_f: Array | None = None, R_fb: Array | None = None) -> None:
        """Put the robot at rest anywhere (default: the start) with thrusters off.

        Sensor biases and faults stay.
        """
        mujoco.mj_resetData(self._model, self._data)
        if p_bf_in_f is not None:
            self._data.qpos[:3] = p_bf_in_f
        if R_fb is not None:
            self._data.qpos[3:7] = wxyz_from_R(R_fb)
        self._on_their_way.clear()
        self._now_ms = 0
        self._push = (0, np.zeros(6))
        mujoco.mj_forward(self._model, self._data)

    def step(self, thrust_commands: Array, dt: float = 0.005) -> None:
        """Go on by `dt` [s], whole milliseconds, with new commands (m,) [N].

        Each is clipped to [0, f_max] and arrives after the delay.
        """
        commands = np.clip(thrust_commands, 0.0, self.parameters.f_max)
        self._on_their_way.append((self._now_ms + self._delay_ms, commands))
        if self._touch is not None:
            self._touch.start()
        for _ in range(round(1e3 * dt / STEP_MS)):
            while self._on_their_way and self._on_their_way[0][0] <= self._now_ms:
                self._data.ctrl[:] = self._on_their_way.popleft()[1] * self.thruster_health
            self._apply_surroundings(self._data, self._now_ms)
            mujoco.mj_step(self._model, self._data)
            self._now_ms += STEP_MS
            if self._touch is not None:
                self._touch.sample()
        mujoco.mj_forward(self._model, self._data)

    def _apply_surroundings(self, data: mujoco.MjData, now_ms: int) -> None:
        """Pushes and wind; and a slack cable doesn't damp, though MuJoCo's would."""
        wrench = data.xfrc_applied[1]
        wrench[:] = self.external_wrench_in_f
        wrench[:3] += self.parameters.air_damping * self.wind_in_f
        if now_ms < self._push[0]:
            wrench += self._push[1]
        suspension = self.parameters.suspension
        if suspension is not None:
            slack = float(data.ten_length[0]) <= suspension.rest_length(self.parameters.mass)
            damps = self.cable_whole and not slack
            self._model.tendon_damping[0] = suspension.damping if damps else 0.0

    def push(self, wrench_in_f: Array, duration: float) -> None:
        """Force and torque (6,) [N, N m] on the centre of mass for `duration` [s] from now."""
        self._push = (self._now_ms + round(1e3 * duration), wrench_in_f.copy())

    def cut_cable(self) -> None:
        """The suspension, if there is one, breaks for good."""
        self._model.tendon_stiffness[:] = 0.0

    @property
    def cable_whole(self) -> bool:
        """False after `cut_cable`, and without one."""
        return bool((self._model.tendon_stiffness > 0.0).any())

    def ahead(self, seconds: float, every: float = 0.005) -> list[tuple[float, Array, Array]]:
        """Where it goes within `seconds`, the last commands held; the robot itself doesn't move.

        Rows (in how long [s], wxyz_fb (4,), p_bf_in_f (3,) [m]), `every` so often.
        """
        copy, waiting = mujoco.MjData(self._model), list(self._on_their_way)
        mujoco.mj_copyData(copy, self._model, self._data)
        damping = self._model.tendon_damping.copy()
        steps, poses = round(1e3 * every / STEP_MS), []
        for k in range(1, round(seconds / every) * steps + 1):
            while waiting and waiting[0][0] < self._now_ms + k * STEP_MS:
                copy.ctrl[:] = waiting.pop(0)[1] * self.thruster_health
            self._apply_surroundings(copy, self._now_ms + (k - 1) * STEP_MS)
            mujoco.mj_step(self._model, copy)
            if k % steps == 0:
                pose = np.array(copy.qpos[3:7]), np.array(copy.qpos[:3])
                poses.append((1e-3 * k * STEP_MS, *pose))
        self._model.tendon_damping[:] = damping
        return poses

    @property
    def t(self) -> float:
        """Time since the start or the last reset [s]."""
        return 1e-3 * self._now_ms

    @property
    def p_bf_in_f(self) -> Array:
        """Centre of mass (3,) [m]."""
        return np.array(self._data.qpos[:3])

    @property
    def wxyz_fb(self) -> Array:
        """Attitude as a unit quaternion (4,)."""
        return np.array(self._data.qpos[3:7])

    @property
    def R_fb(self) -> Array:
        """Attitude (3, 3)."""
        return R_from_wxyz(self._data.qpos[3:7])

    @property
    def v_bf_in_f(self) -> Array:
        """Velocity of the centre of mass (3,) [m/s]."""
        return np.array(self._data.qvel[:3])

    @property
    def omega_bf_in_b(self) -> Array:
        """Angular velocity (3,) [rad/s]."""
        return np.array(self._data.qvel[3:6])

    @property
    def a_bf_in_f(self) -> Array:
        """Acceleration of the centre of mass (3,) [m/s²]."""
        return np.array(self._data.qacc[:3])

    @property
    def alpha_bf_in_b(self) -> Array:
        """Angular acceleration (3,) [rad/s²]."""
        return np.array(self._data.qacc[3:6])

    @property
    def thrusts(self) -> Array:
        """Thrusts now (m,) [N]."""
        return np.array(self._data.act)

    @property
    def given(self) -> Array:
        """What it reports of itself: its thrusts."""
        return self.thrusts

    @property
    def cable_length(self) -> float:
        """Anchor to hook [m]; of robots that hang."""
        return float(self._data.ten_length[0])

    @property
    def stands(self) -> bool:
        """Whether it touches the floor."""
        if self.parameters.stand is None:
            return False
        floor = self._model.geom("floor").id
        return any(floor in (touch.geom1, touch.geom2) for touch in self._data.contact)

    @property
    def touched(self) -> ContactForce:
        """Contact with the obstacle in the last step; only with an obstacle.

        Raises:
            ValueError: there is none.
        """
        if self._touch is None:
            raise ValueError("plant: touched: no obstacle; allowed: with PlantOptions.obstacle")
        return self._touch.touched()

    def imu(self) -> tuple[Array, Array]:
        """What the body's sensors read: (ω (3,) [rad/s], specific force (3,) [m/s²]) in b.

        Each call draws new noise.
        """
        omega, a = self._data.sensordata[:3], self._data.sensordata[3:6]
        if self._shaking is not None:
            by_rate, by_force = self._shaking.added(self.t, self.thrusts)
            omega, a = omega + by_rate, a + by_force
        if self._R_sb is not None:
            omega, a = self._R_sb @ omega, self._R_sb @ a
        return self._imu.read(omega, a)


class BodyImuErrors:
    """Errors of the body's motion sensors."""

    def __init__(
        self, parameters: BodyImuParameters, rng: np.random.Generator, options: PlantOptions
    ) -> None:
        """Biases are drawn once."""
        bandwidth = sqrt(0.5 * options.imu_rate_hz) if options.imu_noise else 0.0
        self._sigma = bandwidth * np.repeat((parameters.gyro_noise, parameters.acc_noise), 3)
        bias = rng.standard_normal(6) * np.repeat((parameters.gyro_bias, parameters.acc_bias), 3)
        self._bias = bias if options.imu_bias else np.zeros(6)
        steps = np.repeat((parameters.gyro_step, parameters.acc_step), 3)
        self._steps = steps if options.imu_steps else np.zeros(6)
        self._rng = rng

    def read(self, omega_in_b: Array, a_in_b: Array) -> tuple[Array, Array]:
        """Readings of true values."""
        reading = np.concatenate((omega_in_b, a_in_b)) + self._bias
        reading += self._sigma * self._rng.standard_normal(6)
        rounded = self._steps > 0.0
        steps = self._steps[rounded]
        reading[rounded] = steps * np.round(reading[rounded] / steps)
        return reading[:3], reading[3:]
