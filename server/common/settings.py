"""Settings of `lightleash serve`: defaults < TOML file < environment < command line."""

from __future__ import annotations

import hmac
import inspect
import os
import tomllib
from base64 import b64encode
from collections.abc import Iterator, Sequence
from difflib import get_close_matches
from pathlib import Path
from typing import Annotated, Any

from pydantic import (
    AfterValidator,
    BaseModel,
    ConfigDict,
    Field,
    SecretStr,
    ValidationError,
)
from pydantic_core import ErrorDetails
from pydantic_settings import (
    BaseSettings,
    PydanticBaseSettingsSource,
    SettingsConfigDict,
)

from pipeline.config import EstimatorName, VirtualCameraMode
from server.common.roles import Confirm
from server.common.runtime import own_directory, server_name
from server.common.runtime_parameters import (
    DEFAULT_KNOBS,
    FASTEST_HZ,
    FASTEST_M_S,
    MOST_ADAPTIVE,
    SLOWEST_HZ,
    RuntimeParameters,
)

PREFIX = "LIGHTLEASH_"
MOST_GIB = 1e6
"""More than any disk has."""


def state_directory() -> Path:
    """Where certificates, keys and recordings live; all of a user's servers share it."""
    base = os.environ.get("XDG_STATE_HOME")
    return (Path(base) if base else Path.home() / ".local" / "state") / "lightleash"


class VideoSettings(BaseModel):
    """The picture a phone is asked for."""

    model_config = ConfigDict(extra="forbid")

    width: int = Field(default=1280, ge=320, le=1920)
    height: int = Field(default=720, ge=240, le=1080)
    frame_rate_hz: int = Field(default=30, ge=5, le=60)
    bitrate_bps: int = Field(default=3_000_000, ge=500_000, le=20_000_000)


class PairingSettings(BaseModel):
    """How people are let in."""

    model_config = ConfigDict(extra="forbid")

    confirm: Confirm = Field(
        default="supervisor",
        description="who confirms an operator: a supervisor, or the link is enough",
    )


class RecordingSettings(BaseModel):
    """What recordings may take of the disk."""

    model_config = ConfigDict(extra="forbid")

    budget_gib: float = Field(
        default=0.0,
        ge=0.0,
        le=MOST_GIB,
        allow_inf_nan=False,
        description="of all; the oldest go for new ones, but none that is write-protected; 0: no "
        "bound, none goes",
    )
    reserve_gib: float = Field(
        default=0.25,
        ge=0.25,
        le=MOST_GIB,
        allow_inf_nan=False,
        description="left free; with a budget the oldest go for that, too, else recording ends",
    )


GAINS = "phone"
"""The gain set that is taken unless another is named."""
TURN_LIVES_S = 12 * 3600.0
"""A relay asks for the credential again while it relays: longer than anybody flies."""
TURN_URL = r"^(turns?:[^\s?:]{1,200}(:\d{1,5})?(\?transport=(udp|tcp))?)?$"
"""With a name or an IPv4 address: aiortc reads no IPv6 address here, nor a port of letters."""


class RtcSettings(BaseModel):
    """WebRTC, the fast path of a phone's pictures and motion."""

    model_config = ConfigDict(extra="forbid")

    enabled: bool = Field(default=True, description="offer it; without it, websockets alone")
    turn_url: str = Field(
        default="", pattern=TURN_URL, description="of a relay, as in turn:relay.example.org:3478"
    )
    turn_username: str = Field(default="", max_length=200, description="at the relay")
    turn_password: SecretStr = Field(
        default=SecretStr(""), max_length=200, description="at the relay"
    )
    turn_secret: SecretStr = Field(
        default=SecretStr(""),
        max_length=200,
        description="shared with the relay (coturn: static-auth-secret), in place of a password",
    )
    relay_only: bool = Field(
        default=False, description="to try a relay: connect through it, never past it"
    )

    def ice_servers(self, unix_s: float) -> list[dict[str, str]]:
        """ICE servers for both ends; none by default: both meet on their own addresses.

        With a shared secret the credential ends `TURN_LIVES_S` after `unix_s` (draft-uberti-behave-
        turn-rest-00, section 2.2), so that what a phone was told is soon worth nothing.
        """
        if not self.turn_url:
            return []
        user, word = self.turn_username, self.turn_password.get_secret_value()
        if secret := self.turn_secret.get_secret_value():
            user = f"{round(unix_s + TURN_LIVES_S)}:{user or 'lightleash'}"
            word = b64encode(hmac.digest(secret.encode(), user.encode(), "sha1")).decode()
        return [{"urls": self.turn_url, "username": user, "credential": word}]


class VirtualCameraSettings(BaseModel):
    """How much of the hand's turns reaches the robot; a supervisor may change it in flight."""

    model_config = ConfigDict(extra="forbid")

    cutoff_hz: float = Field(
        default=DEFAULT_KNOBS.cutoff_hz,
        ge=SLOWEST_HZ,
        le=FASTEST_HZ,
        allow_inf_nan=False,
        description="of the low pass",
    )
    mode: VirtualCameraMode = Field(
        default=DEFAULT_KNOBS.mode, description="selective: turns about the line of sight pass"
    )
    adaptive_beta: float = Field(
        default=DEFAULT_KNOBS.adaptive_beta,
        ge=0.0,
        le=MOST_ADAPTIVE,
        allow_inf_nan=False,
        description="rise of the cut-off with the speed of a turn",
    )
    max_speed_m_s: float = Field(
        default=DEFAULT_KNOBS.max_speed_m_s,
        ge=0.0,
        le=FASTEST_M_S,
        allow_inf_nan=False,
        description="of the reference by turns; 0: no limit",
    )
    guard: bool = Field(default=DEFAULT_KNOBS.guard, description="keep the robot in the picture")

    @property
    def knobs(self) -> RuntimeParameters:
        """Runtime parameters, as control takes them."""
        return RuntimeParameters(**self.model_dump())


class SimulatedSettings(BaseModel):
    """What the simulated robot has beside its file."""

    model_config = ConfigDict(extra="forbid")

    battery_v: float | None = Field(
        default=None, gt=0.0, le=1000.0, description="a battery of so many volts, which it tells"
    )
    drain_v_min: float = Field(
        default=0.0, ge=0.0, le=1000.0, description="how much that falls in a minute"
    )
    e_stop: bool = Field(
        default=False, description="an emergency stop: SIGUSR1 presses, SIGUSR2 releases it"
    )


class Settings(BaseSettings):
    """Start server, control and simulated robot.

    Each option may also stand in a TOML file, named with --config FILE (--https-port is https_port
    there, --video.width is width in [video]), or in the environment (LIGHTLEASH_HTTPS_PORT,
    LIGHTLEASH_VIDEO__WIDTH). The command line beats the environment, that beats the file.
    """

    model_config = SettingsConfigDict(
        extra="forbid",
        env_prefix=PREFIX,
        env_nested_delimiter="__",
        cli_kebab_case=True,
        cli_prog_name="lightleash serve",
        cli_hide_none_type=True,
        cli_avoid_json=True,
        cli_implicit_flags=True,
    )

    name: Annotated[str, AfterValidator(server_name)] = Field(
        "", description="of this server, where several run on one machine"
    )
    robot: str = Field("ames", description="name or path of a robot file")
    gains: str = Field(GAINS, description="a gain set of the robot file")
    estimator: EstimatorName = Field(
        "relative", description="of the robot's pose; paper and none are for comparison"
    )
    host: str = Field("0.0.0.0", description="address of the HTTPS listener")
    https_port: int = Field(8443, ge=0, le=65535, description="for phones; 0: any free one")
    http_port: int = Field(8080, ge=0, le=65535, description="this machine only; 0: any free one")
    names: list[str] = Field([], description="further host names this server is reached by")
    cert: Path | None = Field(None, description="certificate of your own (PEM)")
    key: Path | None = Field(None, description="its key (PEM)")
    simulate: bool = Field(True, description="a simulated robot; without it, the real one")
    robot_host: str | None = Field(None, description="of the real one; default: the robot file's")
    robot_port: int | None = Field(None, ge=1, le=65535, description="of the real one")
    record: bool = Field(False, description="record from the start")
    state: Path = Field(default_factory=state_directory, description="certificates, recordings")
    cameras: list[Path] = Field([], description="folders with calibrations of phones")
    video: VideoSettings = Field(default_factory=VideoSettings)
    rtc: RtcSettings = Field(default_factory=RtcSettings)
    recording: RecordingSettings = Field(default_factory=RecordingSettings)
    pairing: PairingSettings = Field(default_factory=PairingSettings)
    virtual_camera: VirtualCameraSettings = Field(default_factory=VirtualCameraSettings)
    simulated: SimulatedSettings = Field(default_factory=SimulatedSettings)

    @property
    def own_state(self) -> Path:
        """What this server shares with no other one: its audit log and its recordings."""
        return own_directory(self.state, self.name)

    @classmethod
    def settings_customise_sources(
        cls,
        settings_cls: type[BaseSettings],  # noqa: ARG003 (pydantic gives them by name)
        init_settings: PydanticBaseSettingsSource,
        env_settings: PydanticBaseSettingsSource,
        dotenv_settings: PydanticBaseSettingsSource,  # noqa: ARG003
        file_secret_settings: PydanticBaseSettingsSource,  # noqa: ARG003
    ) -> tuple[PydanticBaseSettingsSource, ...]:
        """The command line is put before these; the file's values come in as the weakest."""
        return env_settings, init_settings


TABLES: dict[str, type[BaseModel]] = {
    "video": VideoSettings,
    "rtc": RtcSettings,
    "recording": RecordingSettings,
    "pairing": PairingSettings,
    "virtual_camera": VirtualCameraSettings,
    "simulated": SimulatedSettings,
}
Settings.__doc__ = inspect.cleandoc(Settings.__doc__ or "")  # `--help` shows it as it is


class SettingsError(ValueError):
    """Settings that can't be used; the text names each and what is allowed."""


def load(argv: Sequence[str], file: Path | None = None) -> Settings:
    """Settings from all four places.

    Raises:
        SettingsError: an unknown key, a value out of its range, or two that don't go together.
    """
    _refuse_unknown_variables()
    values: dict[str, Any] = {}
    if file is not None:
        try:
            values = tomllib.loads(file.read_text(encoding="utf-8"))
        except (OSError, UnicodeDecodeError, tomllib.TOMLDecodeError) as error:
            raise SettingsError(f"{file}: {error}") from error
    try:
        settings = Settings(_cli_parse_args=list(argv), **values)  # type: ignore[call-arg]
    except ValidationError as error:
        raise SettingsError("; ".join(map(_fault, error.errors()))) from error
    if (settings.cert is None) != (settings.key is None):
        raise SettingsError("cert, key: both or neither")
    if settings.simulate and (settings.robot_host or settings.robot_port):
        raise SettingsError("robot_host, robot_port: only with --no-simulate")
    if not settings.simulate and settings.simulated != SimulatedSettings():
        raise SettingsError("simulated: only without --no-simulate")
    return settings


def _fault(error: ErrorDetails) -> str:
    name = ".".join(map(str, error["loc"]))
    if error["type"] != "extra_forbidden":
        return f"{name}: {error['msg'].removeprefix('Value error, ')}, not {error['input']!r}"
    return _unknown(name, list(_names()))


def _names() -> Iterator[str]:
    """Names of all settings; those of a table begin with its name."""
    yield from (name for name in Settings.model_fields if name not in TABLES)
    for table, model in TABLES.items():
        yield from (f"{table}.{name}" for name in model.model_fields)


def _unknown(name: str, known: list[str]) -> str:
    close = get_close_matches(name, known, n=1)
    hint = f"did you mean {close[0]}?" if close else f"there are {', '.join(known)}"
    return f"{name}: no such setting; {hint}"


def _refuse_unknown_variables() -> None:
    """A misspelt variable must not be ignored.

    Raises:
        SettingsError: there is one.
    """
    known = [PREFIX + name.upper().replace(".", "__") for name in _names()]
    known += [PREFIX + table.upper() for table in TABLES]
    wrong = [name for name in os.environ if name.startswith(PREFIX) and name not in known]
    if wrong:
        raise SettingsError("; ".join(_unknown(name, known) for name in wrong))
