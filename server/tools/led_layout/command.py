"""`lightleash robot leds`: can this robot's LEDs be told apart, and would others be better."""

from __future__ import annotations

import argparse
import json
from collections.abc import Iterator
from dataclasses import replace
from math import radians
from pathlib import Path

import numpy as np

from hardware.led_layout.anneal import AnnealingOptions, improve
from hardware.led_layout.file import Layout, load_layout
from hardware.led_layout.margins import Margins, Progress, margins
from hardware.led_layout.reach import Ball, Reach
from hardware.led_layout.viewpoints import Viewpoints, looks_about
from pipeline.frames import Array
from server.common.progress import progress_bar
from server.common.ranges import number, whole
from server.tools.led_layout.files import changes, figures, make_folder, toml, write
from server.tools.led_layout.report import LayoutReport, judged, lines

SEARCH_VIEWS = 100
"""Of all, spread evenly, that a search looks at; what it finds is judged by all."""


HELP = "Can the LEDs be told apart from every view, how exact is a pose, would others be better?"


def _distances(text: str) -> list[float]:
    return sorted({number(0.2, 50.0)(part) for part in text.split(",")})


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options of the command."""
    add = parser.add_argument
    add("robot", metavar="ROBOT", help="a robot's name, or a .toml with [[leds]]")
    add("--out", type=Path, metavar="DIR", help="write leds.png, leds.json there")
    add("--json", action="store_true", help="print figures as JSON in place of the report")
    views = parser.add_argument_group("views")
    add = views.add_argument
    add("--distances", type=_distances, metavar="M,M", help="default: 0.6, 1, 1.6 × [start]'s")
    add("--azimuth", type=number(1.0, 180.0), default=35.0, metavar="DEG", help="±, default 35")
    add("--elevation", type=number(1.0, 90.0), default=20.0, metavar="DEG", help="±, default 20")
    add("--sphere", action="store_true", help="from everywhere")
    add("--views", type=whole(10, 5000), default=150, metavar="N", help="default 150")
    add("--focal-px", type=number(50.0, 2e4), default=914.0, help="default 914: phone at 720p")
    add("--noise-px", type=number(1e-3, 10.0), default=0.1, help="of a coordinate, default 0.1")
    add("--gravity", type=number(0.5, 60.0), default=10.0, metavar="DEG", help="default 10")
    add("--attitude", type=number(1.0, 120.0), default=30.0, metavar="DEG", help="default 30")
    better = parser.add_argument_group("a better layout")
    add = better.add_argument
    add("--improve", action="store_true", help="search for it, print [[leds]] to paste")
    add("--reach", type=number(1e-3, 2.0), metavar="M", help=_REACH)
    add("--turns", type=whole(1, 100_000), default=400, help="layouts per start, default 400")
    add("--starts", type=whole(1, 64), default=4, help="default 4; the first from the layout")
    add("--seed", type=whole(0, 2**31), default=1, help="default 1")
    add("--enough-px", type=number(0.5, 30.0), default=8.0, help="margin that is enough")


_REACH = "how far each LED may move where the file has no reach_m, reach_box_m, reach_segment_m"


def run(arguments: argparse.Namespace) -> int:
    """Examine and print; 1 when the layout (the better one, if asked for) is bad.

    Raises:
        RobotFileError, LedLayoutError: the file can't be used.
        OutError: the folder can't be written.
    """
    layout = load_layout(arguments.robot)
    if arguments.out is not None:
        make_folder(arguments.out)
    looks, usual = _looks(arguments, layout)
    layouts = [_judge(layout.name, layout.leds_in_b, looks, usual, arguments)]
    if arguments.improve:
        leds = _improved(layout, looks, usual, arguments)
        if not np.array_equal(leds, layout.leds_in_b):
            name = f"{layout.name}, improved"
            layouts.append(_judge(name, leds, looks, usual, arguments))
    if arguments.json:
        print(json.dumps([figures(it) for it in layouts], indent=1))
    else:
        print("\n".join(_text(layouts, arguments.improve)))
    if arguments.out is not None:
        write(layouts, arguments.out)
    return 1 if layouts[-1].grade == "bad" else 0


def _looks(arguments: argparse.Namespace, layout: Layout) -> tuple[Viewpoints, int]:
    """The views asked for, and which distance is nearest to the usual one."""
    distances = arguments.distances or [
        round(share * layout.distance, 2) for share in (0.6, 1.0, 1.6)
    ]
    spread = (180.0, 180.0) if arguments.sphere else (arguments.azimuth, arguments.elevation)
    looks = looks_about(
        (0.0, layout.elevation),
        (radians(spread[0]), radians(spread[1])),
        arguments.views,
        np.array(distances),
        arguments.focal_px,
        radians(arguments.gravity),
        radians(arguments.attitude),
    )
    return looks, int(np.argmin(np.abs(looks.distances - layout.distance)))


def _judge(
    name: str, leds_in_b: Array, looks: Viewpoints, usual: int, arguments: argparse.Namespace
) -> LayoutReport:
    found: Margins = margins(leds_in_b, looks, _bar(f"{name}: views", len(looks.angles)))
    return judged(name, leds_in_b, looks, usual, arguments.noise_px, found)


def _improved(
    layout: Layout, looks: Viewpoints, usual: int, arguments: argparse.Namespace
) -> Array:
    radius = 0.05 if arguments.reach is None else arguments.reach
    reaches: list[Reach] = [
        reach or Ball(led, radius)
        for reach, led in zip(layout.reaches, layout.leds_in_b, strict=True)
    ]
    chosen = np.linspace(0, len(looks.angles) - 1, min(SEARCH_VIEWS, len(looks.angles)))
    some = replace(
        looks, angles=looks.angles[chosen.astype(int)], distances=looks.distances[usual : usual + 1]
    )
    search = AnnealingOptions(
        arguments.turns, arguments.starts, arguments.seed, arguments.enough_px
    )
    bar = _bar("layouts", search.turns * search.starts)
    return improve(layout.leds_in_b, reaches, some, search, bar)


def _bar(label: str, total: int) -> Progress:
    """Tells how far it is."""

    def show(turns: Iterator[None]) -> None:
        with progress_bar(total, label) as bar:
            for _ in turns:
                bar.update()

    return show


def _text(layouts: list[LayoutReport], asked: bool) -> Iterator[str]:
    yield from lines(layouts[0])
    if not asked:
        return
    yield ""
    if len(layouts) == 1:
        yield "Nothing better found within reach: more --turns and --starts, or more reach."
        return
    before, after = layouts
    yield from lines(after)
    yield ""
    yield f"At {before.looks.distances[before.usual]:.2f} m{'before':>46}{'after':>10}"
    for change in changes(before, after):
        yield f"  {change.what:<50}{change.before:>8.2f}{change.after:>10.2f}"
    yield ""
    yield "To paste:"
    yield from toml(after.leds_in_b)
