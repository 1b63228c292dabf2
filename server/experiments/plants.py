"""`lightleash experiments plants`: robots that are not what control was told, in virtual time.

Control believes the robot file. First the plant is drawn at random around it, flight after flight,
each beside the plant of the file by the same hand and sensors; then a thruster fails in flight,
each in turn, and gives nothing or a part of what it is told.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from math import nan
from pathlib import Path
from typing import Final

import numpy as np

from hardware.plant_parameters import PlantParameters
from hardware.robot_file import RobotFile, load_robot
from hardware.sim.hand import make_hand
from hardware.sim.led_sensor_model import LED_NOISE_PX
from pipeline.config import TeleopConfig
from pipeline.frames import Array
from server.common.ranges import number, seed_number, whole
from server.common.text import Column, flights
from server.control.process import teleop_config
from server.experiments import processes
from server.experiments.runner import ExperimentReport, experiment
from server.simulation.figures import result_of, rms, rows_of
from server.simulation.virtual_time import SimulationOptions, VirtualTimeSimulation

MASS: Final = 0.30
"""How far the mass may be from the file's, either way, as a share ..."""
INERTIA: Final = 0.40
"""... each moment of inertia ..."""
THRUST: Final = 0.15
"""... and what each thruster gives; above the largest thrust none gives more."""
LAGS_S: Final = (0.015, 0.045)
"""Of a thruster: the range that the AMES's file gives for its own."""
FAILS_AT_S: Final = 6.0
"""A thruster, four seconds after tracking began ..."""
AFTER_S: Final = 1.0
"""... and how much later its effect is judged: by then it should be borne ..."""
JUDGED_S: Final = 6.0
"""... for so long."""
SHARES: Final = (0.0, 0.6)
"""What a thruster that fails still gives."""
MOST_RATIO: Final = 1.25
"""RMS error of a plant, to that of the known one."""
SAID_S: Final = 0.3
"""By when people are told of a thruster that has failed."""
MOST_TURN_DEG: Final = 2.0
"""RMS turn with a thruster that has failed."""


@dataclass(frozen=True, slots=True, eq=False)
class UntoldPlant:
    """What a robot truly is."""

    parameters: PlantParameters
    thrust_gains: Array
    """(m,) what each thruster gives of what it is told."""


@dataclass(frozen=True, slots=True)
class PlantRow:
    """One plant drawn at random, beside the known one with the same seed."""

    seed: int
    mass_kg: float
    lag_ms: float
    known_mm: float
    rms_mm: float
    ratio: float
    rms_deg: float
    chatter_n: float
    ended: str
    named: str = ""
    """Thrusters that were called weak, though none had failed."""


@dataclass(frozen=True, slots=True)
class ThrusterRow:
    """One thruster that fails in flight; NaN where the flight ended before it was judged."""

    thruster: int
    gives: float
    rms_mm: float
    max_mm: float
    turn_deg: float
    ended: str
    said_s: float = nan
    """From the failure until people were told of this thruster; NaN if they never were."""
    wrong: str = ""
    """What else they were told of thrusters."""


PLANT_COLUMNS: Final[tuple[Column, ...]] = (
    ("seed", "seed", "{}"),
    ("mass_kg", "mass kg", "{:.2f}"),
    ("lag_ms", "lag ms", "{:.0f}"),
    ("known_mm", "as told mm", "{:.2f}"),
    ("rms_mm", "RMS mm", "{:.2f}"),
    ("ratio", "ratio", "{:.2f}"),
    ("rms_deg", "RMS °", "{:.2f}"),
    ("chatter_n", "chatter N", "{:.2f}"),
)
THRUSTER_COLUMNS: Final[tuple[Column, ...]] = (
    ("thruster", "thruster", "{}"),
    ("gives", "gives", "{:.1f}"),
    ("rms_mm", "RMS mm", "{:.1f}"),
    ("max_mm", "max mm", "{:.1f}"),
    ("turn_deg", "RMS °", "{:.2f}"),
    ("said_s", "said s", "{:.2f}"),
)


@dataclass(frozen=True, slots=True, eq=False)
class Setting:
    """What all flights share."""

    robot_file: RobotFile
    config: TeleopConfig
    hand: str

    def flight(self, seed: int, plant: UntoldPlant | None = None) -> VirtualTimeSimulation:
        """At rest, with the plant of the file or another."""
        scene = SimulationOptions(hand=self.hand, seed=seed, led_noise_px=LED_NOISE_PX)
        if plant is None:
            return VirtualTimeSimulation(self.robot_file, self.config, scene)
        real = replace(self.robot_file, plant=plant.parameters)
        simulation = VirtualTimeSimulation(real, self.config, scene)
        simulation.follower.plant.thruster_health[:] = plant.thrust_gains
        return simulation


def drawn(known: PlantParameters, rng: np.random.Generator) -> UntoldPlant:
    """A plant around `known`; moments of inertia that no body has are drawn again."""
    inertia = known.inertia * rng.uniform(1.0 - INERTIA, 1.0 + INERTIA, 3)
    while 2.0 * inertia.max() > inertia.sum():
        inertia = known.inertia * rng.uniform(1.0 - INERTIA, 1.0 + INERTIA, 3)
    gains = rng.uniform(1.0 - THRUST, 1.0 + THRUST, len(known.thruster_torques))
    mass = known.mass * float(rng.uniform(1.0 - MASS, 1.0 + MASS))
    lag = float(rng.uniform(*LAGS_S))
    return UntoldPlant(replace(known, mass=mass, inertia=inertia, lag=lag), gains)


def fly_plant(setting: Setting, seconds: float, seed: int) -> PlantRow:
    """Fly the plant of a seed, and the known one by the same hand."""
    plant = drawn(setting.robot_file.plant, np.random.default_rng((seed, 17)))
    flights = setting.flight(seed), setting.flight(seed, plant)
    nominal, real = (
        result_of(simulation.run(seconds), simulation.scene, 0.0) for simulation in flights
    )
    return PlantRow(
        seed=seed,
        mass_kg=plant.parameters.mass,
        lag_ms=1e3 * plant.parameters.lag,
        known_mm=nominal.rms_mm,
        rms_mm=real.rms_mm,
        ratio=real.rms_mm / nominal.rms_mm,
        rms_deg=real.rms_deg,
        chatter_n=real.chatter_n,
        ended=real.ended,
        named=" ".join(word for one in flights for word in one.controller.teleop.weak_thrusters),
    )


def fly_thruster(setting: Setting, seed: int, failing: tuple[int, float]) -> ThrusterRow:
    """Fly until a thruster fails, and on: (which one, what share it still gives)."""
    thruster, gives = failing
    simulation = setting.flight(seed)
    simulation.run(FAILS_AT_S)
    simulation.follower.plant.thruster_health[thruster] = gives
    words: dict[str, float] = {}
    trace = simulation.trace
    while simulation.t < FAILS_AT_S + AFTER_S + JUDGED_S and not trace.left:
        for warning in simulation.advance().thrusters:
            words.setdefault(warning, simulation.t - FAILS_AT_S)
    right = f"Thruster {thruster + 1} "
    judged = np.array(trace.t) >= FAILS_AT_S + AFTER_S
    off_mm = 1e3 * np.linalg.norm(rows_of(trace.error_in_f)[judged], axis=1)
    turn_deg = np.rad2deg(np.linalg.norm(rows_of(trace.turn)[judged], axis=1))
    return ThrusterRow(
        thruster=thruster,
        gives=gives,
        rms_mm=rms(off_mm),
        max_mm=float(off_mm.max(initial=0.0)) if len(off_mm) else nan,
        turn_deg=rms(turn_deg),
        ended=trace.left,
        said_s=min((t for word, t in words.items() if word.startswith(right)), default=nan),
        wrong=" ".join(word for word in words if not word.startswith(right)),
    )


def _fly_failing(setting: Setting, flight: tuple[int, int, float]) -> ThrusterRow:
    seed, thruster, gives = flight
    return fly_thruster(setting, seed, (thruster, gives))


def goals(plants: Sequence[PlantRow], thrusters: Sequence[ThrusterRow]) -> Mapping[str, bool]:
    """What was asked for, of what was flown; NaN keeps no goal."""
    held: dict[str, bool] = {}
    if plants:
        small = f"every plant: RMS no more than {MOST_RATIO} times the known one's"
        held[small] = all(row.ratio <= MOST_RATIO for row in plants)
        held["every plant: no flight ended"] = not any(row.ended for row in plants)
        held["every plant: no thruster is called weak"] = not any(row.named for row in plants)
    if thrusters:
        level = f"a thruster fails: turned by no more than {MOST_TURN_DEG:g}° RMS"
        held[level] = all(row.turn_deg <= MOST_TURN_DEG for row in thrusters)
        held["a thruster fails: no flight ended"] = not any(row.ended for row in thrusters)
        soon = f"a thruster fails: said within {SAID_S:g} s"
        held[soon] = all(row.said_s <= SAID_S for row in thrusters)
        held["a thruster fails: no other is called weak"] = not any(row.wrong for row in thrusters)
    return held


def tables(plants: Sequence[PlantRow], thrusters: Sequence[ThrusterRow]) -> Iterator[str]:
    """Tables of what was flown, the worst plant last."""
    if plants:
        by_ratio = sorted(plants, key=lambda row: row.ratio)
        yield flights(PLANT_COLUMNS, by_ratio)
    if thrusters:
        by_share = sorted(thrusters, key=lambda row: (row.gives, row.thruster))
        yield flights(THRUSTER_COLUMNS, by_share)


@experiment("plants")
def run(arguments: argparse.Namespace) -> ExperimentReport:
    """Fly plants that nobody told, and thrusters that fail."""
    robot_file = load_robot(arguments.robot)
    config = teleop_config(robot_file, arguments.gains, TeleopConfig().virtual_camera, "relative")
    make_hand(arguments.hand)  # refused before anything is flown
    setting = Setting(robot_file, config, arguments.hand)
    first, workers = arguments.seed, arguments.workers
    seeds = range(first, first + arguments.plants)
    units = len(robot_file.plant.thruster_torques) if arguments.thrusters else 0
    failing = [
        (seed, unit, gives)
        for gives in SHARES
        for unit in range(units)
        for seed in range(first, first + arguments.thruster_seeds)
    ]
    one_plant = partial(fly_plant, setting, arguments.seconds)
    one_thruster = partial(_fly_failing, setting)
    plants = list(processes.each(one_plant, seeds, workers)) if seeds else []
    thrusters = list(processes.each(one_thruster, failing, workers)) if failing else []
    return ExperimentReport(
        {"plants": plants, "thrusters": thrusters},
        "\n\n".join(tables(plants, thrusters)),
        goals(plants, thrusters),
    )


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    parser.add_argument("--robot", default="ames", help="name or path of a robot file")
    parser.add_argument("--gains", default="phone", help="a gain set of the robot file")
    parser.add_argument("--hand", default="moving", help="of the virtual phone")
    parser.add_argument(
        "--plants", type=whole(0, 1000), default=30, help="how many are drawn; 0: none"
    )
    parser.add_argument("--seconds", type=number(5.0, 600.0), default=12.0, help="a plant's flight")
    parser.add_argument(
        "--thrusters",
        action=argparse.BooleanOptionalAction,
        default=True,
        help="let each thruster fail in turn",
    )
    parser.add_argument(
        "--thruster-seeds", type=whole(1, 1000), default=1, help="flights of each that fails"
    )
    parser.add_argument("--seed", type=seed_number, default=1000, help="of the first plant")
    parser.add_argument(
        "--workers", type=whole(1, 256), default=1, help="processes that fly at a time"
    )
    parser.add_argument("--out", type=Path, default=None, help="folder for JSON")
