"""What another process of ours, or who has taken its place, sends over the unix sockets."""

import socket
import tempfile
from pathlib import Path

import msgspec
import numpy as np

from server.common.runtime_parameters import TuneInput
from server.control.ipc import (
    LARGEST,
    MAX_DATAGRAM,
    ControlStatus,
    OperatorInput,
    PhoneImuInput,
    ReadyInput,
    RequestInput,
    control_end,
    expected_of,
    server_end,
)
from server.control.ipc_vision import LedFields, PoseFields, SeenInput
from tests.fuzz.target import target
from tests.server.house import control_status

FOLDER = tempfile.TemporaryDirectory(prefix="lightleash-fuzz-")
CONTROL, SERVER = control_end(Path(FOLDER.name)), server_end(Path(FOLDER.name))
OTHER = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)


def input_seeds():
    pose = PoseFields(1.0, (2.0, 0.0, 0.0), (1.0, 0, 0, 0, 1, 0, 0, 0, 1), [0.0] * 36, 0.1, 5)
    leds = [LedFields(k, 1.0, (0.1, 0.2), (1e-6, 0.0, 0.0, 1e-6)) for k in range(3)]
    said = (
        PhoneImuInput(1.0, (0.1, 0.2, 0.3), (0.0, 0.0, 9.8)),
        OperatorInput(1.0, True, 5),
        RequestInput("arm"),
        ReadyInput(["No phone."]),
        TuneInput(cutoff_hz=0.5, mode="full"),
        SeenInput(1.0, leds, pose, (0.5, 0.4), (0.01, 0.001)),
        SeenInput(1.0, [], None, (0.5, 0.4)),
    )
    return [msgspec.msgpack.encode(message) for message in said]


@target("control_input", input_seeds, max_bytes=2048)
def inputs(data: bytes) -> None:
    """One datagram is one believable input, or is counted."""
    dropped = CONTROL.dropped
    OTHER.sendto(data[:MAX_DATAGRAM], str(Path(FOLDER.name) / "control.sock"))
    heard = CONTROL.inputs()
    assert len(heard) + CONTROL.dropped - dropped == 1
    for message in heard:
        if isinstance(message, PhoneImuInput):
            sample = message.sample()
            assert abs(sample.t) <= LARGEST
            assert np.abs(sample.omega_m_cf_in_c).max() <= LARGEST
        elif isinstance(message, OperatorInput):
            assert abs(message.operator().t) <= LARGEST
        elif isinstance(message, SeenInput):
            seen = message.seen()
            assert np.isfinite(seen.rays.tangents).all()
            assert seen.pose is None or np.isfinite(seen.pose.covariance).all()


def status_seeds():
    yield msgspec.msgpack.encode(control_status())
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
        expected_of(status)
