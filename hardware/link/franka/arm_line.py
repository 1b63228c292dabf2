"""The library of Franka's arms, franky, in a thread of its own: some of its calls wait.

The library talks to the arm once a millisecond, by a thread in C++ that needs no Python. A twist is
told as a motion that ends by itself after `HOLDS_MS`, braked within the robot file's accelerations;
the next one replaces it without a step. So an arm stands if this thread, control, or all of Python
stops; if the process dies, or its computer, the arm's own controller misses its commands. Told zero
the arm is braked, let go, and held by its own controller.

Between the threads go immutable values, and the newest wins.
"""

from __future__ import annotations

import logging
import threading
import time
from collections import deque
from collections.abc import Callable

import franky
import numpy as np

from hardware.link.franka.arm_end import ArmLimits, HeardArm, ToldArm
from hardware.link.franka.joint_rates import JointRates
from pipeline.frames import Array

_LOG = logging.getLogger(__name__)
HOLDS_MS = 60
"""As long as our own link's robot bears silence; then it brakes."""
OLD_S = 0.04
"""As old as a command may be that our own link's robot takes."""
FULL_AFTER_S = 0.005
"""Until an acceleration is reached. By Franka's own limits it takes 2 ms at most, but then the
library fails to plan a motion to one in some thousand twists, and the one that it had ends there.
"""
LISTENS_EVERY_S = 0.005
AGAIN_S = 1.0
"""Between two attempts to connect, or to recover from errors."""
ENDS_S = 1.0
"""So long the thread is waited for: the arm has been braked by then."""
READY = (franky.RobotMode.Idle, franky.RobotMode.Move)


class ArmLine:
    """Connects, connects anew, tells, listens; told and heard from another thread."""

    def __init__(
        self,
        host: str,
        limits: ArmLimits,
        clock: Callable[[], float] = time.monotonic,
        *,
        real_time: bool,
    ) -> None:
        """Begins to connect; waits for nothing. `clock` is that of who tells [s]."""
        self._host, self._limits, self._clock = host, limits, clock
        self._kernel = franky.RealtimeConfig.Enforce if real_time else franky.RealtimeConfig.Ignore
        self._told: deque[ToldArm] = deque(maxlen=1)
        self._heard: deque[HeardArm] = deque(maxlen=1)
        self._news, self._closed = threading.Event(), threading.Event()
        self._connection, self._is_connected = 0, False
        self._was_said = ""
        self._thread = threading.Thread(target=self._run, name="franka", daemon=True)
        self._thread.start()

    def heard(self) -> HeardArm | None:
        """The newest that the arm has said, once."""
        return self._heard.pop() if self._heard else None

    def tell(self, told: ToldArm) -> bool:
        """Hand that over; False: there is no arm."""
        self._told.append(told)
        self._news.set()
        return self._is_connected

    def close(self) -> None:
        """Brake, then leave the arm; may be called twice."""
        self._closed.set()
        self._thread.join(ENDS_S)

    def _run(self) -> None:
        while not self._closed.is_set():
            try:
                self._serve(_Session(self._connected(), self._limits, self._clock, self._note))
            except franky.Exception as error:
                self._note(_said(error))
            self._is_connected = False
            self._closed.wait(AGAIN_S)

    def _connected(self) -> franky.Robot:
        robot = franky.Robot(self._host, realtime_config=self._kernel)
        self._connection, self._is_connected = self._connection + 1, True
        self._note("connected")
        return robot

    def _serve(self, session: _Session) -> None:
        while not self._closed.is_set():
            self._news.wait(LISTENS_EVERY_S)
            self._news.clear()
            session.obey(self._told.pop() if self._told else None)
            if (heard := session.listen(self._connection)) is not None:
                self._heard.append(heard)
        session.leave()

    def _note(self, what: str) -> None:
        """For who reads the log: once, until something else is to be said."""
        if what != self._was_said:
            _LOG.warning("Franka arm at %s: %s", self._host, what)
        self._was_said = what


class _Session:
    """One connection."""

    def __init__(
        self,
        robot: franky.Robot,
        limits: ArmLimits,
        clock: Callable[[], float],
        note: Callable[[str], None],
    ) -> None:
        self._robot, self._clock, self._note = robot, clock, note
        _limit(robot, limits)
        self._rates = JointRates()
        self._stamp, self._is_in_reflex = -1.0, False
        self._moves = False
        """The newest motion was not to stand still."""
        self._error, self._recovered_at = "", -np.inf
        """By which a motion ended, until the arm has recovered."""

    def obey(self, told: ToldArm | None) -> None:
        """Do what is told, if it was told just now.

        Raises:
            franky.NetworkException: the arm does not answer any more.
        """
        try:
            self._robot.poll_motion()
            if told is not None and self._clock() - told.at <= OLD_S:
                self._recover() if told.recovers else self._move(told.twist_in_o)
        except franky.NetworkException:
            raise
        except franky.Exception as error:
            self._error = _said(error)
        except RuntimeError as error:  # there was no motion to this twist; the next one has its own
            self._note(_said(error))

    def listen(self, connection: int) -> HeardArm | None:
        """What the arm says; None: nothing new.

        Raises:
            franky.NetworkException: the arm does not answer any more.
        """
        state = self._robot.state
        at, stamp = self._clock(), state.time.to_sec()
        if stamp == self._stamp:
            return None
        self._stamp = stamp
        self._is_in_reflex = state.robot_mode == franky.RobotMode.Reflex
        fault = self._error or _fault(state)
        if fault:
            self._note(fault)
        rates, before_s = self._rates.at(stamp, np.array(state.q))
        jacobian = self._robot.model.body_jacobian(franky.Frame.EndEffector, state)
        return HeardArm(
            connection,
            stamp,
            at,
            np.array(state.O_T_EE.matrix[:3, :3]),
            jacobian @ rates,
            before_s,
            fault,
            is_stopped=state.robot_mode == franky.RobotMode.UserStopped,
        )

    def leave(self) -> None:
        """Brake, and wait until the arm stands."""
        self._move(np.zeros(6))
        self._robot.join_motion(ENDS_S)

    def _move(self, twist_in_o: Array) -> None:
        moves = bool(twist_in_o.any())
        if not self._error and (moves or self._moves):
            twist = franky.Twist(twist_in_o[:3], twist_in_o[3:])
            motion = franky.CartesianVelocityMotion(twist, franky.Duration(HOLDS_MS))
            self._robot.move(motion, asynchronous=True)
        self._moves = moves

    def _recover(self) -> None:
        may_be = self._error or self._is_in_reflex
        if not may_be or self._clock() - self._recovered_at < AGAIN_S:
            return
        self._recovered_at = self._clock()
        if self._robot.recover_from_errors():
            self._error = ""
            self._note("recovered")


def _limit(robot: franky.Robot, limits: ArmLimits) -> None:
    """Let the arm's own motions keep these, or its own where they are less."""
    for own, value in (
        (robot.translation_velocity_limit, limits.speed),
        (robot.translation_acceleration_limit, limits.acceleration),
        (robot.translation_jerk_limit, limits.acceleration / FULL_AFTER_S),
        (robot.rotation_velocity_limit, limits.rate),
        (robot.rotation_acceleration_limit, limits.angular_acceleration),
        (robot.rotation_jerk_limit, limits.angular_acceleration / FULL_AFTER_S),
    ):
        own.set(min(value, own.max))


def _said(error: Exception) -> str:
    """Without the states of the last milliseconds, which come in the lines below."""
    return str(error).partition("\n")[0]


def _fault(state: franky.RobotState) -> str:
    """Why an arm that says this does not move."""
    mode, errors = state.robot_mode, str(state.current_errors).strip("[]")
    if errors:
        return f"stopped by {errors}"
    return "" if mode in READY else f"mode {mode.name}"
