"""Settings of `lightleash serve`: defaults < TOML file < environment < command line."""

from __future__ import annotations

import os
import tomllib
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from pydantic import BaseModel, ConfigDict, Field, ValidationError
from pydantic_settings import (
    BaseSettings,
    PydanticBaseSettingsSource,
    SettingsConfigDict,
)


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
    """How a server is started."""

    model_config = SettingsConfigDict(
        extra="forbid",
        env_prefix="LIGHTLEASH_",
        env_nested_delimiter="__",
        cli_kebab_case=True,
        cli_prog_name="lightleash serve",
        cli_hide_none_type=True,
        cli_avoid_json=True,
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
    simulate: bool = Field(True, description="start the simulated robot")
    robot_host: str | None = Field(None, description="of a real robot; default: the robot file's")
    robot_port: int | None = Field(None, ge=1, le=65535, description="of a real robot")
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


class SettingsError(ValueError):
    """Settings that can't be used; the text names each and what is allowed."""


def load(argv: Sequence[str], file: Path | None = None) -> Settings:
    """Settings from all four places.

    Raises:
        SettingsError: an unknown key or a value out of its range.
    """
    values: dict[str, Any] = {}
    if file is not None:
        try:
            values = tomllib.loads(file.read_text(encoding="utf-8"))
        except (OSError, UnicodeDecodeError, tomllib.TOMLDecodeError) as error:
            raise SettingsError(f"{file}: {error}") from error
    try:
        settings = Settings(_cli_parse_args=list(argv), **values)  # type: ignore[call-arg]
    except ValidationError as error:
        faults = (f"{'.'.join(map(str, e['loc']))}: {e['msg']}" for e in error.errors())
        raise SettingsError("; ".join(faults)) from error
    if (settings.cert is None) != (settings.key is None):
        raise SettingsError("cert, key: both or neither")
    return settings
