"""franky-sim's arm, at an even 1 kHz, with LEDs on its hand that a virtual phone may see.

    python -m tests.counterparts.franka_arm --robot examples/franka/arm.toml

Physics, protocol and controllers are franky-sim's. Ours is what it lacks: a clock that does not
fall behind, an arm that answers a reflex as its protocol has it (SIGUSR1, until it recovers), and
the truth. Prints `host=127.… truth_port=…`; ended by SIGTERM it prints what it did as JSON, each
millisecond: time [s, monotonic], speed of its end effector [m/s].
"""

from __future__ import annotations

import argparse
import json
import logging
import signal
import sys
import time
from collections import deque

import franky_sim
import numpy as np
from franky_sim import franka_robot_server, simulation_server
from franky_sim.franka_robot_protocol import BaseCommand, MoveStatus, RobotCommand, RobotMode
from franky_sim.mujoco_simulator import MujocoSimulator

from hardware.follower import FollowerState
from hardware.link.robot_server import arrived, be_punctual, bound
from hardware.robot_file import load_robot
from hardware.sim.truth import ahead_of, encode_truth
from pipeline.frames import wxyz_from_R

PERIOD_S = 0.001
BEHIND_S = 0.02
"""What a pause of the machine took longer is not made up for: no arm hurries."""
TRUTH_EVERY, HISTORY = 5, 50
KEPT = 120_000
"""Milliseconds that are told."""
CARTESIAN_REFLEX = 7
"""Its place among the errors of a state."""


class RecoveryCommand(franka_robot_server.AutomaticErrorRecoveryCommand):
    def handle(self, server):
        server.in_reflex = False
        super().handle(server)


class ArmServer(franka_robot_server.FrankaRobotServer):
    """With a reflex."""

    in_reflex = False

    def reflex(self):
        """Stop, tell who moves it why, and refuse until it has recovered."""
        self.in_reflex, moving = True, self.current_motion_id
        self.stop_motion(send_preemption_signal=False)
        if moving:
            BaseCommand.send_response(
                self._tcp_socket, RobotCommand.kMove, moving, MoveStatus.kReflexAborted
            )
            self.reset_current_motion_id()

    def start_motion(self, *arguments):
        if self.in_reflex:
            raise ValueError("in a reflex")
        super().start_motion(*arguments)

    @property
    def robot_state(self):
        state = super().robot_state
        if not self.in_reflex:
            return state
        errors = tuple(k == CARTESIAN_REFLEX for k in range(len(state.errors)))
        return state.replace(robot_mode=RobotMode.kReflex, errors=errors, reflex_reason=errors)


franka_robot_server.AutomaticErrorRecoveryCommand = RecoveryCommand
simulation_server.FrankaRobotServer = ArmServer


class LitArm:
    """The arm with its body b: where that is, how fast, and who asks."""

    def __init__(self, robot, mount):
        self.robot, self.mount = robot, mount
        self.truth = bound(("127.0.0.1", 0))
        self.poses, self.did = deque(maxlen=HISTORY), deque(maxlen=KEPT)

    def note(self, tick):
        now, inner = time.monotonic(), self.robot.inner_state
        q = np.array(inner.q)
        velocity = self.robot.d_kinematics(q, np.array(inner.dq))[:3]
        self.did.append((round(now, 4), round(float(np.linalg.norm(velocity)), 4)))
        if tick % TRUTH_EVERY == 0:
            pose = self.robot.kinematics(q)
            R_fb = pose.rotation @ self.mount.R_be.T
            p_bf_in_f = pose.translation + pose.rotation @ self.mount.p_be_in_e
            self.poses.append((now, np.array(wxyz_from_R(R_fb)), p_bf_in_f))
            self._answer()

    def _answer(self):
        for data, sender in arrived(self.truth):
            if ahead_of(data) is not None:
                poses = list(self.poses)
                answer = encode_truth(
                    data, poses, np.zeros(0), FollowerState.IDLE, len(poses) * (-1,)
                )
                self.truth.sendto(answer, sender)


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--robot", required=True)
    arguments = parser.parse_args()
    logging.disable(logging.ERROR)  # who leads it is killed: that is no news
    mount = load_robot(arguments.robot, takes=("twist",)).link.franka
    ended = []
    signal.signal(signal.SIGTERM, lambda *_: ended.append(1))
    with MujocoSimulator() as simulator:
        arm = LitArm(simulator.add_robot(), mount)
        with franky_sim.SimulationServer(simulator) as server:
            signal.signal(signal.SIGUSR1, lambda *_: server.robot_servers[0].reflex())
            print(f"host={arm.robot.hostname} truth_port={arm.truth.getsockname()[1]}", flush=True)
            run(server, arm, ended)
    print(json.dumps(list(arm.did)))


def run(server, arm, ended):
    be_punctual()
    due, tick = time.monotonic(), 0
    while not ended:
        server.run_once(realtime=False)
        arm.note(tick)
        due, tick = max(due + PERIOD_S, time.monotonic() - BEHIND_S), tick + 1
        time.sleep(max(0.0, due - time.monotonic()))


if __name__ == "__main__":
    sys.exit(main())
