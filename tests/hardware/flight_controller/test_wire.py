"""The emergency stop of a robot's own computer: an input of Linux, by its file."""

import os

import pytest

from hardware.flight_controller.process import OnboardProcess, is_open
from hardware.follower import EStop, FollowerState
from hardware.link.serial_line import SerialLine
from tests.hardware.flight_controller.test_betaflight import KEY, WIRED


@pytest.mark.parametrize(
    ("said", "opens"), [(b"1\n", False), (b"1", False), (b"0\n", True), (b"", True), (b"\n1", True)]
)
def test_the_wire_is_closed_by_a_1_alone(tmp_path, said, opens):
    wire = tmp_path / "value"
    wire.write_bytes(said)
    assert is_open(wire) == opens


def test_a_wire_that_cannot_be_read_is_open(tmp_path):
    assert is_open(tmp_path / "no such input")
    assert is_open(tmp_path)


def test_the_wire_stops_the_robots_end_before_the_next_thrust_is_told(tmp_path):
    wire, (_, port) = tmp_path / "value", os.openpty()
    wire.write_text("1\n")
    process = OnboardProcess(WIRED, KEY, SerialLine(os.ttyname(port)), ("127.0.0.1", 0), wire)
    process._tick(5_000)
    assert process.robot.end.e_stop == EStop.CLOSED
    wire.write_text("0\n")
    process._tick(10_000)
    assert process.robot.end.state == FollowerState.STOPPED_BY_WIRE
    process.server.close()
