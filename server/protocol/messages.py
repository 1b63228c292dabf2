"""The JSON messages of the protocol: one `msgspec` struct each, `type` is its tag.

Together with the records of `wire.py` they are the whole protocol.
"""

from __future__ import annotations

from typing import Annotated, Literal, get_args

import msgspec
from msgspec import Meta, inspect

from pipeline.config import EstimatorName
from server.common.runtime_parameters import RuntimeParameters, Tune
from server.protocol.calibration_messages import Calibrate, Calibration
from server.protocol.camera_messages import CameraHealth
from server.protocol.lead_messages import Lead, LeadingStatus, ToolStatus, UseTool
from server.protocol.people_messages import Deed, Person
from server.protocol.screen_messages import ClockAnswer, ClockAsk, ScreenLights, ScreenSize
from server.protocol.sight_messages import Sight
from server.protocol.video_path_messages import PathChoice
from server.protocol.wire import MAX_MESSAGE_BYTES, WireError

Text = Annotated[str, Meta(max_length=200)]
AgeMs = Annotated[int, Meta(ge=0, le=3_600_000)]
ServerMs = Annotated[int, Meta(ge=0, le=2**53)]
Side = Annotated[int, Meta(ge=16, le=4096)]
VIRTUAL_DEVICE = "lightleash-virtual-phone"
"""What a virtual phone calls itself."""


class Hello(msgspec.Struct, tag="hello", forbid_unknown_fields=True, frozen=True):
    """Page → server, first: who is there."""

    version: int
    """Protocol version of the page."""
    role: Literal["operator", "supervisor", "video", "screen"]
    """`video`: the second socket of an operator, for frames alone; `screen`: shows a
    simulated robot's LEDs."""
    device: Text = ""
    """Names the camera's calibration: what the browser or a virtual phone says of itself."""
    session: Annotated[str, Meta(max_length=64)] = ""
    """On the video socket: the session of the operator it belongs to."""
    sensors: Text = ""
    """Which interface delivers motion, for the supervisor to read."""
    video: Text = ""
    """How frames are encoded, for the supervisor to read."""


class Command(msgspec.Struct, tag="command", forbid_unknown_fields=True, frozen=True):
    """Page → server: a request of a person; the control process decides.

    `key_frame` travels server → page: the next FRAME must be decodable alone.
    """

    what: Literal["arm", "disarm", "stop", "reset", "key_frame"]
    age_ms: AgeMs = 0
    """Since the person asked, by the page's own clock."""
    server_ms: ServerMs | None = None
    """The server's clock when this was sent, as far as the page knows: `time_ms` of the `status`
    that was least late and what has passed since that came; None: it has heard none."""


class Log(msgspec.Struct, tag="log", forbid_unknown_fields=True, frozen=True):
    """Page → server: a fault on the page that a supervisor should read."""

    text: Text


class Welcome(msgspec.Struct, tag="welcome", frozen=True):
    """Server → page: the answer to hello."""

    session: str
    version: int
    robot: str
    """Name of the robot."""
    width: Side
    """Wanted picture."""
    height: Side
    frame_rate_hz: int
    bitrate_bps: int
    you: str = ""
    """Id of this page's pairing, as in `people` of a status."""
    distance_m: float = 2.0
    """From which the robot is filmed, for a lens that is focused once."""
    screen_height_m: float | None = None
    """Of the smallest screen that can show the robot; None: no screen can, it is a real one."""
    name: str = ""
    """Of this server, by which people tell it from others of its machine; "" without one."""


class Refused(msgspec.Struct, tag="refused", frozen=True):
    """Server → page: something was not taken; nothing else of the sender was lost."""

    code: str
    field: str
    allowed: str
    fatal: bool = False
    """True: the server closes the connection after this."""


class Stream(msgspec.Struct, frozen=True):
    """Health of one stream."""

    age_ms: float | None
    """Of its newest item; None before the first."""
    rate_hz: float
    dropped: int = 0
    """Superseded, too old or refused, since the start."""


class GapCount(msgspec.Struct, frozen=True):
    """Short silences of one side in the last minute."""

    count: int
    longest_ms: float


class VirtualCameraStatus(msgspec.Struct, frozen=True):
    """The virtual camera in the control process."""

    knobs: RuntimeParameters
    """As they stand."""
    lag_deg: float | None
    """Angle from the phone to the virtual camera; None before a phone is there."""
    guarding: float
    """0 to 1: how much it hurries now."""


class Estimate(msgspec.Struct, frozen=True):
    """What the estimator of the relative motion says of itself; counts are since the start.

    The standard deviation of the position is `sigma_mm` of the status.
    """

    name: EstimatorName
    complaint: str
    """Why nobody should fly on the estimate, or ""."""
    nis: float | None
    """Normalised innovation squared per degree of freedom, lately: 1 is honest, 0.5 to 2 fine."""
    age_ms: float | None
    """Of the last picture that was fused; None while nothing is known."""
    fused: int
    """Pictures the estimate rested on."""
    dropped: int
    """The other pictures."""
    late: int
    """Of these, older than the horizon."""
    leds_rejected: int
    """Single LEDs beyond their gate."""
    time_offset_ms: float | None
    """A picture was taken at its stamp plus this."""
    time_offset_sigma_ms: float | None
    """Standard deviation; None while it can't be believed."""
    sigma_deg: float | None
    """Largest standard deviation of the attitude."""
    bias_body_deg_s: list[float] | None
    """Of the body's gyroscope, in the body's axes."""
    bias_body_m_s2: list[float] | None
    """Of the body's accelerometer."""
    bias_phone_deg_s: list[float] | None
    """Of the phone's gyroscope, in the camera's axes."""
    bias_phone_m_s2: list[float] | None
    """Of the phone's accelerometer."""


class LoggedEvent(msgspec.Struct, frozen=True):
    """What people should see."""

    text: str
    unix_ms: int
    """When it happened, for the last time."""
    times: int = 1
    """How often, as far as it is remembered."""


class EpisodeStatus(msgspec.Struct, frozen=True):
    """From a press to its release."""

    press: int
    """Which, as its phone counts."""
    keep: bool
    """Nobody has discarded it."""


class Status(msgspec.Struct, tag="status", frozen=True):
    """Server → page, 10 Hz: the truth about the robot, on every screen."""

    mode: Literal["DISARMED", "ARMED", "TRACK", "COAST", "HOLD", "RAMP", "STOPPED", "LOST"]
    """LOST: the control process does not answer."""
    reason: str
    """Why the mode is what it is, in words for the person who can mend it."""
    ready: bool
    """`arm` would be granted."""
    refusals: list[str]
    """What keeps it from being granted, each in words."""
    robot: str
    operator: str
    """The device of the operator, or ""."""
    video_path: str
    """How the operator's pictures come and what dates them, in words, or ""."""
    streams: dict[str, Stream]
    """By name: operator, phone_imu, video, pose, body_imu, control."""
    latency_ms: dict[str, float]
    """By stage, in order: capture to arrival, waiting, decode, detect, …, to control, control."""
    leds: int
    """LEDs in the last picture."""
    reprojection_px: float | None
    position_mm: list[float] | None
    """Of the body relative to the camera, in the camera's axes."""
    error_mm: float | None
    """Distance from the reference, while tracking."""
    error_deg: float | None
    sigma_mm: float | None
    saturated: bool
    recording: str
    """Name of the running recording, or ""."""
    phones: int
    supervisors: int
    realtime: str
    """Class of the control loop: what holds its schedule."""
    control: dict[str, float]
    """Of the control loop: lateness p50_ms, p99_ms, p999_ms, max_ms, missed ticks, step_ms."""
    events: list[LoggedEvent] = []
    """What people should see, the newest first."""
    virtual_camera: VirtualCameraStatus | None = None
    """None before the control process has told of it."""
    estimate: Estimate | None = None
    """None before the control process has told of it."""
    camera: CameraHealth | None = None
    """Of the operator's phone; None while nobody looks through it."""
    path_choice: PathChoice | None = None
    """As the operator's page says; None: it lets nobody choose."""
    time_ms: int = 0
    """The server's clock when this was made."""
    until_ramp_ms: float | None = None
    """In COAST and HOLD: left until control or the robot ramps down, if all goes on as it is."""
    resumes: bool = False
    """In COAST and HOLD: it follows again by itself, once all is well."""
    gaps: dict[str, GapCount] = {}
    """By side: `phone` (or its link), `robot` (its link), `server` (its computer stood still)."""
    warnings: list[str] = []
    """What who arms should know, each in words; refuses nothing."""
    sensors_doubted: list[str] = []
    """What of motion sensors and LEDs is believed less than usual, each in words."""
    thrusters_weak: list[str] = []
    """Each thruster that does not give what it is told, in words; arming is refused."""
    at_limit: bool = False
    """It is led to where it can't go, or its thrusters can't hold it: it comes no farther."""
    server: dict[str, float] = {}
    """Of the server process: the longest stall of its event loop in the last minute, stall_ms, and
    while the robot was armed, armed_stall_ms: armed_stall_cpu_ms of it at work, and without a
    processor for armed_stall_waited_ms; recent_stall_ms, since the status before, so that none is
    hidden by a longer one, recent_stall_cpu_ms of it at work, recent_stall_waited_ms without a
    processor, until recent_stall_until_ms of the clock of time_ms; garbage collections while it was
    armed: processor time of the longest, gc_ms, and number of full ones, gc_full."""
    people: list[Person] = []
    """Who is paired, in the order they came."""
    leading: LeadingStatus | None = None
    """None before the control process has told of it."""
    tool: ToolStatus | None = None
    """None of a robot without."""
    takes: Literal["thrusts", "twist"] = "thrusts"
    """What the robot is told: by its thrusters, or a velocity that it follows by itself."""
    thrusts_n: list[float] = []
    """What each thruster is told ..."""
    thrust_limit_n: float = 0.0
    """... and the most that one may be."""
    told_mm_s: float | None = None
    """The speed that a robot is told that takes a twist ..."""
    told_deg_s: float | None = None
    """... and how fast to turn."""
    battery: Literal["untold", "unknown", "told", "good", "low", "empty"] = "untold"
    """The robot's: by the limits of its file; `told` without such. `unknown`: told no more."""
    battery_v: float | None = None
    """None unless it is known."""
    e_stop: Literal["untold", "unknown", "released", "pressed"] = "untold"
    """The emergency stop on the robot. `unknown`: told no more."""
    health: list[str] = []
    """What people must know of the robot's own state, each in words, the gravest first."""
    task: str = ""
    """What the next presses are for, as recordings keep it."""
    episode: EpisodeStatus | None = None
    """Of the newest press since the recording began; None without."""


FromPage = (
    Hello | Command | Tune | Lead | UseTool | PathChoice | Calibrate | Log | ScreenSize | ClockAsk
)
ToPage = (
    Welcome
    | Refused
    | Status
    | Command
    | PathChoice
    | Calibration
    | Deed
    | ClockAnswer
    | ScreenLights
    | Sight
)

CHOICES = {
    (str(kind.__struct_config__.tag), f"$.{field.encode_name}"): ", ".join(map(str, one.values))
    for kind in get_args(FromPage)
    for field in inspect.type_info(kind).fields  # type: ignore[attr-defined]
    for one in getattr(field.type, "types", (field.type,))
    if isinstance(one, inspect.LiteralType)
}
"""What is allowed of a message's field that takes some words alone: by tag and JSON path."""

_decoder = msgspec.json.Decoder(FromPage)
_to_page_decoder = msgspec.json.Decoder(ToPage)
_encoder = msgspec.json.Encoder()


def encode_message(message: FromPage | ToPage) -> str:
    """JSON text of a message."""
    return _encoder.encode(message).decode()


def decode_message(text: str | bytes) -> FromPage:
    """The message in `text`.

    Raises:
        WireError: too long, not JSON, an unknown type or field, or a value out of its range.
    """
    if len(text) > MAX_MESSAGE_BYTES:
        raise WireError("size", "message", f"at most {MAX_MESSAGE_BYTES} bytes")
    try:
        message: FromPage = _decoder.decode(text)
    except msgspec.ValidationError as error:
        reason, _, path = str(error).partition(" - at ")
        field = path.strip("`") or "message"
        raise WireError("value", field, _allowed(text, field) or reason) from error
    except (msgspec.DecodeError, UnicodeDecodeError, RecursionError) as error:
        raise WireError("type", "message", "JSON text") from error
    return message


def _allowed(text: str | bytes, field: str) -> str:
    """The words that a field takes, if it takes words alone and the rest of the text is JSON."""
    try:
        said = msgspec.json.decode(text)
    except (msgspec.DecodeError, UnicodeDecodeError, RecursionError):
        return ""
    return CHOICES.get((str(said.get("type")), field), "") if isinstance(said, dict) else ""


def decode_from_server(text: str | bytes) -> ToPage:
    """The message of a server in `text`, for clients written in Python."""
    message: ToPage = _to_page_decoder.decode(text)
    return message
