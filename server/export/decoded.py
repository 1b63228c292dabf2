"""What a recording holds, decoded: SI, frames, and when each thing happened.

Times are seconds on the recorded server's clock; `DecodedRecording.unix_ns` has the calendar's.
A picture's is that of its capture: its stamp on the server's clock, plus what the camera file and
the estimator know of the stamp's delay.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass
from datetime import UTC, datetime
from math import hypot, sqrt

import msgspec
import numpy as np

from hardware.robot_file import RobotFile
from pipeline.camera.extrinsics import IDENTITY
from pipeline.camera.lens import Camera
from pipeline.estimator_config import RelativeConfig
from pipeline.frames import Triple
from pipeline.signals import BodyImu, Mode, PhoneImu
from server.control.ipc import BodyRow
from server.control.ipc_estimate import EstimateFields
from server.control.robot_health import HealthFields
from server.media.image_format import ImageFormat
from server.phone.ingest import ARRIVAL_S, phone_imu
from server.protocol.messages import Command, Hello, Log, LoggedEvent, decode_message
from server.protocol.people_messages import Deed
from server.protocol.wire import WireError, decode
from server.protocol.wire_records import Motion, Picture, Record, Touch
from server.recording.episodes import EpisodeNote, decode_note
from server.recording.reader import Entry, Recording, device_of
from server.recording.writer import (
    EPISODES,
    PHONE_MESSAGES,
    PHONE_RECORDS,
    SERVER_MESSAGES,
    STATUS,
    RecordingError,
)
from server.replay.dates import PhoneDates
from server.replay.setting import recorded_camera, recorded_robot

Quaternion = tuple[float, float, float, float]
"""w, x, y, z."""
TWIST_NAMES = (
    *("told_vx_m_s", "told_vy_m_s", "told_vz_m_s"),
    *("told_wx_rad_s", "told_wy_rad_s", "told_wz_rad_s"),
)
"""Of a twist told, velocity and angular rate in the body's axes."""
ATTITUDE_NAMES = "told_roll_rad", "told_pitch_rad", "told_yaw_rate_rad_s", "told_thrust_n"
_SENSELESS = msgspec.MsgspecError, UnicodeDecodeError, RecursionError
"""What is raised of JSON that is none, or of another kind."""
ALARMING = (Mode.COAST, Mode.RAMP, Mode.STOPPED)
UNTOLD_OFFSET_S = RelativeConfig().initial_offset
"""Standard deviation of a stamp's delay before the estimator has found it."""


@dataclass(frozen=True, slots=True, eq=False)
class DatedPicture:
    """An encoded picture of the phone."""

    t: float
    """When its middle row was taken [s]."""
    sigma_s: float
    """Standard deviation of that."""
    t_received: float
    sequence: int
    picture: Picture


@dataclass(frozen=True, slots=True)
class DatedTouch:
    """What the operator's finger does."""

    t: float
    held: bool
    visible: bool
    """The page was."""
    press: int


@dataclass(frozen=True, slots=True)
class LogLine:
    """Something happened."""

    t: float
    source: str
    """control, server, phone, or people."""
    text: str
    alarms: bool = False


class RecordedState(msgspec.Struct, frozen=True):
    """What control knew and did at one tick, as `ControlStatus` has it; also of older versions."""

    t: float
    mode: int
    reason: str = ""
    pose_age: float | None = None
    p_bc_in_c: Triple | None = None
    R_cb_wxyz: Quaternion | None = None
    R_fc_wxyz: Quaternion | None = None
    R_fv_wxyz: Quaternion | None = None
    reference_p_in_v: Triple | None = None
    reference_R_wxyz: Quaternion | None = None
    error_m: float | None = None
    error_rad: float | None = None
    u_bf_in_c: Triple | None = None
    sigma_p: float | None = None
    sigma_theta: float | None = None
    time_offset: float | None = None
    thrusts: list[float] = []
    saturated: bool = False
    twist_in_b: tuple[float, float, float, float, float, float] | None = None
    attitude: tuple[float, float, float, float] | None = None
    body_samples: list[BodyRow] = []
    commands: list[tuple[float, ...]] = []
    estimate: EstimateFields | None = None
    health: HealthFields | None = None
    tool_opening: float | None = None

    @property
    def battery_v(self) -> float | None:
        """As the robot tells [V]."""
        return self.health.battery_v if self.health is not None else None

    @property
    def mode_name(self) -> str:
        """As pages show it."""
        return Mode(self.mode).name if self.mode in Mode.__members__.values() else str(self.mode)

    @property
    def command(self) -> Sequence[float]:
        """What the robot was told, as `DecodedRecording.command_names` has it."""
        return self.twist_in_b or self.attitude or self.thrusts

    @property
    def time_offset_sigma(self) -> float | None:
        """Standard deviation of `time_offset` [s]."""
        return self.estimate.time_offset_sigma if self.estimate is not None else None


@dataclass(frozen=True, slots=True)
class DatedNote:
    """What somebody said of an episode."""

    t: float
    note: EpisodeNote


Happening = DatedPicture | PhoneImu | BodyImu | RecordedState | DatedTouch | LogLine
Item = Happening | DatedNote


class DecodedRecording:
    """A recording, and what must be known to read it."""

    def __init__(self, recording: Recording) -> None:
        """Find robot and phone.

        Raises:
            RecordingError: damaged, or its robot's file can't be used.
        """
        self.recording = recording
        self.robot: RobotFile = recorded_robot(recording)
        self.device = device_of(recording)
        self.zero_ns = recording.unix_zero_ns
        self._cameras: dict[ImageFormat, Camera | None] = {}

    def unix_ns(self, t: float) -> int:
        """Calendar's time at `t` [ns since 1970]; with 0 as 1970 if the record doesn't know it."""
        return max(0, round(1e9 * t) + (self.zero_ns or 0))

    @property
    def command_names(self) -> tuple[str, ...]:
        """Of each number of a state's command, with its unit."""
        robot = self.robot.robot
        if robot.twist is not None:
            return TWIST_NAMES
        if robot.attitude is not None:
            return ATTITUDE_NAMES
        return tuple(f"thrust_{k}_n" for k in range(robot.A.shape[1]))

    def utc(self, t: float) -> str:
        """The same for people, ISO 8601; empty if the record doesn't know the day."""
        if self.zero_ns is None:
            return ""
        when = datetime.fromtimestamp(1e-9 * self.unix_ns(t), UTC)
        return when.isoformat(timespec="microseconds")

    def camera(self, picture: Picture) -> Camera | None:
        """The camera that takes such pictures, if anybody knows one."""
        shape = ImageFormat.of(picture)
        if shape not in self._cameras:
            self._cameras[shape] = None
            with suppress(RecordingError):
                self._cameras[shape] = recorded_camera(self.recording, shape)
        return self._cameras[shape]

    def items(self) -> Iterator[Item]:
        """Everything, in the order of arrival.

        Raises:
            RecordingError: the file is damaged.
        """
        return _Decoding(self).items()


class _Decoding:
    """One pass through a recording."""

    def __init__(self, decoded: DecodedRecording) -> None:
        self._decoded = decoded
        self._dates = PhoneDates(decoded.recording)
        self._extrinsics = IDENTITY
        self._state: RecordedState | None = None
        self._shown: list[LoggedEvent | str] = []
        self._greet()

    def _greet(self) -> None:
        """A phone has come: it counts from the beginning."""
        self._t_motion, self._last_touch = float("-inf"), -1

    def items(self) -> Iterator[Item]:
        recording = self._decoded.recording
        topics = (PHONE_RECORDS, PHONE_MESSAGES, SERVER_MESSAGES, STATUS, EPISODES)
        for entry in recording.entries(*topics):
            match entry.topic:
                case "phone/records":
                    with suppress(WireError):  # the server refused it then, and so do we
                        record = decode(entry.data)
                        t = entry.t - self._dates.latency_s(entry.t, record)
                        yield from self._phone(record, t, entry.t)
                case "phone/messages":
                    with suppress(WireError):
                        yield from self._message(entry)
                case "server/messages":
                    yield from self._logged(entry)
                case "supervisor/episodes":
                    with suppress(*_SENSELESS):  # or one of a later version
                        yield DatedNote(entry.t, decode_note(entry.data))
                case _:
                    yield from self._control(entry)

    def _phone(self, record: Record, t: float, t_received: float) -> Iterator[Item]:
        match record.body:
            case Motion() if t > self._t_motion:
                self._t_motion = t
                yield self._extrinsics.in_camera_axes(phone_imu(record.body, t))
            case Touch() if record.sequence > self._last_touch:  # it comes by two ways
                self._last_touch = record.sequence
                yield DatedTouch(t, record.body.held, record.body.visible, record.body.press)
            case Picture():
                camera = self._decoded.camera(record.body)
                self._extrinsics = camera.extrinsics if camera is not None else IDENTITY
                offset, sigma = self._stamp_offset(record.body)
                taken = t + self._extrinsics.time_offset_s + offset
                yield DatedPicture(taken, sigma, t_received, record.sequence, record.body)

    def _stamp_offset(self, picture: Picture) -> tuple[float, float]:
        """A picture was taken at its stamp plus this [s], and how well that is known [s]."""
        bound, state = self._dates.error_s, self._state
        clock = bound / sqrt(3.0) if bound is not None and not picture.by_arrival else ARRIVAL_S
        if state is None or state.time_offset is None or state.time_offset_sigma is None:
            return 0.0, hypot(clock, UNTOLD_OFFSET_S)
        return state.time_offset, hypot(clock, state.time_offset_sigma)

    def _message(self, entry: Entry) -> Iterator[Item]:
        match decode_message(entry.data):
            case Hello(device=device):
                self._greet()
                yield LogLine(entry.t, "phone", f"{device} has come")
            case Command(what=what):
                yield LogLine(entry.t, "phone", f"wishes: {what}")
            case Log(text=text):
                yield LogLine(entry.t, "phone", text, alarms=True)

    def _logged(self, entry: Entry) -> Iterator[Item]:
        try:
            message = _to_page.decode(entry.data)
        except _SENSELESS:
            return  # of another kind or version: nothing to log
        if isinstance(message, Deed):
            words = (message.who or "server", message.what, message.why)
            yield LogLine(message.t_s, "people", " ".join(filter(None, words)))
            return
        shown, self._shown = self._shown, [*message.events, *message.messages]
        for event in reversed(self._shown):  # newest first
            if event not in shown:
                text = event if isinstance(event, str) else event.text
                yield LogLine(entry.t, "server", text)

    def _control(self, entry: Entry) -> Iterator[Item]:
        try:
            state = _state.decode(entry.data)
        except _SENSELESS as error:
            what = f"holds a status that can't be read: {error}"
            raise RecordingError(self._decoded.recording.path, what, "record anew") from error
        for t, *values in state.body_samples:
            yield BodyImu(t, np.array(values[:3]), np.array(values[3:]))
        if self._state is None or self._state.mode != state.mode:
            text, alarms = f"{state.mode_name}: {state.reason}", state.mode in ALARMING
            yield LogLine(state.t, "control", text, alarms)
        self._state = state
        yield state


class _StatusEvents(msgspec.Struct, tag="status"):
    """Of a `Status`, as far as it is a log."""

    events: list[LoggedEvent] = []
    messages: list[str] = []
    """In place of them, before they had a time."""


_state = msgspec.json.Decoder(RecordedState)
_to_page = msgspec.json.Decoder(_StatusEvents | Deed)
