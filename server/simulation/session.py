"""One session of a sweep: from its settings to its figures, the same wherever it is flown."""

from __future__ import annotations

from collections.abc import Mapping
from copy import deepcopy
from dataclasses import dataclass, fields, replace
from math import exp, nan, sqrt
from typing import Any, Final, TypeVar

import numpy as np

from hardware.robot_file import RobotFile, RobotFileError, robot_of
from hardware.robot_schema import AXES
from pipeline.config import PERIOD_S, TeleopConfig
from pipeline.frames import Array
from pipeline.gains import Gains
from server.common import clock
from server.simulation.figures import result_of
from server.simulation.sweep_keys import ROWS, Value
from server.simulation.virtual_time import SimulationOptions, VirtualTimeSimulation

T = TypeVar("T")
Settings = tuple[tuple[str, Value], ...]
GUST_S: Final = 1.0
"""How long a gust lasts."""
USUAL: Final[Mapping[str, Any]] = {
    "hand": "moving",
    "latency_ms": 90.0,
    "jitter_ms": 60.0,
    "fps": 30.0,
    "led_noise_px": 0.02,  # as vision's of rendered pictures
    "readout_ms": 0.0,
    "wind_x_m_s": 0.0,
    "wind_y_m_s": 0.0,
    "wind_z_m_s": 0.0,
    "gust_m_s": 0.0,
    "rendered": False,
}
"""What a scene is like where the sweep doesn't say."""


@dataclass(frozen=True, slots=True)
class SweepSession:
    """What is flown; it is sent to whoever flies it, files and all."""

    index: int
    seed: int
    seconds: float
    settle_s: float
    robot: Mapping[str, Any]
    """The robot file's table."""
    settings: Settings


@dataclass(frozen=True, slots=True)
class Figures:
    """What came of it; lengths in mm. NaN where nothing was tracked."""

    tracked_s: float = 0.0
    rms_mm: float = nan
    """Of the distance from where the hand meant the robot to be."""
    max_mm: float = nan
    rms_deg: float = nan
    estimate_rms_mm: float = nan
    chatter_n: float = nan
    """RMS change of a thrust from one period to the next."""
    saturated_pct: float = nan
    ended: str = ""
    """Why tracking ended before the session did, or didn't begin; "" if all went well."""


FIGURES: Final = tuple(field.name for field in fields(Figures))


@dataclass(frozen=True, slots=True)
class SessionOutcome:
    """Figures, and what they cost."""

    index: int
    figures: Figures
    cpu_s: float


@dataclass(frozen=True, slots=True, eq=False)
class SimulationSetup:
    """Settings made into what `VirtualTimeSimulation` takes."""

    robot_file: RobotFile
    config: TeleopConfig
    scene: SimulationOptions
    wind_in_f: Array
    gust_m_s: float


def fly(session: SweepSession) -> SessionOutcome:
    """Fly it. A setting with which nothing can be computed is an outcome, too."""
    started = clock.process_cpu()
    try:
        figures = _fly(prepared(session), session)
    except (ArithmeticError, ValueError, np.linalg.LinAlgError) as error:
        figures = Figures(ended=f"failed: {type(error).__name__}: {error}")
    return SessionOutcome(session.index, figures, clock.process_cpu() - started)


def _fly(flown: SimulationSetup, session: SweepSession) -> Figures:
    flight = VirtualTimeSimulation(flown.robot_file, flown.config, flown.scene)
    plant, rng = flight.follower.plant, np.random.default_rng((session.seed, 13))
    stays = exp(-PERIOD_S / GUST_S)
    gust = flown.gust_m_s * rng.standard_normal(3)
    while flight.t < session.seconds and not flight.trace.left:
        gust = stays * gust + flown.gust_m_s * sqrt(1.0 - stays**2) * rng.standard_normal(3)
        plant.wind_in_f = flown.wind_in_f + gust
        flight.advance()
    if not flight.trace.t:
        return Figures(ended="tracking never began")
    found = result_of(flight.trace, flown.scene, 0.0, session.settle_s)
    known = {name: getattr(found, name) for name in FIGURES}
    if found.tracked_s == 0.0 and not found.ended:
        known["ended"] = "tracked no longer than settle_s"
    return Figures(**known)


def prepared(session: SweepSession) -> SimulationSetup:
    """Its robot, configuration and scene.

    Raises:
        RobotFileError: there can be no such robot; names the key.
    """
    settings = dict(session.settings)
    robot_file = _robot(session.robot, settings)
    given = {key.partition(".")[2]: value for key, value in settings.items() if _is(key, "scene")}
    wanted = {**USUAL, **given}
    mean_s = 1e-3 * wanted["latency_ms"]
    half_s = min(0.5e-3 * wanted["jitter_ms"], mean_s)
    scene = SimulationOptions(
        hand=wanted["hand"],
        seed=session.seed,
        latency_s=(mean_s - half_s, mean_s + half_s),
        frame_rate_hz=wanted["fps"],
        readout_s=1e-3 * wanted["readout_ms"],
        led_noise_px=None if wanted["rendered"] else wanted["led_noise_px"],
    )
    config = TeleopConfig(gains=_gains(robot_file, settings))
    for key, value in settings.items():
        if _is(key, "teleop"):
            config = _with(config, key.split(".")[1:], value)
    wind = np.array([wanted[f"wind_{axis}_m_s"] for axis in "xyz"], dtype=np.float64)
    return SimulationSetup(robot_file, config, scene, wind, wanted["gust_m_s"])


def _is(key: str, root: str) -> bool:
    return key.startswith(f"{root}.")


def _robot(table: Mapping[str, Any], settings: Mapping[str, Value]) -> RobotFile:
    """What control knows of it, and what it is."""
    known = _changed(table, settings, "robot")
    robot_file = _checked(known, "robot")
    if not any(_is(key, "plant") for key in settings):
        return robot_file
    real = _checked(_changed(known, settings, "plant"), "plant")
    return replace(robot_file, plant=real.plant)


def _checked(table: Mapping[str, Any], root: str) -> RobotFile:
    try:
        return robot_of(table, root)
    except RobotFileError as error:
        raise RobotFileError(f"{root}.{error.key}", "", error.allowed) from error


def _changed(table: Mapping[str, Any], settings: Mapping[str, Value], root: str) -> dict[str, Any]:
    changed = deepcopy(dict(table))
    for key, value in settings.items():
        if _is(key, root):
            _, section, name = key.split(".")
            changed.setdefault(section, {})
            changed[section][name] = list(value) if isinstance(value, tuple) else value
    return changed


def _gains(robot_file: RobotFile, settings: Mapping[str, Value]) -> Gains:
    sets = robot_file.gains
    usual = "phone" if "phone" in sets else next(iter(sets))
    base, scale = sets[str(settings.get("gains.set", usual))], settings.get("gains.scale", 1.0)
    rows = {row: np.array(getattr(base, row)) for row in ROWS}
    for key, value in settings.items():
        _, _, place = key.partition("gains.")
        row, _, axis = place.partition(".")
        if row in rows and axis:
            rows[row][AXES.index(axis)] = value
    return Gains(**{row: np.asarray(scale) * values for row, values in rows.items()})


def _with(config: T, path: list[str], value: Value) -> T:
    """Copy of a dataclass with a number deep in it changed."""
    name, *deeper = path
    part = getattr(config, name)
    changed = _with(part, deeper, value) if deeper else value
    return replace(config, **{name: changed})  # type: ignore[type-var]
