"""A simulated arm: the twist of its tip by inverse kinematics to servos, which carry it in MuJoCo.

Between a command and the tip's motion stand the robot's own limits and delay, a step of the inverse
kinematics 200 times a second, angles in an encoder's steps, servos that lag, give way to weight and
have a largest torque, and contact with the table. What it reports of itself comes by encoders, too.

World axes f: those of the arm's base k, from where the tip is at home.
"""

from __future__ import annotations

from collections.abc import Callable
from math import pi

import mujoco
import numpy as np
import numpy.typing as npt

from hardware.arm.arm_model import ArmError, ArmModel
from hardware.arm.inverse_kinematics import InverseKinematics
from hardware.arm.joint_setpoints import JointSetpoints
from hardware.arm.tip_odometry import TipOdometry
from hardware.plant_parameters import ArmParameters, BodyImuParameters
from hardware.sim.plant.delayed_twist import DelayedTwist
from hardware.sim.plant.model import STEP_MS
from hardware.sim.plant.moving_on import moving_on
from hardware.sim.plant.plant import BodyImuErrors, PlantOptions
from pipeline.frames import Array, wxyz_from_R
from pipeline.robot import TwistDrive

ENCODER_STEP_RAD = 2.0 * pi / 4096
"""Of angles, both told and measured."""


OfObject = Callable[[mujoco.MjModel, mujoco.MjData, int, int, Array, int], None]
"""MuJoCo's functions of one object: its kind and number, what is written, whether in its axes."""


class ArmPlant:
    """A robot. Deterministic for a seed of `rng`; nothing in it knows the time of day."""

    def __init__(
        self,
        arm: ArmParameters,
        drive: TwistDrive,
        axes: npt.NDArray[np.bool_],
        imu: BodyImuParameters,
        rng: np.random.Generator,
        options: PlantOptions | None = None,
    ) -> None:
        """At rest at home, to be led along and about `axes` (6,) of b.

        Raises:
            ArmError: its model can't be used, or mink is missing.
        """
        self.arm = ArmModel(arm)
        self._told = DelayedTwist(drive)
        self._imu = BodyImuErrors(imu, rng, options or PlantOptions())
        self._model = self.arm.model
        self._model.opt.timestep = 1e-3 * STEP_MS
        self._data = mujoco.MjData(self._model)
        self._tip = self._model.site(arm.tip).id
        self._servos = _servos(self.arm)
        self._tool = _Tool.of(self.arm, self._data) if self.arm.tool is not None else None
        self._home_in_k = self.arm.tip(arm.home)[1]
        self._stand_at_home()
        self._setpoints = JointSetpoints(InverseKinematics(self.arm, axes), arm.home)
        self._odometry = TipOdometry(self.arm, drive.lag_s, arm.home)

    def _stand_at_home(self) -> None:
        data, home = self._data, self.arm.parameters.home
        data.qpos[:] = self.arm.configuration(home)
        data.ctrl[self._servos] = home
        lagging = self._model.actuator_actadr >= 0
        data.act[self._model.actuator_actadr[lagging]] = data.ctrl[lagging]
        mujoco.mj_forward(self._model, data)

    def step(self, twist_in_b: Array, dt: float = 0.005) -> None:
        """Go on by `dt` [s], whole milliseconds, with a new command (6,) [m/s, rad/s]."""
        steps = round(1e3 * dt / STEP_MS)
        self._told.tell(twist_in_b)
        allowed_in_b = self._told.step(steps * STEP_MS)
        told = self._setpoints.follow(allowed_in_b, self.encoders, dt)
        self._data.ctrl[self._servos] = _in_steps(told)
        mujoco.mj_step(self._model, self._data, steps)
        mujoco.mj_forward(self._model, self._data)
        self._odometry.step(self._setpoints.rates, self.encoders, dt)

    def use_tool(self, wanted: float | None, dt: float = 0.005) -> None:
        """Open its tool towards `wanted`, 0 to 1, for `dt` [s]; None: it stays as it is."""
        if self._tool is not None:
            self._tool.use(wanted, dt)

    @property
    def opening(self) -> float:
        """How far its tool is open, 0 to 1; what it holds may keep it from closing."""
        return 0.0 if self._tool is None else self._tool.opening

    @property
    def angles(self) -> Array:
        """Of its joints (n,) [rad]."""
        return self.arm.angles(self._data.qpos)

    @property
    def encoders(self) -> Array:
        """The same as its servos tell it."""
        return _in_steps(self.angles)

    def ahead(self, seconds: float, every: float = 0.005) -> list[tuple[float, Array, Array]]:
        """Where it goes within `seconds`, told nothing more; the robot itself doesn't move.

        Its servos are told ahead of their lag: its twist changes as what it is to do does. Rows (in
        how long [s], wxyz_fb (4,), p_bf_in_f (3,) [m]), `every` so often.
        """
        future = self._told.ahead(round(seconds / every), round(1e3 * every))
        twists = [self.twist_in_b + allowed - self._told.allowed for allowed in future]
        return moving_on(self.R_fb, self.p_bf_in_f, twists, every)

    @property
    def p_bf_in_f(self) -> Array:
        """Its tip (3,) [m]."""
        place: Array = self._data.site_xpos[self._tip] - self._home_in_k
        return place

    @property
    def R_fb(self) -> Array:
        """Its attitude (3, 3)."""
        R_kb: Array = self._data.site_xmat[self._tip].reshape(3, 3).copy()
        return R_kb

    @property
    def wxyz_fb(self) -> Array:
        """The same as a unit quaternion (4,)."""
        return np.array(wxyz_from_R(self.R_fb))

    @property
    def twist_in_b(self) -> Array:
        """Its velocity and angular rate in f, in b (6,) [m/s, rad/s]."""
        turn_first = self._of_tip(mujoco.mj_objectVelocity)
        return np.concatenate((turn_first[3:], turn_first[:3]))

    @property
    def given(self) -> Array:
        """What it reports of itself: its twist (6,), by its joints."""
        return self._odometry.twist_in_b

    @property
    def thrusts(self) -> Array:
        """(0,): it has no thrusters."""
        return np.zeros(0)

    def imu(self) -> tuple[Array, Array]:
        """What sensors on it read: (ω (3,) [rad/s], specific force (3,) [m/s²]) in b."""
        mujoco.mj_rnePostConstraint(self._model, self._data)
        felt_in_b = self._of_tip(mujoco.mj_objectAcceleration)[3:]
        return self._imu.read(self.twist_in_b[3:], felt_in_b)

    def _of_tip(self, what: OfObject) -> Array:
        """MuJoCo's answer (6,) in b, what turns first."""
        answer, site = np.zeros(6), mujoco.mjtObj.mjOBJ_SITE
        what(self._model, self._data, site, self._tip, answer, 1)
        return answer


def _in_steps(angles: Array) -> Array:
    steps: Array = ENCODER_STEP_RAD * np.round(angles / ENCODER_STEP_RAD)
    return steps


class _Tool:
    """What opens and closes, by a joint of its own."""

    def __init__(self, joint: int, servo: int, stroke_s: float, data: mujoco.MjData) -> None:
        """As it is."""
        model = data.model
        self._servo, self._rate, self._data = servo, 1.0 / stroke_s, data
        self._place = int(model.jnt_qposadr[joint])
        low, high = model.jnt_range[joint]
        self._closed, self._open = float(low), float(high)
        self._told = self.opening

    @classmethod
    def of(cls, arm: ArmModel, data: mujoco.MjData) -> _Tool:
        """That of an arm which has one.

        Raises:
            ArmError: nothing moves it.
        """
        assert arm.tool is not None
        (servo,) = _servos_of(arm.model, [arm.tool])
        return cls(arm.tool, servo, arm.parameters.tool_stroke_s, data)

    @property
    def opening(self) -> float:
        """0 closed to 1 open."""
        angle = float(self._data.qpos[self._place])
        return min(max((angle - self._closed) / (self._open - self._closed), 0.0), 1.0)

    def use(self, wanted: float | None, dt: float) -> None:
        """Go towards it for `dt` [s]."""
        if wanted is not None:
            way = self._rate * dt
            self._told += min(max(wanted - self._told, -way), way)
        self._data.ctrl[self._servo] = self._closed + self._told * (self._open - self._closed)


def _servos(arm: ArmModel) -> list[int]:
    """Of each joint of an arm the servo that is told an angle.

    Raises:
        ArmError: a joint has none.
    """
    return _servos_of(arm.model, [int(arm.model.joint(name).id) for name in arm.names])


def _servos_of(model: mujoco.MjModel, joints: list[int]) -> list[int]:
    """The same of some joints of a model."""
    of_joints = model.actuator_trntype == mujoco.mjtTrn.mjTRN_JOINT
    moved = model.actuator_trnid[:, 0]
    moves = {int(moved[servo]): int(servo) for servo in np.flatnonzero(of_joints)}
    lacking = [model.joint(joint).name for joint in joints if joint not in moves]
    if lacking:
        raise ArmError("model", f"a position servo for each joint, and for {', '.join(lacking)}")
    return [moves[joint] for joint in joints]
