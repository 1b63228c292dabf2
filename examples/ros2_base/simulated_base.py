"""A base as ROS 2 drives it, without ROS: hears twists, says Imu and odometry, stops by itself.

`python simulated_base.py`, then `python lead.py` beside it. Any base of yours can stand here.
"""

import time
from pathlib import Path

from cyclonedds.domain import DomainParticipant
from cyclonedds.pub import DataWriter
from cyclonedds.qos import Policy, Qos
from cyclonedds.sub import DataReader
from cyclonedds.topic import Topic

from hardware.link.ros2 import messages as ros
from hardware.robot_file import load_robot

TOPICS = load_robot(Path(__file__).with_name("base.toml"), takes=("twist",)).link.ros2
PERIOD_S, TIMEOUT_S, LAG_S = 0.005, 0.06, 0.05
RELIABLE = Qos(Policy.Reliability.Reliable(0), Policy.History.KeepLast(10))
ZEROS, NO_TURN, UP = 36 * [0.0], ros.RosQuaternion(0.0, 0.0, 0.0, 1.0), 9.81
NOWHERE = ros.RosPoseWithCovariance(ros.RosPose(ros.RosPoint(0.0, 0.0, 0.0), NO_TURN), ZEROS)


def main() -> None:
    node = DomainParticipant(TOPICS.domain)
    commands = DataReader(node, Topic(node, f"rt{TOPICS.command}", ros.RosTwist), qos=RELIABLE)
    imu = DataWriter(node, Topic(node, f"rt{TOPICS.imu}", ros.RosImu), qos=RELIABLE)
    odometry = DataWriter(node, Topic(node, f"rt{TOPICS.odometry}", ros.RosOdometry), qos=RELIABLE)
    told, moves, heard_at, next_s = [0.0] * 3, [0.0] * 3, 0.0, time.monotonic()
    while True:
        time.sleep(max(0.0, next_s - time.monotonic()))
        next_s = max(next_s + PERIOD_S, time.monotonic())  # what it has missed it has not moved
        for twist in commands.take(10):
            if twist.sample_info.valid_data:
                told = [twist.linear.x, twist.linear.y, twist.angular.z]
                heard_at = time.monotonic()
        if time.monotonic() - heard_at > TIMEOUT_S:
            told = [0.0] * 3
        rates = [(want - has) / LAG_S for want, has in zip(told, moves, strict=True)]
        moves = [has + PERIOD_S * rate for has, rate in zip(moves, rates, strict=True)]
        (vx, vy, turn), (ax, ay, _) = moves, rates
        header = ros.RosHeader(ros.RosTime(*divmod(time.time_ns(), 10**9)), "base_link")
        v, omega = ros.RosVector3(vx, vy, 0.0), ros.RosVector3(0.0, 0.0, turn)
        twist = ros.RosTwistWithCovariance(ros.RosTwist(v, omega), ZEROS)
        odometry.write(ros.RosOdometry(header, "base_link", NOWHERE, twist))
        feels = ros.RosVector3(ax - turn * vy, ay + turn * vx, UP)
        none = [-1.0, *ZEROS[1:9]]  # it has no compass
        imu.write(ros.RosImu(header, NO_TURN, none, omega, ZEROS[:9], feels, ZEROS[:9]))


if __name__ == "__main__":
    main()
