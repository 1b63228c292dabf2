"""A robot that is led, in virtual time: hand with its sensors, pipeline, link, simulated robot."""

from __future__ import annotations

from collections import deque

import numpy as np

from hardware.robot_file import RobotFile
from hardware.sim.hand import Hand
from hardware.sim.plant.plant import Plant, PlantOptions
from hardware.sim.reference_trajectory import Pose
from hardware.sim.truth import Truth
from hardware.sim.virtual_time_follower import VirtualTimeFollower
from pipeline.config import PERIOD_S, TeleopConfig
from pipeline.frames import Array
from pipeline.signals import Mode, TouchState
from pipeline.teleop import Output
from server.control.controller import Controller
from server.control.ipc import Input, OperatorInput, PhoneImuInput, ReadyInput, RequestInput
from server.control.ipc_vision import SeenInput
from server.control.robot_clock import RobotLink
from server.simulation.leader_sensor_model import LeaderSensorModel
from server.simulation.sensors import Leader


class LeaderFollowerSimulation:
    """It arms itself as soon as it may, with the button held; `advance` moves everything."""

    def __init__(
        self,
        robot_file: RobotFile,
        config: TeleopConfig,
        leader: Leader,
        hand: Hand,
        seed: int = 0,
        options: PlantOptions | None = None,
    ) -> None:
        """Everything at rest."""
        self._sensors = LeaderSensorModel(leader, hand, robot_file.robot, config.gates, seed)
        self._follower = VirtualTimeFollower(robot_file, seed, options=options)
        self._link = RobotLink(self._follower)
        self._controller = Controller(robot_file.robot, config)
        self._poses: deque[tuple[float, Array, Array]] = deque(maxlen=120)
        self._mode = Mode.DISARMED
        self._ready = False
        self.ended = ""
        """Why tracking ended, or ""."""

    @property
    def t(self) -> float:
        """Virtual time [s]."""
        return self._follower.t

    @property
    def plant(self) -> Plant:
        """The truth."""
        return self._follower.plant

    @property
    def body(self) -> Pose:
        """Where the robot truly is."""
        return self.plant.R_fb, self.plant.p_bf_in_f

    @property
    def tracks(self) -> bool:
        """Whether it follows the hand now."""
        return self._mode is Mode.TRACK

    def push(self, wrench_in_b: Array) -> None:
        """From now on the thrusters also give this (6,) [N, N m], and control does not know."""
        self._controller.teleop.push(wrench_in_b)

    def advance(self) -> Output:
        """One control period of everything."""
        before = self.t
        self._follower.advance(PERIOD_S)
        now = self.t
        self._poses.append((now, self.plant.wxyz_fb, self.plant.p_bf_in_f))
        felt, seen = self._sensors.arrivals(before, now, self._robot_at)
        body = self._link.receive(now)
        held = self._mode in (Mode.ARMED, Mode.TRACK, Mode.COAST)
        messages: list[Input] = [PhoneImuInput.of(sample) for sample in felt]
        messages += [SeenInput.of(one) for one in seen]
        messages += [OperatorInput.of(TouchState(now, held, press=int(held))), ReadyInput([])]
        messages += [RequestInput("arm")] if self._ready else []
        command, output = self._controller.tick(
            now, messages, body, self._link.reason, self._link.gap, self._link.left_s
        )
        self._mode = output.failsafe.mode
        self._ready = self._mode is Mode.DISARMED and not output.refusals
        if self._mode in (Mode.HOLD, Mode.RAMP) and not self.ended:
            self.ended = output.failsafe.reason
        self._follower.send(command)
        offset = self._controller.teleop.estimator.health.time_offset
        self._sensors.learn(output.relative, offset, body)
        return output

    def _robot_at(self, t: float) -> tuple[Array, Array]:
        times, wxyz, p = zip(*self._poses, strict=True)
        return Truth(np.array(times), np.array(wxyz), np.array(p), np.zeros(0)).at(t)
