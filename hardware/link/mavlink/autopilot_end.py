"""An autopilot of MAVLink without a socket: who it is, whether it follows, what it is told.

MAVLink without its signatures has no key, so gate and watchdog stand here (`link/base_end.py`),
and the first address that says something as the system and component of the robot file is the
autopilot, until it has been silent for a second. What others say is dropped.

* With each command of control a set-point goes out, velocity and yaw rate, zero, too: PX4 takes no
  OFFBOARD without, and either autopilot stops by itself a while after the last one.
* One that takes attitude and thrust is told these instead, but nothing at all while its motors run
  and it does not follow, or may not: zero there is a fall, silence is a switch to OFFBOARD that PX4
  refuses, or the autopilot's own way down. Its attitude comes by ATTITUDE, its samples by
  HIGHRES_IMU.
* We never arm and never change its mode: that is its pilot's switch. While it is not armed, or not
  in the mode that follows, or has not said so for three seconds, it is told zero, with the reason
  for who leads; after that zero for half a second before anything else.
* How it moves it says by LOCAL_POSITION_NED and ATTITUDE, or by ODOMETRY; a robot whose file has
  [body_imu] says HIGHRES_IMU beside. Nothing of it counts without an attitude, for a set-point is
  turned by it (`axes.py`).
* If its file wants so, it is told where a phone that stands sees it (ODOMETRY), with the time of
  the picture on our clock, which it relates to its own by TIMESYNC.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from math import nan
from typing import Any

import numpy as np

from hardware.follower import BodySample, Refusal, RobotCommand, RobotHealth
from hardware.link.address import ANYBODY
from hardware.link.base_end import BaseEnd, FirstWriter, HeardImu, HeardOdometry
from hardware.link.mavlink import messages as mav
from hardware.link.mavlink.axes import (
    R_ab,
    R_na_from_rpy,
    R_na_from_wxyz,
    attitude_in_n,
    in_b,
    pose_in_n,
    told_in_h,
)
from hardware.link.mavlink.packets import MavlinkPacket, encoded, packets
from hardware.link.mavlink.pilot import Pilot
from hardware.link.mavlink.time_sync import EVERY_S, TimeSync
from hardware.link.robot_end import Peer
from hardware.robot_file import MavlinkParameters, RobotFile
from pipeline.estimation.standing_camera import StandingPose
from pipeline.frames import Array, Triple

ALIVE_EVERY_S = 1.0
"""We say HEARTBEAT, as every component does."""
ATTITUDE_LASTS_US = 100_000
"""A velocity in n that is farther from an attitude is in no axes of the body."""
US_PER_MS = 1000
US_PER_S = 1_000_000
U8, U32 = 1 << 8, 1 << 32
"""How many numbers a field has."""
BOTH_NEW = 0b11_1111
"""Of HIGHRES_IMU: three axes of the accelerometer, three of the gyroscope."""
ALIVE = (
    0,
    mav.MAV_TYPE_ONBOARD_CONTROLLER,
    mav.MAV_AUTOPILOT_INVALID,
    0,
    mav.MAV_STATE_ACTIVE,
    mav.MAVLINK_VERSION,
)
UNKNOWN_TWIST = (nan,) * 6
UNKNOWN_COVARIANCE = (nan,) * 21
HEADING_LASTS_S = 0.5
"""With an older attitude nothing is known of its heading, by which it is told where to lean."""
NOWHERE: Triple = (0.0, 0.0, 0.0)
"""What the mask of a set-point takes out."""


class AutopilotEnd:
    """Turns commands into packets, and packets into samples. Times are [s], monotonic."""

    def __init__(
        self, robot_file: RobotFile, host: str, names: MavlinkParameters, epoch: int
    ) -> None:
        """Of a robot at the address `host`, or `ANYBODY`; nothing said, nothing heard."""
        robot = robot_file.robot
        self._leans, self._takes_thrust = robot.attitude is not None, _per_newton(robot_file, names)
        self._base = BaseEnd(robot_file, epoch, R_ab.T, has_odometry=not self._leans)
        self._names, self._host = names, host
        self._autopilot = FirstWriter[Peer]()
        self._pilot, self._sync = Pilot(), TimeSync()
        self._boot_id = self._base.boot_id
        """Of the start whose clock `_sync` relates to ours."""
        self._R_na, self._omega_in_a = np.eye(3), np.zeros(3)
        self._attitude_us, self._attitude_at = -ATTITUDE_LASTS_US, -np.inf
        self._sequence = self._dropped = 0
        self._alive_at = self._asked_at = -np.inf
        self._answers: list[bytes] = []
        self.health: tuple[RobotHealth, float] | None = None
        """See `TellsHealth`."""
        self._hears: dict[int, Callable[[Any, float], BodySample | None]] = {
            mav.HEARTBEAT: self._hear_heartbeat,
            mav.SYS_STATUS: self._hear_status,
            mav.TIMESYNC: self._hear_time,
        }
        if robot.motion is None:
            self._hears[mav.HIGHRES_IMU] = self._hear_imu
        if names.twist_from == "ODOMETRY" and not self._leans:
            self._hears[mav.ODOMETRY] = self._hear_odometry
        else:
            self._hears[mav.ATTITUDE] = self._hear_angles
            self._hears[mav.ATTITUDE_QUATERNION] = self._hear_quaternion
        if names.twist_from == "LOCAL_POSITION_NED" and not self._leans:
            self._hears[mav.LOCAL_POSITION_NED] = self._hear_velocity

    @property
    def peer(self) -> Peer | None:
        """Where packets go; None: nobody has spoken yet."""
        return self._autopilot.writer

    @property
    def epoch(self) -> int:
        """Under which commands are given; a new one after the gate has gone to zero by itself."""
        return self._base.epoch

    @property
    def dropped(self) -> int:
        """Messages that were not the autopilot's, damaged, not to be believed or overtaken."""
        return self._dropped + self._base.dropped

    def zero(self) -> RobotCommand:
        """Nothing, disarmed."""
        return self._base.zero()

    def command(self, command: RobotCommand, now: float) -> list[bytes]:
        """The packets that go out with `command`.

        Raises:
            FollowerError: a command no robot may be told.
        """
        why = self._why_not(now)
        self._base.hold(why)
        told = self._base.command(command, now)
        going = [] if self._would_fall(why, now) else [self._set_point(told, now)]
        if now - self._alive_at >= ALIVE_EVERY_S:
            self._alive_at = now
            going.append(self._packet(mav.HEARTBEAT, *ALIVE))
        if now - self._asked_at >= EVERY_S:
            self._asked_at = now
            going.append(self._packet(mav.TIMESYNC, *self._sync.question(now)))
        return going

    def vision(self, seen: StandingPose) -> bytes:
        """The packet that tells where the body was seen, at the time of the picture on our clock.

        Velocity and rates are not known: no picture says them.
        """
        place, wxyz, covariance = pose_in_n(seen)
        return self._packet(
            mav.ODOMETRY,
            round(US_PER_S * seen.t),
            *place,
            *wxyz,
            *UNKNOWN_TWIST,
            *covariance,
            *UNKNOWN_COVARIANCE,
            mav.MAV_FRAME_LOCAL_FRD,
            mav.MAV_FRAME_BODY_FRD,
            seen.frame % U8,
            mav.MAV_ESTIMATOR_TYPE_VISION,
            0,
        )

    def answers(self) -> list[bytes]:
        """Packets that answer what has come since the last call: to be sent at once."""
        going, self._answers = self._answers, []
        return going

    def receive(self, data: bytes, sender: Peer, now: float) -> list[BodySample]:
        """The samples in a datagram."""
        if self._host not in (ANYBODY, sender[0]):
            self._dropped += 1
            return []
        heard = [self._hear(packet, sender, now) for packet in packets(data)]
        return [sample for sample in heard if sample is not None]

    def beat(self, now: float) -> BodySample | None:
        """A sample of a robot without [body_imu], whenever control asks; see `BaseEnd.beat`."""
        return self._base.beat(now)

    def _why_not(self, now: float) -> Refusal:
        why = self._pilot.why_not(now)
        if why == Refusal.NONE and self._leans and now - self._attitude_at > HEADING_LASTS_S:
            return Refusal.SILENT
        return why

    def _would_fall(self, why: Refusal, now: float) -> bool:
        """Whether a zero that is none of control's could be a thrust of zero in the air."""
        return self._leans and why != Refusal.NONE and not self._pilot.keeps_it_off(now)

    def _hear(self, packet: MavlinkPacket | None, sender: Peer, now: float) -> BodySample | None:
        if packet is None:
            self._dropped += 1
            return None
        ours = self._names.system, self._names.component
        if (packet.system, packet.component) != ours or packet.message not in self._hears:
            return None  # whom a router hands on, and what we don't need
        if not self._autopilot.admits(sender, now):
            self._dropped += 1
            return None
        return self._hears[packet.message](packet.values, now)

    def _hear_heartbeat(self, values: tuple[int, ...], now: float) -> None:
        custom_mode, kind, autopilot, base_mode, *_ = values
        self._pilot.hear(custom_mode, kind, autopilot, base_mode, now)

    def _hear_status(self, values: tuple[int, ...], now: float) -> None:
        milli = values[mav.SYS_VOLTAGE]
        volts = None if milli in (0, mav.UNKNOWN_MV) else 1e-3 * milli
        self.health = RobotHealth(volts), now

    def _hear_time(self, values: tuple[int, int], now: float) -> None:
        answered_ns, asked_ns = values
        if answered_ns:
            self._sync.hear(answered_ns, asked_ns, now)
        else:
            self._answers.append(self._packet(mav.TIMESYNC, *self._sync.answer(asked_ns, now)))

    def _hear_angles(self, values: tuple[float, ...], now: float) -> None:
        at_ms, roll, pitch, yaw, *omega_in_a = values
        is_one = bool(np.isfinite((roll, pitch, yaw)).all())
        R_na = R_na_from_rpy(roll, pitch, yaw) if is_one else None
        self._take_attitude(R_na, omega_in_a, US_PER_MS * int(at_ms), now)

    def _hear_quaternion(self, values: tuple[float, ...], now: float) -> None:
        at_ms, w, x, y, z, *omega_in_a = values
        self._take_attitude(R_na_from_wxyz((w, x, y, z)), omega_in_a, US_PER_MS * int(at_ms), now)

    def _take_attitude(
        self, R_na: Array | None, omega_in_a: Sequence[float], at_us: int, now: float
    ) -> bool:
        if R_na is None:
            self._dropped += 1
            return False
        self._R_na, self._omega_in_a = R_na, np.array(omega_in_a)
        self._attitude_us, self._attitude_at = at_us, now
        return True

    def _hear_velocity(self, values: tuple[float, ...], now: float) -> None:
        at_ms, _, _, _, *v_in_n = values
        at_us = US_PER_MS * int(at_ms)
        if abs(at_us - self._attitude_us) > ATTITUDE_LASTS_US:
            self._dropped += 1
        else:
            self._take_velocity(self._R_na.T @ np.array(v_in_n), at_us, now)

    def _hear_odometry(self, values: tuple[float, ...], now: float) -> None:
        at_us, R_na = int(values[0]), R_na_from_wxyz(values[mav.ODOMETRY_Q])
        frame, twist_frame = values[mav.ODOMETRY_FRAMES]
        is_in_a = twist_frame == mav.MAV_FRAME_BODY_FRD
        is_in_n = twist_frame == frame and frame in mav.FRAMES_OF_N
        if not (is_in_a or is_in_n):
            self._dropped += 1
        elif self._take_attitude(R_na, values[mav.ODOMETRY_OMEGA], at_us, now):
            v = np.array(values[mav.ODOMETRY_V])
            self._take_velocity(v if is_in_a else self._R_na.T @ v, at_us, now)

    def _take_velocity(self, v_in_a: Array, at_us: int, now: float) -> None:
        moves, at = (*in_b(v_in_a), *in_b(self._omega_in_a)), self._ours(at_us)
        self._base.hear(HeardOdometry(self.peer, moves, at_us, at), now)

    def _hear_imu(self, values: tuple[float, ...], now: float) -> BodySample | None:
        at_us, ax, ay, az, wx, wy, wz = values[:7]
        measures_both = int(values[mav.IMU_NEW]) & BOTH_NEW == BOTH_NEW
        at = self._ours(int(at_us))
        heard = HeardImu(self.peer, int(at_us), (wx, wy, wz), (ax, ay, az), measures_both, at)
        return self._base.hear(heard, now)

    def _ours(self, at_us: int) -> float | None:
        """When that was on our clock; None: no answer has come since it started."""
        if self._base.boot_id != self._boot_id:
            self._boot_id, self._sync = self._base.boot_id, TimeSync()
        return self._sync.ours(1e-6 * at_us)

    def _set_point(self, told: Array, now: float) -> bytes:
        return self._attitude(told, now) if self._leans else self._velocity(told, now)

    def _attitude(self, told: Array, now: float) -> bytes:
        _, _, yaw_rate, thrust = told.tolist()
        return self._packet(
            mav.SET_ATTITUDE_TARGET,
            round(US_PER_MS * now) % U32,
            *attitude_in_n(told[:2], self._R_na),
            0.0,
            0.0,
            -yaw_rate,
            min(1.0, self._takes_thrust * thrust),
            self._names.system,
            self._names.component,
            mav.ATTITUDE_YAW_RATE_AND_THRUST,
        )

    def _velocity(self, told_in_b: Array, now: float) -> bytes:
        v_in_h, yaw_rate = told_in_h(told_in_b, self._R_na)
        return self._packet(
            mav.SET_POSITION_TARGET_LOCAL_NED,
            round(US_PER_MS * now) % U32,
            *NOWHERE,
            *v_in_h,
            *NOWHERE,
            0.0,
            yaw_rate,
            mav.VELOCITY_AND_YAW_RATE,
            self._names.system,
            self._names.component,
            mav.MAV_FRAME_BODY_NED,
        )

    def _packet(self, message: int, *values: float) -> bytes:
        self._sequence += 1
        sender = self._names.system, self._names.own_component
        return encoded(MavlinkPacket(*sender, message, values), self._sequence)


def _per_newton(robot_file: RobotFile, names: MavlinkParameters) -> float:
    """Of an autopilot's thrust, 0 to 1 [1/N]."""
    robot = robot_file.robot
    if names.hover_thrust is not None:
        return names.hover_thrust / robot.weight_to_carry
    most = robot.A.shape[1] * robot.f_max
    return 1.0 / most if most > 0.0 else 0.0
