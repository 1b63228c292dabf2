"""What the page consists of: one line adds a part."""

from __future__ import annotations

import shlex
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final


@dataclass(frozen=True, slots=True)
class ReportPart:
    """One experiment of the page."""

    name: str
    """Of its folder and its place in the page."""
    command: str
    """What follows `lightleash experiments`; seeds are said, `--out` is added."""
    quick: str
    """The same, done in a minute or so."""
    heading: str
    shows: str
    """One sentence."""

    def words(self, quick: bool) -> list[str]:
        """The command to give, without `--out`."""
        return shlex.split(self.quick if quick else self.command)


PARTS: Final[tuple[ReportPart, ...]] = (
    ReportPart(
        "paper",
        "paper --seeds 3",
        "paper --seeds 1 --only table_1 table_4 disturbance",
        "The paper's tables and figures",
        "The experiments of the paper's section V flown again in virtual time with its sensors and "
        "gains, beside its figures; and whether a phone, or our own way, does as well.",
    ),
    ReportPart(
        "margins",
        "margins",
        "margins --gains phone paper_with_ekf",
        "Stability margins",
        "How much delay, gain and phase each axis' loop can lose before it is unstable, and which "
        "gains may be armed at this latency.",
    ),
    ReportPart(
        "loop",
        "loop --hands steady moving --seconds 60 --seed 1",
        "loop --seconds 12 --seed 1 --hands moving",
        "The closed loop",
        "How closely the robot follows a phone's hand in virtual time, through rendered and "
        "encoded pictures that come as late as a phone's.",
    ),
    ReportPart(
        "contact",
        "contact --seeds 3",
        "contact --seeds 1",
        "Touching things",
        "Pushing a wall and plugging into a socket: what force the robot holds with compliance and "
        "without, and what compliance costs in free flight.",
    ),
    ReportPart(
        "sweep",
        "sweep latency",
        "sweep latency_quick",
        "Latency and gains",
        "What the tracking error does as pictures come later, with lower and higher gains.",
    ),
    ReportPart(
        "estimators",
        "estimators --seeds 3 --seed 1000",
        "estimators --seeds 1 --seed 1000 --seconds 10",
        "Estimators",
        "How well three estimators know where the robot is now, on the same data, beside the bound "
        "of what anybody could know.",
    ),
    ReportPart(
        "tremor",
        "tremor --seed 1",
        "tremor --seed 1 --seconds 20",
        "Tremor and the virtual camera",
        "What of the trembling of a hand reaches the robot, by frequency, with each kind of "
        "virtual camera.",
    ),
    ReportPart(
        "plants",
        "plants --seed 1000",
        "plants --seed 1000 --plants 2 --no-thrusters",
        "Robots that nobody told of",
        "What it costs when the robot is heavier, weaker or slower than control was told, and what "
        "becomes of it when a thruster fails in flight.",
    ),
    ReportPart(
        "screen",
        "screen --seeds 3 --seed 1000",
        "screen --seeds 1 --seed 1000 --seconds 6",
        "A robot of light",
        "Leading a robot that is only light on a screen, beside the same robot if it were real: "
        "what a display's lag costs, and what is refused.",
    ),
    ReportPart(
        "gaps",
        "gaps --seeds 2",
        "gaps --quick --no-traces --vanish 0 --seeds 1",
        "Gaps in the links",
        "How much of the time the robot follows when its link to the phone, or the phone's to the "
        "server, is dark for a while, by gaps of our own and by recorded radio, and what becomes "
        "of a phone that vanishes; in virtual time.",
    ),
    ReportPart(
        "faults",
        "faults --seeds 5",
        "faults --seeds 1 --only STOP",
        "Faults",
        "What each fault of the hazard table leads to in virtual time: when control coasts, holds "
        "and ramps, when the robot does so by itself, when there is no thrust, and how far it "
        "strays.",
    ),
    ReportPart(
        "network",
        "network --seconds 32 --seed 0",
        "network --seconds 8 --seed 0 --scenarios clean",
        "Bad lines",
        "How old pictures and motions are by WebRTC and by websockets over emulated lines, in real "
        "time; takes Linux and root.",
    ),
)
"""In the order of the page."""

LEFT_OUT: Final[Mapping[str, str]] = {"all": "it is this page"}
"""Experiments that are no part, and why."""

CAPTIONS: Final[Mapping[tuple[str, str], str]] = {
    ("paper", "fig_6"): "Fig. 6 flown again: error and thrust along x_b while the camera moves by "
    "3 cm along x_c, with and without EKF; dashed: a tenth of the move.",
    ("paper", "fig_7"): "Fig. 7 flown again: error and thrust along y_b while the camera turns by "
    "3° about z_c, with and without VCI.",
    ("paper", "fig_8"): "Fig. 8 flown again: what each thruster is asked for in that turn, with "
    "and without VCI; dashed: its limit.",
    ("paper", "fig_9"): "Fig. 9 flown again: relative position along y_c and thrust along y_b, "
    "turned and then pushed; dotted: when.",
    ("paper", "table_3"): "Times of all attempts of Table III, with and without EKF.",
    ("paper", "table_3_beam"): "Where the laser's beam was in one attempt of each kind.",
    ("margins", "margins"): "Open loops of each axis as Nyquist and Bode pictures; dotted: "
    "unstable when closed.",
    ("loop", "loop"): "Where the robot was meant to be (dashed) and was, and how far apart that "
    "is, over time; dotted: the RMS.",
    ("contact", "contact"): "Force on the wall and in the socket while the hand presses; shaded: "
    "the band about what is predicted; dotted: the time that counts.",
    ("sweep", "sweep"): "Tracking error over each swept key; points are seeds, lines are medians, "
    "crosses on top ended early.",
    ("estimators", "estimators"): "Error of each estimator over time, with ±3 σ as it believes.",
    ("tremor", "tremor"): "Spectra of the turns across and about the line of sight, and a turn of "
    "3° in 0.3 s, for each kind of virtual camera.",
    ("gaps", "gaps"): "Share of the time in which the robot follows and the farthest it strays, by "
    "length of gap; recorded minutes; a flight with gaps: where it was, should be and an ideal "
    "camera would have it, shaded while it coasts or holds.",
    (
        "faults",
        "faults",
    ): "When what followed each fault, at the latest, and how far the robot went "
    "beyond where the flight led it; red names: a goal was missed.",
    ("network", "network"): "How large a share of the pictures, and of the newest records at any "
    "time, was older than an age, on each line and path.",
}
"""(experiment, its file without suffix): what is seen; others are called as their file."""
