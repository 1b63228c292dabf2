"""Settings of `lightleash serve`: defaults < TOML file < environment < command line."""

from __future__ import annotations

import inspect
import os
import tomllib
from collections.abc import Iterator, Sequence
from difflib import get_close_matches
from pathlib import Path
from typing import Any

from pydantic import BaseModel, ConfigDict, Field, ValidationError
from pydantic_core import ErrorDetails
from pydantic_settings import (
    BaseSettings,
    PydanticBaseSettingsSource,
    SettingsConfigDict,
)

PREFIX = "LIGHTLEASH_"


def state_directory() -> Path:
    """Where certificates and recordings live."""
    base = os.environ.get("XDG_STATE_HOME")
    return (Path(base) if base else Path.home() / ".local" / "state") / "lightleash"


class VideoSettings(BaseModel):
    """The picture a phone is asked for."""

    model_config = ConfigDict(extra="forbid")

    width: int = Field(default=1280, ge=320, le=1920)
    height: int = Field(default=720, ge=240, le=1080)
    frame_rate_hz: int = Field(default=30, ge=5, le=60)
    bitrate_bps: int = Field(default=3_000_000, ge=500_000, le=20_000_000)


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

    robot: str = Field("ames", description="name or path of a robot file")
    gains: str = Field("phone", description="a gain set of the robot file")
    tau_1_s: float = Field(0.525, ge=0.0, le=60.0, description="virtual camera; 0: no filter")
    tau_2_s: float = Field(0.16, ge=0.0, le=60.0, description="virtual camera, second stage")
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

    @classmethod
    def settings_customise_sources(
        cls,
        settings_cls: type[BaseSettings],
        init_settings: PydanticBaseSettingsSource,
        env_settings: PydanticBaseSettingsSource,
        dotenv_settings: PydanticBaseSettingsSource,
        file_secret_settings: PydanticBaseSettingsSource,
    ) -> tuple[PydanticBaseSettingsSource, ...]:
        """The command line is put before these; the file's values come in as the weakest."""
        return env_settings, init_settings


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
    return settings


def _fault(error: ErrorDetails) -> str:
    name = ".".join(map(str, error["loc"]))
    if error["type"] != "extra_forbidden":
        return f"{name}: {error['msg']}, not {error['input']!r}"
    return _unknown(name, list(_names()))


def _names() -> Iterator[str]:
    """Of all settings; those of the picture begin with `video.`."""
    yield from (name for name in Settings.model_fields if name != "video")
    yield from (f"video.{name}" for name in VideoSettings.model_fields)


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
    known.append(f"{PREFIX}VIDEO")
    wrong = [name for name in os.environ if name.startswith(PREFIX) and name not in known]
    if wrong:
        raise SettingsError("; ".join(_unknown(name, known) for name in wrong))
