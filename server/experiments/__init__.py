"""`lightleash experiments`: what the project claims, measured, as tables and pictures.

Each is loaded only when asked for.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from importlib import import_module
from typing import Final, Protocol, cast

from server.common.options import Parser

EXPERIMENTS: Final = {
    "all": "every one below, as one page that stands by itself",
    "paper": "the paper's tables and figures, flown again in virtual time",
    "contact": "pushing a wall and plugging in, compliant beside stiff, in virtual time",
    "loop": "tracking of the closed loop, in virtual time",
    "tremor": "what of the hand's tremor the virtual camera lets through",
    "margins": "what delay, gain and phase the control loops can lose, axis by axis",
    "estimators": "where the robot is now: three estimators on the same data",
    "plants": "robots heavier, weaker or slower than control was told, and thrusters that fail",
    "screen": "a robot of light, led through a screen, beside the same robot if it were real",
    "gaps": "the closed loop against gaps in its links and recorded radio, in virtual time",
    "faults": "every fault of the hazard table: what follows, when, and how far the robot strays",
    "network": "a phone by WebRTC and by websockets over bad lines; as root on Linux",
    "sweep": "the closed loop over any configuration key and many seeds, on all cores",
}
"""Name, what it measures."""
MODULES: Final = {
    "all": "server.experiments.all.command",
    "paper": "server.experiments.paper.command",
    "contact": "server.experiments.contact.command",
    "loop": "server.experiments.loop",
    "tremor": "server.experiments.tremor.command",
    "margins": "server.experiments.margins",
    "estimators": "server.experiments.estimators.command",
    "plants": "server.experiments.plants",
    "screen": "server.experiments.screen",
    "gaps": "server.experiments.gaps.command",
    "faults": "server.experiments.faults.command",
    "network": "server.experiments.network.command",
    "sweep": "server.experiments.sweep.command",
}
"""Where each one is: a module with what `Experiment` says."""


class Experiment(Protocol):
    """What such a module has."""

    def add_arguments(self, parser: argparse.ArgumentParser) -> None:
        """Declare the options."""

    def run(self, arguments: argparse.Namespace) -> int:
        """Measure, print, draw; the exit code tells whether it went well."""


def main(argv: Sequence[str] | None = None) -> int:
    """Entry of `lightleash experiments`."""
    words = list(sys.argv[1:] if argv is None else argv)
    parser = Parser(
        prog="lightleash experiments", description="Measure, print a table, draw a picture."
    )
    kinds = parser.add_subparsers(required=True, metavar="EXPERIMENT")
    for name, measures in EXPERIMENTS.items():
        one = kinds.add_parser(name, help=measures, description=measures)
        if words[:1] == [name]:
            experiment = cast(Experiment, import_module(MODULES[name]))
            experiment.add_arguments(one)
            one.set_defaults(run=experiment.run)
    arguments = parser.parse_args(words)
    code: int = arguments.run(arguments)
    return code
