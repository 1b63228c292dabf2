"""What the figures rest on; none of it is from the paper, which touches nothing."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from hardware.plant_parameters import PlantParameters
from hardware.sim.plant.obstacle import Obstacle
from server.experiments.contact.measure import IMPACT_S, LOST_MS, SETTLE_S, SMOOTH_S
from server.experiments.contact.setting import (
    AIM_M,
    BAND_N,
    FULL,
    GO_S,
    HOVER_S,
    STAY_S,
    ContactScene,
    spring_n_m,
)
from server.experiments.paper.setup.assumptions import Assumption, phone_sensors, sensors
from server.experiments.paper.setup.assumptions import json as json
from server.experiments.paper.setup.assumptions import lines as lines
from server.experiments.paper.setup.assumptions import plant as plant_parts
from server.simulation.sensors import PAPER, Leader


def of(
    plant: PlantParameters, leader: Leader, scenes: Sequence[ContactScene], seeds: int
) -> list[Assumption]:
    """Assumptions of the experiment as it is set up."""
    sensing = sensors(leader) if leader == PAPER else phone_sensors(leader)
    return [*_touching(plant, scenes), *_judging(plant, seeds), *sensing, *plant_parts(plant)]


def _touching(plant: PlantParameters, scenes: Sequence[ContactScene]) -> Iterator[Assumption]:
    """Tool, wall, socket, hand."""
    tool = Obstacle()
    yield Assumption(
        "tool",
        f"rigid rod along x_b, tip {1e3 * tool.tool_m:g} mm before the centre of mass, round end "
        f"of {1e3 * tool.radius_m:g} mm radius",
        "chosen",
    )
    yield Assumption(
        "touch",
        f"{tool.stiffness_s2 * plant.mass:g} N/m for this robot, rebounds with about half "
        f"the speed, friction {tool.friction:g}",
        "chosen",
    )
    for scene in {scene.name: scene for scene in scenes}.values():
        yield Assumption(
            scene.name,
            f"{1e3 * scene.gap_m:g} mm before the tip; the reference goes {1e3 * scene.beyond_m:g} "
            "mm behind it" + ("" if scene.socket is None else "s bottom"),
            "chosen",
        )
        if scene.socket is not None:
            s = scene.socket
            yield Assumption(
                "hole",
                f"square, {1e3 * s.clearance_m:g} mm clearance on every side, slopes of 45° over "
                f"{1e3 * s.chamfer_m:g} mm, {1e3 * s.depth_m:g} mm deep; plugged: {FULL:g} of it",
                "chosen",
            )
            yield Assumption("aim", f"{1e3 * AIM_M:g} mm RMS off in y and z", "chosen")
    yield Assumption(
        "hand",
        f"hovers {HOVER_S:g} s, goes in {GO_S:g} s, stays {STAY_S:g} s, comes back; "
        "wander of 5 mm and 0.4° RMS below 0.5 Hz, tremor at 8-12 Hz",
        "chosen",
    )


def _judging(plant: PlantParameters, seeds: int) -> Iterator[Assumption]:
    """How force is judged."""
    yield Assumption("force", "MuJoCo's contact force, every millisecond", "chosen")
    yield Assumption(
        "band",
        f"± {BAND_N:g} N about what is predicted: compliance's limit, less the suspension's "
        f"{spring_n_m(plant):.1f} N/m times the way to the obstacle; stiff is held against the "
        "highest limit's",
        "chosen",
    )
    yield Assumption(
        "pressing",
        f"from {SETTLE_S:g} s after the hand's arrival until it goes back; averaged over "
        f"{1e3 * SMOOTH_S:g} ms",
        "chosen",
    )
    yield Assumption("contact lost", f"nothing touches for {LOST_MS} ms or longer", "chosen")
    yield Assumption(
        "overshoot", f"later than {1e3 * IMPACT_S:g} ms after the first touch", "chosen"
    )
    yield Assumption("seeds", f"1 to {seeds}", "chosen")
