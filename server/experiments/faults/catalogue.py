"""The faults, by the part that fails; each names its hazard, its end and its times."""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial
from typing import Final

from hardware.sim.camera_faults import CameraFault
from server.experiments.faults import happenings as h
from server.experiments.faults import tampering
from server.experiments.faults.fault import Event, Fault, Happening
from server.experiments.gaps.vanish import COAST_S, FOR_EVER_S, RAMP_S
from server.phone.ingest import UNHEARD_S

ROBOT_S: Final = 0.075
"""Until the robot acts by itself."""
ROBOT_RAMP_S: Final = 0.35
TICK_S: Final = 0.011
RAMPED_S: Final = 3.0
"""From the beginning of a ramp to no thrust: the robot's `ramp_s` and its thrusters' lag."""
HELD_S: Final = 3.2
"""The longest HOLD."""
BLIND_S: Final = 4.4
"""Without pictures until RAMP."""
AFTER_S: Final = 1.2
BACK_S: Final = 0.3
"""From the end of a gap until it follows: two pictures' periods (0.067 s; one may be lost, or not
believed), a picture's way (up to 0.13 s), all good for 0.1 s. Without a picture taken since nobody
knows where the robot is."""
Times = Mapping[Event, float]


def gone(name: str, hazard: str, happens: Happening, believed_s: float = 0.0) -> Fault:
    """No news of the phone for good: it coasts, ramps, and never follows again.

    For `believed_s` it is believed by its own clock, while it is heard and hears nothing.
    """
    ramp_s = believed_s + RAMP_S
    by: Times = {"COAST": believed_s + COAST_S, "RAMP": ramp_s, "zero": ramp_s + RAMPED_S}
    return ends(name, hazard, happens, by)


def borne(name: str, hazard: str, happens: Happening, by: Times | None = None) -> Fault:
    """The flight goes on by itself."""
    return Fault(name, hazard, happens, "flies", by or {}, never=("HOLD", "RAMP"))


def ends(name: str, hazard: str, happens: Happening, by: Times) -> Fault:
    """It comes down, by the times given, and stays down."""
    watch_s = by["zero"] + AFTER_S
    return Fault(name, hazard, happens, "zero", by, watch_s, ("TRACK",))


def by_robot(name: str, hazard: str, happens: Happening, more: Times | None = None) -> Fault:
    """The robot comes down by itself."""
    by: Times = {"robot": ROBOT_S, "zero": ROBOT_RAMP_S + RAMPED_S}
    return ends(name, hazard, happens, {**by, **(more or {})})


def ramps(name: str, hazard: str, happens: Happening, ramp_s: float) -> Fault:
    """Control ramps down."""
    return ends(name, hazard, happens, {"RAMP": ramp_s, "zero": ramp_s + RAMPED_S})


def open_ended(name: str, hazard: str, happens: Happening) -> Fault:
    """Noticed or not: within the bounds of a flight in any case."""
    return Fault(name, hazard, happens, "any", watch_s=4.5)


def motion(change: tampering.Change) -> Happening:
    """The phone's motion sensors say something else."""
    return h.tampered(tampering.motion(change))


def stops(name: str, at: float = 0.0, before: Happening | None = None) -> Fault:
    """STOP: no thrust at once, whatever goes on."""
    return ends(name, "38", h.requested("stop", at, before), {"STOPPED": TICK_S, "zero": 0.25})


LOST: Final[Times] = {"COAST": COAST_S, "RAMP": RAMP_S}
RAMPING: Final[Times] = {"RAMP": RAMP_S}
BLIND: Final[Times] = {"HOLD": 2.7, "RAMP": BLIND_S, "zero": BLIND_S + RAMPED_S}
ON_THEIR_WAY_S: Final = 0.057
"""A motion sample is read 0.017 s after the one before, and comes up to 0.04 s later."""
UNTURNED_S: Final = 0.35
"""A picture that comes again is news until something has turned unevenly: a hand does by then."""
FROZEN: Final[Times] = {event: by + UNTURNED_S for event, by in BLIND.items()}
JUMPED: Final[Times] = {
    "COAST": COAST_S,
    "HOLD": COAST_S + 1.21,
    "RAMP": HELD_S,
    "zero": HELD_S + RAMPED_S,
}
LET_GO: Final[Times] = {"HOLD": 0.06, "RAMP": HELD_S, "zero": HELD_S + RAMPED_S}

PHONE: Final = (
    gone("phone vanishes", "16", h.dark(FOR_EVER_S)),
    borne("phone is gone for 0.1 s", "18", h.dark(0.1)),
    borne("phone is gone for 0.4 s", "18", h.dark(0.4), {"COAST": COAST_S, "TRACK": 0.4 + BACK_S}),
    borne("phone is gone for 0.8 s", "18", h.dark(0.8), {"COAST": COAST_S, "TRACK": 0.8 + BACK_S}),
    gone("phone is gone for 3 s", "18", h.dark(3.0)),
    gone("page frozen for 3 s, then all at once", "17", h.selective(h.FROM_PHONE, 3.0, holds=True)),
    gone("page hears nothing", "18", h.selective(("ping",), FOR_EVER_S), UNHEARD_S),
    gone("signs of life stop", "17", h.selective(h.SIGNS, FOR_EVER_S)),
    gone("one touch again and again", "20", h.tampered_with_memory(tampering.stale_touch)),
    gone("motion sensors silent", "9", h.selective(("motion",), FOR_EVER_S)),
    borne(
        "motion sensors silent for 0.4 s", "9", h.selective(("motion",), 0.4), {"COAST": COAST_S}
    ),
    gone("rates are no numbers", "27", motion(tampering.no_number)),
    gone("a force without end", "27", motion(tampering.infinite)),
    gone("motion sensors stuck", "9", h.stuck_motion(FOR_EVER_S), ON_THEIR_WAY_S),
    borne("motion sensors stuck for 0.1 s", "9", h.stuck_motion(0.1)),
    borne(
        "motion sensors stuck for 0.4 s",
        "9",
        h.stuck_motion(0.4),
        {"COAST": ON_THEIR_WAY_S + COAST_S},
    ),
    open_ended("motion sensors' axes turned", "10", motion(tampering.turned_axes)),
    ends("accelerations turned round", "10", motion(tampering.turned_sign), JUMPED),
    open_ended("phone's clock an hour ahead", "12", h.clock(3600.0)),
    open_ended("phone's clock back by 10 s", "12", h.clock(-10.0)),
)
PICTURES: Final = (
    ends("pictures stop", "1", h.selective(("picture",), FOR_EVER_S), BLIND),
    borne("pictures stop for 1 s", "1", h.selective(("picture",), 1.0)),
    borne("pictures 0.2 s later", "2", h.slow_pictures(0.2)),
    ends(
        "pictures frozen",
        "3",
        h.tampered_with_memory(lambda: tampering.pictures(tampering.frozen())),
        FROZEN,
    ),
    borne(
        "pictures shown four times",
        "3",
        h.tampered_with_memory(lambda: tampering.pictures(tampering.repeated(4))),
    ),
    open_ended(
        "pictures' times 0.1 s wrong", "2", h.tampered(tampering.pictures(tampering.too_old))
    ),
    ends("camera zooms by 8 %", "5", h.lying_camera(CameraFault.ZOOM), BLIND),
    ends("another lens", "5", h.lying_camera(CameraFault.LENS), BLIND),
    open_ended("picture stabilised by the browser", "5", h.lying_camera(CameraFault.ELECTRONIC)),
    open_ended("picture stabilised by the lens", "5", h.lying_camera(CameraFault.OPTICAL)),
    open_ended("focus breathes by 2 %", "5", h.lying_camera(CameraFault.BREATHING)),
    open_ended("LEDs mixed up", "7", h.tampered(tampering.pictures(tampering.mixed_up))),
    ends(
        "places that are no numbers",
        "27",
        h.tampered(tampering.pictures(tampering.beside_itself)),
        BLIND,
    ),
)
FINGER: Final = (
    ends("finger lifted", "15", h.lifted(0.0), LET_GO),
    ends(
        "finger lifted in a gap of 0.4 s",
        "15",
        h.lifted(0.2, 0.4),
        {"COAST": COAST_S, "HOLD": 0.6, "RAMP": HELD_S + 0.2, "zero": HELD_S + 0.2 + RAMPED_S},
    ),
    ramps("finger lifted, then the phone vanishes", "15", h.lifted(0.0, FOR_EVER_S), RAMP_S),
)
SERVER: Final = (
    gone("server killed", "26", h.selective(h.ALL, FOR_EVER_S)),
    borne(
        "server stands still for 0.3 s",
        "26",
        h.selective(h.ALL, 0.3, holds=True),
        {"COAST": COAST_S, "TRACK": 0.6},
    ),
    gone("server stands still for 2 s", "26", h.selective(h.ALL, 2.0, holds=True)),
)
ROBOT: Final = (
    by_robot("robot's link dead", "23", h.robot_link(FOR_EVER_S), LOST),
    borne("robot's link dark for 50 ms", "23", h.robot_link(0.05)),
    borne("robot's link dark for 0.15 s", "23", h.robot_link(0.15)),
    by_robot("robot's link dark for 1.5 s", "23", h.robot_link(1.5), LOST),
    by_robot("commands are lost", "23", h.to_robot(lambda _: tampering.nothing), RAMPING),
    by_robot(
        "samples are lost",
        "23",
        h.to_control(lambda _: tampering.nothing),
        {**LOST, "robot": 0.12},
    ),
    by_robot(
        "commands 60 ms late",
        "23",
        h.to_robot(lambda _: tampering.late(12)),
        {**RAMPING, "robot": 0.14, "zero": 0.4 + RAMPED_S},
    ),
    borne("commands come twice", "20", h.to_robot(lambda _: tampering.twice)),
    borne("old commands come again", "20", h.to_robot(lambda _: tampering.replayed(40))),
    borne("bits turned in 10 % of the commands", "20", h.to_robot(partial(tampering.spoilt, 0.1))),
    borne("bits turned in 10 % of the samples", "20", h.to_control(partial(tampering.spoilt, 0.1))),
    borne("garbage for the robot", "20", h.to_robot(partial(tampering.flooded, 20))),
    ends(
        "robot's computer restarts",
        "24",
        h.restarts,
        {"robot": TICK_S, "RAMP": COAST_S, "zero": 0.3},
    ),
)
CONTROL: Final = (
    by_robot("control killed", "25", h.control(0)),
    borne("control stands still for 50 ms", "25", h.control(0, 0.05)),
    borne("control stands still for 0.15 s", "25", h.control(0, 0.15)),
    by_robot("control stands still for 2 s", "25", h.control(0, 2.0)),
    ramps("control at 50 Hz", "25", h.control(4), 0.8),
    ramps("control at 25 Hz", "25", h.control(8), 0.8),
)
PEOPLE: Final = (
    stops("STOP while it follows"),
    stops("STOP while it coasts", 0.25, h.dark(FOR_EVER_S)),
    stops("STOP while it holds", 0.5, h.lifted(0.0)),
    stops("STOP while it ramps", 0.3, h.requested("disarm")),
    ramps("disarmed while it follows", "38", h.requested("disarm"), TICK_S),
    borne("asked to arm all the time", "39", h.requested_every_tick("arm")),
)
BODY: Final = (
    open_ended("body's rates are no numbers", "27", h.body_imu("nan")),
    ramps("body's sensors stuck", "22", h.body_imu("stuck"), 0.12),
    open_ended("body's gyroscope 6°/s off", "22", h.body_imu("biased")),
    ends("body's accelerations turned round", "22", h.body_imu("turned"), JUMPED),
    open_ended("a thruster dead", "29", h.thruster(0.0)),
    open_ended("a thruster at half", "29", h.thruster(0.5)),
    borne("pushed with 4 N for 0.3 s", "31", h.pushed(4.0, 0.3)),
)
FAULTS: Final[tuple[Fault, ...]] = (
    Fault("nothing", "–", h.clean, "flies", watch_s=1.5, never=("COAST", "HOLD", "RAMP")),
    *PHONE,
    *PICTURES,
    *FINGER,
    *SERVER,
    *ROBOT,
    *CONTROL,
    *PEOPLE,
    *BODY,
)
"""In the order of the table."""
