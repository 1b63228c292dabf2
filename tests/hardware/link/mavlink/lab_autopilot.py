"""An autopilot as somebody else would write it: with pymavlink, from PX4's manual.

It turns a velocity of MAV_FRAME_BODY_NED by its heading, as PX4 and ArduPilot do, follows in
OFFBOARD and armed alone, and stops by its own time-out within its accelerations. As a process of
its own: `python -m tests.hardware.link.mavlink.lab_autopilot --port 14540`, in real time; prints
what it was told as JSON.
"""

from __future__ import annotations

import argparse
import json
import random
import signal
import socket
import time

import numpy as np
from pymavlink.dialects.v20 import common as mav

from hardware.robot_file import COMMANDS, load_robot
from hardware.sim.plant.twist_plant import TwistPlant

PERIOD_S = 0.005
TIMEOUT_S = 0.06
OFFBOARD, POSCTL = 6 << 16, 3 << 16
FLIP = np.diag([1.0, -1.0, -1.0])
"""North is the room's x: from what is up and left to what is down and right."""
LOCALHOST = "127.0.0.1"


class LabAutopilot:
    """Flies, feels and speaks when it is told that time has passed."""

    def __init__(self, port, body, drive, system=1, odometry=False, loss=0.0, seed=0):
        self.socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self.socket.setblocking(False)
        self.socket.bind((LOCALHOST, 0))
        self.ground = LOCALHOST, port
        self.mav = mav.MAVLink(None, srcSystem=system, srcComponent=1)
        self.mav.robust_parsing = True
        self.body, self.drive, self.odometry = body, drive, odometry
        self.custom_mode, self.armed, self.connected = OFFBOARD, True, True
        self.told, self.heard_at = np.zeros(6), -1.0
        self.ticks = 0
        self.chance, self.loss = random.Random(seed), loss
        self.heard = []
        """Each message that came, as pymavlink has read it."""
        self.taken = []
        """Each set-point: when it was taken, its twist in our axes (6,)."""
        self.round_trips, self.offsets = [], []

    def listen(self, now, stamp):
        while True:
            try:
                data = self.socket.recv(2048)
            except OSError:
                return
            if self.connected and self.chance.random() >= self.loss:
                for message in self.mav.parse_buffer(data) or []:
                    self.take(message, now, stamp)

    def take(self, message, now, stamp):
        self.heard.append(message)
        if message.get_type() == "SET_POSITION_TARGET_LOCAL_NED":
            self.take_set_point(message, now)
        elif message.get_type() == "TIMESYNC":
            self.take_time(message, stamp)

    def take_set_point(self, said, now):
        assert said.coordinate_frame == mav.MAV_FRAME_BODY_NED
        assert said.type_mask == 7 + 448 + 1024  # velocity and yaw rate alone
        assert (said.target_system, said.target_component) == (self.mav.srcSystem, 1)
        twist = np.array([said.vx, -said.vy, -said.vz, 0.0, 0.0, -said.yaw_rate])
        self.taken.append((now, twist))
        if self.custom_mode == OFFBOARD and self.armed:
            self.told, self.heard_at = twist, now

    def take_time(self, said, stamp):
        if said.tc1 == 0:
            self.send(self.mav.timesync_encode(round(1e9 * stamp), said.ts1))
        else:
            self.round_trips.append(stamp - 1e-9 * said.ts1)
            self.offsets.append(1e-9 * said.tc1 - stamp)

    def step(self, now, stamp):
        """One period, which ends at `now`; `stamp` is what its clock shows then."""
        self.listen(now, stamp)
        if now - self.heard_at > TIMEOUT_S:
            self.told = self.drive.toward(self.told, np.zeros(6), PERIOD_S)
        self.body.step(self.told, PERIOD_S)
        self.speak(stamp)

    def speak(self, stamp):
        messages = self.motion(stamp)
        if self.ticks % 20 == 0:
            messages.append(self.mav.timesync_encode(0, round(1e9 * stamp)))
        if self.ticks % 200 == 0:
            messages += [self.heartbeat(), self.status(11_900)]
        self.ticks += 1
        self.send(*messages)

    def motion(self, stamp):
        R_na = FLIP @ self.body.R_fb @ FLIP
        v_in_a, omega_in_a = FLIP @ self.body.twist_in_b[:3], FLIP @ self.body.twist_in_b[3:]
        omega, a = self.body.imu()
        imu = self.mav.highres_imu_encode(
            round(1e6 * stamp), *(FLIP @ a), *(FLIP @ omega), *7 * (0.0,), 0b111111
        )
        if self.odometry:
            return [imu, self.told_odometry(stamp, R_na, v_in_a, omega_in_a)]
        yaw = float(np.arctan2(R_na[1, 0], R_na[0, 0]))
        milli = round(1e3 * stamp)
        attitude = self.mav.attitude_encode(milli, 0.0, 0.0, yaw, *omega_in_a)
        place = self.mav.local_position_ned_encode(milli, 0.0, 0.0, 0.0, *(R_na @ v_in_a))
        return [attitude, place, imu]

    def told_odometry(self, stamp, R_na, v_in_a, omega_in_a, frame=mav.MAV_FRAME_BODY_FRD):
        yaw = float(np.arctan2(R_na[1, 0], R_na[0, 0]))
        q = [np.cos(0.5 * yaw), 0.0, 0.0, np.sin(0.5 * yaw)]
        unknown = [float("nan"), *20 * [0.0]]
        return self.mav.odometry_encode(
            round(1e6 * stamp), mav.MAV_FRAME_LOCAL_NED, frame, 0.0, 0.0, 0.0, q,
            *v_in_a, *omega_in_a, unknown, unknown,
        )  # fmt: skip

    def heartbeat(self):
        base = mav.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED
        base |= mav.MAV_MODE_FLAG_SAFETY_ARMED if self.armed else 0
        kind, stack = mav.MAV_TYPE_QUADROTOR, mav.MAV_AUTOPILOT_PX4
        return self.mav.heartbeat_encode(kind, stack, base, self.custom_mode, 4)

    def status(self, milli):
        return self.mav.sys_status_encode(0, 0, 0, 0, milli, -1, -1, 0, 0, 0, 0, 0, 0)

    def set(self, custom_mode=OFFBOARD, armed=True):
        """Its pilot's switches; it says so at once."""
        self.custom_mode, self.armed = custom_mode, armed
        self.send(self.heartbeat())

    def send(self, *messages):
        if self.connected and self.chance.random() >= self.loss:
            packed = b"".join(message.pack(self.mav) for message in messages)
            self.socket.sendto(packed, self.ground)

    def close(self):
        self.socket.close()


def twister(seed=0):
    """Body and drive of the simulated one."""
    robot = load_robot("twister", takes=COMMANDS)
    rng = np.random.default_rng(seed)
    return TwistPlant(robot.robot.twist, robot.plant.imu, rng), robot.robot.twist


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--port", type=int, required=True)
    parser.add_argument("--loss", type=float, default=0.0, help="share of datagrams, either way")
    arguments = parser.parse_args()
    autopilot = LabAutopilot(arguments.port, *twister(), loss=arguments.loss)
    ended, start, moves = [], time.monotonic(), []
    signal.signal(signal.SIGTERM, lambda *_: ended.append(1))
    while not ended:
        due = start + PERIOD_S * (len(moves) + 1)
        time.sleep(max(0.0, due - time.monotonic()))
        now = time.monotonic()
        autopilot.step(now, now - start + 100.0)
        moves.append((now, float(autopilot.body.twist_in_b[0])))
    taken = [(now, twist.tolist()) for now, twist in autopilot.taken]
    print(json.dumps({"taken": taken, "moves": moves}))
    autopilot.close()


if __name__ == "__main__":
    main()
