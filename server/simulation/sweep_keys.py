"""What can be swept: every key with its type and range.

scene.KEY    hand, latency, noise of the LEDs' places, wind: see `SCENE`
gains.set    a gain set of the robot file; gains.scale times it; gains.Kp.x one of its numbers
teleop.KEY   any number, word or switch of `TeleopConfig`
robot.KEY    a number of the robot file, for the robot and for what control knows of it
plant.KEY    the same of the robot only: control goes on believing what the file says
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, fields, is_dataclass
from difflib import get_close_matches
from typing import Any, Final, Literal, get_args, get_origin, get_type_hints

from hardware.robot_schema import AXES, RobotSchema, Section
from hardware.sim.hand import HANDS
from pipeline.config import TeleopConfig

Value = float | int | str | bool | tuple[float, ...]
ROWS: Final = ("Kp", "Ki", "Kd")
FACTOR: Final = 100.0
"""A number of the configuration may be so many times smaller or larger than it usually is."""
ROBOT_SECTIONS: Final = ("body", "suspension", "stand", "start", "air", "thrusters", "body_imu")
PLANT_SECTIONS: Final = tuple(name for name in ROBOT_SECTIONS if name != "start")


@dataclass(frozen=True, slots=True)
class Number:
    """Number between two bounds, which are allowed."""

    low: float
    high: float
    whole: bool = False
    or_zero: bool = False

    def says_no(self, value: object) -> str:
        """What would be allowed; "" if `value` is."""
        kinds = (int,) if self.whole else (int, float)
        is_number = isinstance(value, kinds) and not isinstance(value, bool)
        if is_number and self._holds(float(value)):  # type: ignore[arg-type]
            return ""
        what = "a whole number" if self.whole else "a number"
        return f"{what} from {self.low:g} to {self.high:g}" + (", or 0" if self.or_zero else "")

    def _holds(self, value: float) -> bool:
        return self.low <= value <= self.high or (self.or_zero and value == 0.0)


@dataclass(frozen=True, slots=True)
class Word:
    """One of some."""

    options: tuple[str, ...]

    def says_no(self, value: object) -> str:
        """What would be allowed; "" if `value` is."""
        return "" if value in self.options else f"one of {', '.join(self.options)}"


@dataclass(frozen=True, slots=True)
class Switch:
    """On or off."""

    def says_no(self, value: object) -> str:
        """What would be allowed; "" if `value` is."""
        return "" if isinstance(value, bool) else "true or false"


@dataclass(frozen=True, slots=True)
class RobotNumber:
    """Number of the robot file, which says by itself what is allowed."""

    def says_no(self, _: object) -> str:
        """Nothing yet: the whole robot is looked at."""
        return ""


Allowed = Number | Word | Switch | RobotNumber

SCENE: Final[Mapping[str, Allowed]] = {
    "hand": Word(tuple(HANDS)),
    "latency_ms": Number(0.0, 400.0),  # mean, from capture to arrival; filters look back 500 ms
    "jitter_ms": Number(0.0, 400.0),  # whole width about the mean, which it leaves as it is
    "fps": Number(1.0, 1000.0),
    "led_noise_px": Number(0.0, 10.0),  # at 1280x720
    "readout_ms": Number(-50.0, 50.0),  # of the rolling shutter
    "wind_x_m_s": Number(-20.0, 20.0),  # steady, along f; through the robot's drag
    "wind_y_m_s": Number(-20.0, 20.0),
    "wind_z_m_s": Number(-20.0, 20.0),
    "gust_m_s": Number(0.0, 20.0),  # RMS of each axis about that, for about a second each
    "rendered": Switch(),  # pictures through codec and vision: ten times the time
}
ZERO_IS_GOOD: Final = (
    *("virtual_camera.tau_1", "virtual_camera.tau_2", "virtual_camera.tau_parallel"),
    *("virtual_camera.max_speed_m_s"),
    *("feedforward.high_pass_hz", "margins.unfelt"),
)
OTHER_RANGES: Final[Mapping[str, Number]] = {
    "virtual_camera.adaptive_beta": Number(0.0, 10.0),
    "virtual_camera.guard_start": Number(0.05, 1.0),
    "tilt.max_tilt_rad": Number(0.02, 1.2),
    "margins.unfelt": Number(0.0, 1.0),
    "hold.least_share": Number(0.1, 1.0),
    "envelope.max_tilt_rad": Number(0.05, 3.1),
    "envelope.max_error_rad": Number(0.05, 3.1),
}


def known_keys(gain_sets: tuple[str, ...]) -> dict[str, Allowed]:
    """Every key, for a robot with these gain sets."""
    keys: dict[str, Allowed] = {f"scene.{name}": allowed for name, allowed in SCENE.items()}
    keys["gains.set"], keys["gains.scale"] = Word(gain_sets), Number(0.01, 100.0)
    keys |= {f"gains.{row}.{axis}": Number(0.0, 1e4) for row in ROWS for axis in AXES}
    keys |= {f"teleop.{name}": allowed for name, allowed in _teleop_keys(TeleopConfig())}
    for root, sections in (("robot", ROBOT_SECTIONS), ("plant", PLANT_SECTIONS)):
        keys |= {f"{root}.{name}": RobotNumber() for name in _robot_keys(sections)}
    return keys


def nearest(key: str, known: Mapping[str, object]) -> str:
    """What an unknown key may have been meant to be, or what keys begin with."""
    ends = {name.rsplit(".", 1)[-1]: name for name in known}
    close = get_close_matches(key, known, n=1) or [
        ends[end] for end in get_close_matches(key.rsplit(".", 1)[-1], ends, n=1)
    ]
    roots = "allowed: scene.…, gains.…, teleop.…, robot.…, plant.… (--keys lists them)"
    return f"unknown key; did you mean {close[0]}?" if close else f"unknown key; {roots}"


def _teleop_keys(config: object, prefix: str = "") -> Iterator[tuple[str, Allowed]]:
    """Leaves of a dataclass of dataclasses; gains have names of their own."""
    hints = get_type_hints(type(config))
    for field in fields(config):  # type: ignore[arg-type]
        name, value = prefix + field.name, getattr(config, field.name)
        if name == "gains":
            continue
        if is_dataclass(value):
            yield from _teleop_keys(value, f"{name}.")
        else:
            yield name, _allowed(name, value, hints[field.name])


def _allowed(name: str, value: object, hint: object) -> Allowed:
    if name in OTHER_RANGES:
        return OTHER_RANGES[name]
    if get_origin(hint) is Literal:
        return Word(get_args(hint))
    if isinstance(value, bool):
        return Switch()
    if isinstance(value, int):
        return Number(1, int(FACTOR) * value, whole=True)
    if not isinstance(value, float) or value <= 0.0:
        raise TypeError(f"{name}: its range must stand in OTHER_RANGES")
    return Number(value / FACTOR, value * FACTOR, or_zero=name in ZERO_IS_GOOD)


def _robot_keys(sections: tuple[str, ...]) -> Iterator[str]:
    for name in sections:
        section: Any = RobotSchema.model_fields[name].annotation
        for one in (section, *get_args(section)):  # X | None
            if isinstance(one, type) and issubclass(one, Section):
                yield from (f"{name}.{key}" for key in one.model_fields if key != "units")
