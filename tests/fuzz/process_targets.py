"""What another process of ours, or who has taken its place, sends over the unix sockets."""

import socket
import tempfile
from pathlib import Path

import msgspec
import numpy as np

from pipeline.signals import PhoneImu, RelativePose, StampOffset, TouchState, VisionMeasurement
from pipeline.vision.rays import NO_RAYS
from server.common.runtime_parameters import Tune
from server.control.ipc import MAX_DATAGRAM, ControlStatus, control_end, expected_of, server_end
from server.control.ipc_inputs import LARGEST, ReadyInput, RequestInput, encode
from server.control.robot_health import HealthFields
from server.protocol.lead_messages import Lead
from tests.fuzz.target import target
from tests.pipeline.seeing import rays_at
from tests.server.house import control_status

FOLDER = tempfile.TemporaryDirectory(prefix="lightleash-fuzz-")
CONTROL, SERVER = control_end(Path(FOLDER.name)), server_end(Path(FOLDER.name))
OTHER = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)


def input_seeds():
    pose = RelativePose(1.0, np.array((2.0, 0.0, 0.0)), np.eye(3), np.zeros((6, 6)), 0.1, 5)
    rays = rays_at(1.0, pose.p_bc_in_c, np.eye(3))
    said = (
        PhoneImu(1.0, np.array((0.1, 0.2, 0.3)), np.array((0.0, 0.0, 9.8))),
        TouchState(1.0, True, 5),
        RequestInput("arm"),
        ReadyInput(["No phone."]),
        Tune(cutoff_hz=0.5, mode="full"),
        Lead(0.5, "level"),
        VisionMeasurement(1.0, rays, pose, (0.5, 0.4), StampOffset(0.01, 0.001)),
        VisionMeasurement(1.0, NO_RAYS, None, (0.5, 0.4)),
    )
    return [encode(message) for message in said]


@target("control_input", input_seeds, max_bytes=2048)
def inputs(data: bytes) -> None:
    """One datagram is one believable input, or is counted."""
    dropped = CONTROL.dropped
    OTHER.sendto(data[:MAX_DATAGRAM], str(Path(FOLDER.name) / "control.sock"))
    heard = CONTROL.inputs()
    assert len(heard) + CONTROL.dropped - dropped == 1
    for message in heard:
        if isinstance(message, PhoneImu):
            assert abs(message.t) <= LARGEST
            assert np.abs(message.omega_m_cf_in_c).max() <= LARGEST
        elif isinstance(message, TouchState):
            assert abs(message.t) <= LARGEST
        elif isinstance(message, VisionMeasurement):
            assert np.isfinite(message.rays.tangents).all()
            assert message.rays.covariances.shape == (len(message.rays), 2, 2)
            assert message.pose is None or np.isfinite(message.pose.covariance).all()


def status_seeds():
    yield msgspec.msgpack.encode(control_status())
    low = HealthFields("low", 10.4, "The robot's battery is low.", "pressed", "It is.")
    yield msgspec.msgpack.encode(control_status(health=low))
    pose = {"p_bc_in_c": (2.0, 0.0, 0.0), "R_cb_wxyz": (1.0, 0.0, 0.0, 0.0)}
    known = {"u_bf_in_c": (0.0, 0.0, 0.0), "sigma_p": 0.01, "sigma_theta": 0.01}
    yield msgspec.msgpack.encode(control_status(**pose, **known))


@target("control_status", status_seeds, max_bytes=2048)
def statuses(data: bytes) -> None:
    """The same at the other end."""
    dropped = SERVER.dropped
    OTHER.sendto(data[:MAX_DATAGRAM], str(Path(FOLDER.name) / "server.sock"))
    heard = SERVER.statuses()
    assert len(heard) + SERVER.dropped - dropped == 1
    for status in heard:
        assert isinstance(status, ControlStatus)
        expected = expected_of(status)
        assert expected is None or np.linalg.det(expected.R_cb) > 0.99
