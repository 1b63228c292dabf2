"""Runtime parameters of the virtual camera: one place for settings, pages and control."""

from __future__ import annotations

from dataclasses import replace
from typing import Annotated, Final

import msgspec
from msgspec import Meta

from pipeline.config import VirtualCameraConfig, VirtualCameraMode
from pipeline.control.cutoff import cutoff_hz, time_constants

SLOWEST_HZ, FASTEST_HZ = 0.03, 3.0
MOST_ADAPTIVE: Final = 10.0
"""Allowed for β of the virtual camera's adaptive cutoff."""
FASTEST_M_S: Final = 5.0

CutoffHz = Annotated[float, Meta(ge=SLOWEST_HZ, le=FASTEST_HZ)]
AdaptiveBeta = Annotated[float, Meta(ge=0.0, le=MOST_ADAPTIVE)]
SpeedLimit = Annotated[float, Meta(ge=0.0, le=FASTEST_M_S)]


class RuntimeParameters(msgspec.Struct, forbid_unknown_fields=True, frozen=True):
    """How the virtual camera smooths the turns of the phone."""

    cutoff_hz: CutoffHz
    """−3 dB of the low pass [Hz]."""
    mode: VirtualCameraMode
    """`full`: all turns are smoothed; `selective`: not those about the line of sight; `off`."""
    adaptive_beta: AdaptiveBeta
    """How much the cut-off rises with the speed of a turn [Hz/(rad/s)]."""
    max_speed_m_s: SpeedLimit
    """Turns move the reference no faster [m/s]; 0: no limit."""
    guard: bool
    """Hurry after the phone when the robot nears the border of the picture."""

    @classmethod
    def of(cls, config: VirtualCameraConfig) -> RuntimeParameters:
        """Parameters of a configuration; the cut-off is that of the low pass, used or not."""
        hz = cutoff_hz(replace(config, mode="full"))
        return cls(
            cutoff_hz=round(min(max(hz, SLOWEST_HZ), FASTEST_HZ), 4),
            mode=config.mode,
            adaptive_beta=config.adaptive_beta,
            max_speed_m_s=config.max_speed_m_s if config.max_speed_m_s <= FASTEST_M_S else 0.0,
            guard=config.guard,
        )

    def config(self) -> VirtualCameraConfig:
        """The configuration that stands so."""
        return turned(VirtualCameraConfig(), Tune(**msgspec.structs.asdict(self)))


DEFAULT_KNOBS: Final = RuntimeParameters.of(VirtualCameraConfig())


class Tune(msgspec.Struct, tag="tune", forbid_unknown_fields=True, frozen=True):
    """Page → server: turn `RuntimeParameters` of the virtual camera; those left out or null stay.

    `status` shows how they stand: that is the answer.
    """

    cutoff_hz: CutoffHz | None = None
    mode: VirtualCameraMode | None = None
    adaptive_beta: AdaptiveBeta | None = None
    max_speed_m_s: SpeedLimit | None = None
    guard: bool | None = None


def turned(config: VirtualCameraConfig, tune: Tune) -> VirtualCameraConfig:
    """`config` with the parameters of `tune` set, all else as it is."""
    wanted = msgspec.structs.asdict(tune)
    hz = wanted.pop("cutoff_hz")
    changes = {name: value for name, value in wanted.items() if value is not None}
    if hz is not None:
        changes["tau_1"], changes["tau_2"] = time_constants(hz)
    return replace(config, **changes)
