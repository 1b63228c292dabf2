"""A virtual phone leads franky-sim's arm by Franka's library, in virtual time: prints JSON.

    python -m tests.counterparts.franka_flight examples/franka/arm.toml

A millisecond of the arm begins when the library has answered the one before, so a busy machine
makes it take longer, and nothing else. The same flight by our own link, of the robot as its file
has it, comes first.
"""

from __future__ import annotations

import json
import select
import sys
import threading
import time

import franky_sim
import numpy as np
from franky_sim.mujoco_simulator import MujocoSimulator

from hardware.link.franka.arm_end import ArmEnd, ArmLimits
from hardware.link.franka.arm_line import ArmLine
from hardware.link.franka.franka_follower import FrankaFollower
from hardware.robot_file import COMMANDS, load_robot
from pipeline.config import TeleopConfig
from pipeline.estimation.estimators import warm_up
from pipeline.frames import wxyz_from_R
from server.simulation.virtual_time import SimulationOptions, VirtualTimeSimulation
from tests.hardware.link.flight import FollowerFlight

STEP_S, ANSWERS_S, TAKES_S = 0.001, 1.0, 0.02
"""The last two in real time: the library is waited for so long, and its thread."""
SEED, SECONDS = 1012, 20.0


class ArmBody:
    """Where the body is that the arm carries, from where it began."""

    def __init__(self, robot, mount):
        self._robot, self._mount = robot, mount
        self._p_bo_in_o = np.zeros(3)
        _, self._p_bo_in_o = self._pose()

    def _pose(self):
        pose = self._robot.kinematics(np.array(self._robot.inner_state.q))
        p_bo_in_o = pose.translation + pose.rotation @ self._mount.p_be_in_e
        return pose.rotation @ self._mount.R_be.T, p_bo_in_o - self._p_bo_in_o

    R_fb = property(lambda self: self._pose()[0])
    p_bf_in_f = property(lambda self: self._pose()[1])
    wxyz_fb = property(lambda self: np.array(wxyz_from_R(self.R_fb)))

    @property
    def speed(self):
        inner = self._robot.inner_state
        return float(np.linalg.norm(self._robot.d_kinematics(np.array(inner.q), inner.dq)[:3]))


class FrankaFlight(FollowerFlight):
    """What a flight in virtual time has in place of a simulated robot."""

    follower: FrankaFollower

    def __init__(self, robot_file, simulator, server):
        mount = robot_file.link.franka
        self.now, self.speeds = 50.0, []
        (self._robot,) = simulator.robots
        self._server, (self._end,) = server, server.robot_servers
        self.body = ArmBody(self._robot, mount)
        limits = ArmLimits.of(robot_file.robot.twist, mount)
        self.line = ArmLine(self._robot.hostname, limits, lambda: self.now, real_time=False)
        self.follower = FrankaFollower(self.line, ArmEnd(robot_file, mount, 1), lambda: self.now)

    def advance(self, dt=0.005):
        for _ in range(round(dt / STEP_S)):
            self._server.run_once(realtime=False)
            self.now += STEP_S
            self._hear_answer()
        self.speeds.append(self.body.speed)

    def _hear_answer(self):
        """While it moves each state is answered by a command."""
        if self._end.current_motion_id:
            line = self._end._FrankaServer__udp_socket
            select.select([line], [], [], ANSWERS_S)

    def close(self):
        """The arm is braked meanwhile, for which time has to pass."""
        closing = threading.Thread(target=self.follower.close)
        closing.start()
        while closing.is_alive():
            self.advance()

    def send(self, command):
        super().send(command)
        end = time.monotonic() + TAKES_S
        while not self.line._heard and time.monotonic() < end:
            time.sleep(1e-4)


def flown(robot_file, follower):
    scene = SimulationOptions(hand="filming", seed=SEED, led_noise_px=0.1, gains="phone")
    flight = VirtualTimeSimulation(robot_file, TeleopConfig(), scene, follower=follower)
    trace = flight.run(SECONDS)
    error_mm = 1e3 * np.linalg.norm(trace.error_in_f, axis=1)
    return {
        "left": trace.left,
        "tracked_s": round(0.005 * len(trace.t), 2),
        "rms_mm": round(float(np.sqrt((error_mm**2).mean())), 2),
        "max_mm": round(float(error_mm.max()), 2),
    }


def main(file):
    robot_file = load_robot(file, takes=COMMANDS)
    warm_up()
    ours = flown(robot_file, None)
    with MujocoSimulator() as simulator:
        simulator.add_robot()
        with franky_sim.SimulationServer(simulator) as server:
            flight = FrankaFlight(robot_file, simulator, server)
            end = time.monotonic() + ANSWERS_S
            while not flight.follower.receive() and time.monotonic() < end:  # connects
                flight.advance()
            flight.now, flight.speeds = 50.0, []
            theirs = flown(robot_file, flight)
            theirs["max_speed_m_s"] = round(max(flight.speeds), 4)
            theirs["lost"] = flight.follower.lost
            flight.close()
    print(json.dumps({"our link": ours, "Franka's library": theirs}))


if __name__ == "__main__":
    main(*sys.argv[1:])
