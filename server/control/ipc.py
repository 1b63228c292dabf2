"""What server and control process tell each other: msgpack in unix datagrams, never blocking.

The server sends *inputs* to `control.sock`; the control process sends `ControlStatus` to
`server.sock`. Either side may die and come back: a datagram to nobody is dropped and counted.
"""

from __future__ import annotations

import contextlib
import errno
import socket
from collections.abc import Sequence
from pathlib import Path

import msgspec
import numpy as np

from pipeline.frames import R_from_wxyz, Triple
from pipeline.prediction import Prediction
from pipeline.signals import BodyImu
from server.common.runtime_parameters import RuntimeParameters
from server.control.gap_log import GapStatistics
from server.control.ipc_estimate import EstimateFields
from server.control.ipc_inputs import Input, decode, encode
from server.control.robot_health import HealthFields
from server.protocol.lead_messages import Lead

MAX_DATAGRAM = 16_384
BUFFER_BYTES = 1 << 18
"""Of a socket: some of the largest datagrams. macOS takes no datagram beyond 2 kB otherwise."""
NO_ROOM = (errno.EMSGSIZE, errno.ENOBUFS)
"""What is said where others say that it would block, or of a datagram beyond the buffer."""
"""Bytes that are read of one."""
BodyRow = tuple[float, float, float, float, float, float, float]
"""A time [s] and two vectors in b."""
OFF_UNIT = 1e-3
"""By so much the square of an attitude's quaternion is off one at most: rounding is much less."""


class ControlStatus(msgspec.Struct, tag="status", array_like=True, frozen=True):
    """The state of control at one tick, sent at 50 Hz."""

    t: float
    epoch: int
    """Of this control process; a new one starts disarmed."""
    mode: int
    reason: str
    refusals: list[str]
    pose_age: float
    operator_age: float
    phone_imu_age: float
    body_imu_age: float
    body_imu_rate_hz: float
    p_bc_in_c: Triple | None
    R_cb_wxyz: tuple[float, float, float, float] | None
    R_fc_wxyz: tuple[float, float, float, float] | None
    """Attitude of the phone."""
    R_fv_wxyz: tuple[float, float, float, float] | None
    """Attitude of the virtual camera."""
    reference_p_in_v: Triple | None
    reference_R_wxyz: tuple[float, float, float, float] | None
    """R_vr."""
    error_m: float | None
    error_rad: float | None
    u_bf_in_c: Triple | None
    """Velocity of the body seen from f."""
    sigma_p: float | None
    """Largest standard deviations of position [m] and attitude [rad]."""
    sigma_theta: float | None
    time_offset: float | None
    """Of the pictures' stamps, if the filter knows: taken at the stamp plus this [s]."""
    thrusts: list[float]
    saturated: bool
    body_samples: list[BodyRow]
    """Body IMU since the last status, for recordings: t, ω in b, specific force in b."""
    poses_fused: int
    poses_dropped: int
    inputs_dropped: int
    realtime: str
    lateness_ms: dict[str, float]
    """p50, p99, p999, max and missed of the last minute."""
    fuse_ms: float
    """Capture of the last fused picture → fused."""
    step_ms: float
    """Median CPU time of a tick."""
    knobs: RuntimeParameters | None = None
    """Of the virtual camera, as they stand."""
    guarding: float = 0.0
    """0 to 1: how much the virtual camera hurries to keep the robot in the picture."""
    estimate: EstimateFields | None = None
    until_ramp_s: float | None = None
    """In COAST and HOLD: left until control or the robot ramps down, if all goes on as it is."""
    resumes: bool = False
    """It will follow again by itself, if news come back in time."""
    gaps: dict[str, GapStatistics] = {}
    """Short silences of `phone`, `robot` and `server` (control stood still) in the last minute."""
    warnings: list[str] = []
    """What somebody who arms should know; refuses nothing."""
    lead: Lead | None = None
    """How the hand leads since the last press ..."""
    next_lead: Lead | None = None
    """... and from the next one on."""
    thrusters_weak: list[str] = []
    """Each that does not give what it is told, in words."""
    twist_in_b: tuple[float, float, float, float, float, float] | None = None
    """Told to a robot that takes a twist, which has no thrusts: v, ω in b [m/s, rad/s]."""
    attitude: tuple[float, float, float, float] | None = None
    """Told to a robot that takes it: roll, pitch [rad], yaw rate [rad/s], thrust [N]; `thrusts` are
    then what they should make of it."""
    body_twists: list[BodyRow] = []
    """What such a robot measures, of each of `body_samples`: t, v, ω in b."""
    commands: list[tuple[float, ...]] = []
    """Commanded since the last status, for recordings: each time t, then `attitude` of a robot that
    takes it, `thrusts` of one that takes these."""
    at_limit: bool = False
    """The robot is led to where it can't go, or can't be held by its thrusters."""
    gains_weak: str = ""
    """What gains of the user's own lack if the robot is not as told, in words; refuses nothing."""
    health: HealthFields | None = None
    """What the robot tells of itself."""
    tool_opening: float | None = None
    """Told to the robot's tool, 0 closed to 1 open; None: it stays as it is."""


def _has_attitudes(status: ControlStatus) -> bool:
    """Whether all attitudes it tells are some."""
    told = (status.R_cb_wxyz, status.R_fc_wxyz, status.R_fv_wxyz, status.reference_R_wxyz)
    return all(q is None or abs(sum(x * x for x in q) - 1.0) < OFF_UNIT for q in told)


def expected_of(status: ControlStatus) -> Prediction | None:
    """Where control's filter says that the robot is, for vision; None if it doesn't."""
    p, R_wxyz, u = status.p_bc_in_c, status.R_cb_wxyz, status.u_bf_in_c
    if p is None or R_wxyz is None or u is None:
        return None
    if status.sigma_p is None or status.sigma_theta is None:
        return None
    return Prediction(
        t=status.t,
        p_bc_in_c=np.array(p),
        R_cb=R_from_wxyz(R_wxyz),
        u_bf_in_c=np.array(u),
        sigma_p=status.sigma_p,
        sigma_theta=status.sigma_theta,
        time_offset=status.time_offset or 0.0,
    )


def body_imus(samples: Sequence[BodyRow], twists: Sequence[BodyRow]) -> list[BodyImu]:
    """The body's samples as control heard them, by rows of `body_samples` and `body_twists`."""
    rows, told = (np.array(some, dtype=np.float64).reshape(-1, 7) for some in (samples, twists))
    twist_at = {row[0]: row[1:] for row in told}
    return [BodyImu(float(row[0]), row[1:4], row[4:7], twist_at.get(row[0])) for row in rows]


_status_encoder = msgspec.msgpack.Encoder()
_status_decoder = msgspec.msgpack.Decoder(ControlStatus)


class Endpoint:
    """One end of the link: a bound unix datagram socket and the path of the other one."""

    def __init__(self, own: Path, other: Path) -> None:
        """Bind `own`, taking the place of a dead predecessor."""
        own.unlink(missing_ok=True)
        self._socket = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)
        self._socket.setblocking(False)
        for buffer in (socket.SO_SNDBUF, socket.SO_RCVBUF):
            self._socket.setsockopt(socket.SOL_SOCKET, buffer, BUFFER_BYTES)
        self._socket.bind(str(own))
        self._other = str(other)
        self.dropped = 0

    def fileno(self) -> int:
        """For event loops."""
        return self._socket.fileno()

    def send(self, message: Input | ControlStatus) -> bool:
        """Send, or drop and count when the other end is gone or full."""
        if isinstance(message, ControlStatus):
            datagram = _status_encoder.encode(message)
        else:
            datagram = encode(message)
        try:
            self._socket.sendto(datagram, self._other)
        except (FileNotFoundError, ConnectionRefusedError, BlockingIOError):
            self.dropped += 1
            return False
        except OSError as error:
            if error.errno not in NO_ROOM:
                raise
            self.dropped += 1
            return False
        return True

    def _datagrams(self, limit: int) -> list[bytes]:
        datagrams: list[bytes] = []
        with contextlib.suppress(BlockingIOError):
            while len(datagrams) < limit:
                datagrams.append(self._socket.recv(MAX_DATAGRAM))
        return datagrams

    def inputs(self, limit: int = 64) -> list[Input]:
        """What has arrived from the server, oldest first; what can't be believed is counted."""
        inputs: list[Input] = []
        for datagram in self._datagrams(limit):
            try:
                inputs.append(decode(datagram))
            except (ValueError, RecursionError):
                self.dropped += 1
        return inputs

    def statuses(self, limit: int = 64) -> list[ControlStatus]:
        """What has arrived from the control process, oldest first; as `inputs` counts the rest."""
        statuses: list[ControlStatus] = []
        for datagram in self._datagrams(limit):
            with contextlib.suppress(ValueError, RecursionError):
                status = _status_decoder.decode(datagram)
                if _has_attitudes(status):
                    statuses.append(status)
                    continue
            self.dropped += 1
        return statuses

    def close(self) -> None:
        """Close and unlink."""
        path = Path(self._socket.getsockname())
        self._socket.close()
        path.unlink(missing_ok=True)


def server_end(directory: Path) -> Endpoint:
    """The server's end in the runtime directory."""
    return Endpoint(directory / "server.sock", directory / "control.sock")


def control_end(directory: Path) -> Endpoint:
    """The control process's end."""
    return Endpoint(directory / "control.sock", directory / "server.sock")
