"""`lightleash robot identify` on robots that are not what their file says, in virtual time.

    python -m tests.bench.bench_identify [--plants 30] [--broken 5] [--seconds 45] [--workers 1]

Each plant is drawn as `experiments plants` draws them and flown by a control that believes the
file; what a recording of that flight would hold is all that `identify` has. Then control is given
the file that it wrote, and, beside it, one with the true numbers. Of the last plants a thruster
pushes the other way, or two have changed places. The exit code is 1 if a goal is missed.
"""

from __future__ import annotations

import os
import sys
import tomllib
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial
from math import nan
from pathlib import Path
from typing import Final

os.environ.setdefault("OMP_NUM_THREADS", "1")

sys.path.insert(0, str(Path(__file__).parents[2]))

import numpy as np

from hardware.robot_file import ROBOTS, RobotFile, load_robot, robot_of
from hardware.robot_text import with_numbers
from hardware.system_identification.fit import IdentificationError, IdentifiedPlant, identify
from pipeline.config import TeleopConfig
from server.common.options import Parser
from server.common.text import table
from server.control.ipc import ControlStatus
from server.control.process import STATUS_EVERY, teleop_config
from server.experiments import processes
from server.experiments.plants import Setting, UntoldPlant, drawn
from server.simulation.figures import result_of
from server.tools.identify.findings import file_numbers, found_numbers, objections
from server.tools.identify.recorded_flights import flights_of

ROBOT, HAND, GAINS = "ames", "moving", "phone"
FIRST_SEED: Final = 1100
"""Those before were used to find out how wide intervals must be."""
LINK_S: Final = 0.0055
"""A command of control takes one tick to the simulated robot, and acts in the middle of a step."""
JUDGED_S: Final = 12.0
LEAST_INSIDE, MOST_RATIO = 0.90, 1.25


@dataclass(frozen=True, slots=True)
class PlantFound:
    """One plant."""

    seed: int
    seconds: float
    untold: str
    """Numbers of which the flight told nothing."""
    outside: str
    """Numbers whose interval misses the truth."""
    numbers: int
    """That were told."""
    mass_pct: float
    """How far what was found is off."""
    lag_pct: float
    inertia_pct: float
    """The worst of those that were told."""
    ratio: float
    """RMS error with the file that was written, to that with the true numbers."""


@dataclass(frozen=True, slots=True)
class Broken:
    """One plant that is built another way than its file says."""

    what: str
    seconds: float
    said: str
    """What `identify` has against it."""
    is_found: bool


def setting(robot_file: RobotFile) -> Setting:
    """What control believes."""
    config = teleop_config(robot_file, GAINS, TeleopConfig().virtual_camera, "relative")
    return Setting(robot_file, config, HAND)


def flown(
    believed: RobotFile, seed: int, plant: UntoldPlant, seconds: float
) -> list[ControlStatus]:
    """Statuses as a recording has them."""
    simulation, states = setting(believed).flight(seed, plant), []
    ticks = 0
    while simulation.t < seconds and not simulation.trace.left:
        output, ticks = simulation.advance(), ticks + 1
        if ticks % STATUS_EVERY == 0:
            states.append(simulation.controller.status(output, 1, "virtual time", {}, 0.0, 0))
    return states


def truth(plant: UntoldPlant) -> dict[str, float]:
    """Each number as `identify` gives it: of thrusters that on average give what is commanded."""
    real, gain = plant.parameters, float(plant.thrust_gains.mean())
    cable = real.suspension
    assert cable is not None
    per_gain = {
        "body.mass_kg": real.mass,
        **{f"body.inertia_kg_m2.{i}": float(real.inertia[i]) for i in range(3)},
        "air.damping_n_s_m": real.air_damping,
        "air.damping_n_m_s": real.air_damping_rotation,
        "suspension.stiffness_n_m": cable.stiffness,
        "suspension.damping_n_s_m": cable.damping,
    }
    return {
        **{key: value / gain for key, value in per_gain.items()},
        "suspension.length_m": cable.length,
        "suspension.hook_above_com_m": cable.hook_above_com,
        "thrusters.lag_s": real.lag,
        "thrusters.delay_s": real.delay + LINK_S,
        **{f"thruster {i + 1}": g / gain for i, g in enumerate(plant.thrust_gains.tolist())},
    }


def find(seconds: float, seed: int) -> PlantFound:
    """Fly, identify, fly again with what was found."""
    robot_file = load_robot(ROBOT)
    plant = drawn(robot_file.plant, np.random.default_rng((seed, 17)))
    identified = found_in(robot_file, seed, plant, seconds)
    numbers, true = found_numbers(robot_file.plant, identified), truth(plant)
    off = {one.key: abs(one.found - true[one.key]) for one in numbers}
    told = [one for one in numbers if one.is_told]
    values, comments = file_numbers(robot_file.plant, numbers)
    text = (ROBOTS / f"{ROBOT}.toml").read_text()
    written = robot_of(tomllib.loads(with_numbers(text, values, comments)), "found")
    gain = plant.thrust_gains.mean()
    known = {"body.mass_kg": true["body.mass_kg"], "thrusters.lag_s": plant.parameters.lag}
    moments = (plant.parameters.inertia / gain).tolist()
    exact = {**known, "body.inertia_kg_m2": moments}
    perfect = robot_of(tomllib.loads(with_numbers(text, exact, dict.fromkeys(exact, ""))), "true")
    rms = [tracked(one, seed, plant) for one in (written, perfect)]
    moments_off = [off[one.key] / true[one.key] for one in told if "inertia" in one.key]
    return PlantFound(
        seed=seed,
        seconds=identified.seconds,
        untold=" ".join(one.key for one in numbers if not one.is_told),
        outside=" ".join(one.key for one in told if off[one.key] > one.half_95),
        numbers=len(told),
        mass_pct=100.0 * off["body.mass_kg"] / true["body.mass_kg"],
        lag_pct=100.0 * off["thrusters.lag_s"] / true["thrusters.lag_s"],
        inertia_pct=100.0 * max(moments_off, default=nan),
        ratio=rms[0] / rms[1],
    )


def found_in(
    robot_file: RobotFile, seed: int, plant: UntoldPlant, seconds: float
) -> IdentifiedPlant:
    """Fly, identify."""
    states = flown(robot_file, seed, plant, seconds)
    return identify(robot_file.plant, list(flights_of(states)))


def tracked(believed: RobotFile, seed: int, plant: UntoldPlant) -> float:
    """RMS error [mm] of a flight with another hand."""
    simulation = setting(believed).flight(seed + 5000, plant)
    return result_of(simulation.run(JUDGED_S), simulation.scene, 0.0).rms_mm


def break_one(seconds: float, number: int) -> Broken:
    """Fly a robot of which a thruster is reversed, or two are exchanged; what is said of it."""
    robot_file = load_robot(ROBOT)
    known = robot_file.plant
    rng = np.random.default_rng((FIRST_SEED, number))
    first, second = rng.choice(len(known.thruster_torques), 2, replace=False).tolist()
    order = np.arange(len(known.thruster_torques))
    signs = np.ones(len(order))
    if number % 2:
        order[[first, second]], what = [second, first], f"{first + 1} and {second + 1} exchanged"
    else:
        signs[first], what = -1.0, f"{first + 1} reversed"
    real = replace(
        known,
        thruster_positions_in_b=known.thruster_positions_in_b[order],
        thruster_directions_in_b=(known.thruster_directions_in_b * signs[:, None])[order],
        thruster_torques=known.thruster_torques[order],
    )
    plant = UntoldPlant(real, np.ones(len(order)))
    try:
        identified = found_in(robot_file, FIRST_SEED + number, plant, seconds)
    except IdentificationError as error:
        return Broken(what, 0.0, str(error), is_found=False)
    said = objections(identified)
    return Broken(what, identified.seconds, "; ".join(said), is_found=bool(said))


def goals(found: Sequence[PlantFound], broken: Sequence[Broken]) -> Iterator[tuple[bool, str]]:
    """(met, words) of each."""
    if found:
        numbers = sum(one.numbers for one in found)
        inside = numbers - sum(len(one.outside.split()) for one in found)
        words = (
            f"{inside} of {numbers} numbers in their 95 % intervals, {LEAST_INSIDE:.0%} at least"
        )
        yield inside >= LEAST_INSIDE * numbers, words
        worst = max(one.ratio for one in found)
        yield worst <= MOST_RATIO, f"RMS to the known robot's {worst:.2f}, at most {MOST_RATIO}"
    for one in broken:
        yield one.is_found, f"{one.what}: {one.said or 'nothing said'}"


COLUMNS: Final = (
    ("seed", "seed", "{}"),
    ("seconds", "flown s", "{:.0f}"),
    ("mass_pct", "mass off %", "{:.1f}"),
    ("inertia_pct", "inertia off %", "{:.1f}"),
    ("lag_pct", "lag off %", "{:.1f}"),
    ("numbers", "told", "{}"),
    ("ratio", "RMS ratio", "{:.2f}"),
    ("outside", "not in its interval", "{}"),
)


def main() -> int:
    """Fly, identify, judge."""
    parser = Parser(prog="python -m tests.bench.bench_identify", description=__doc__)
    parser.add_argument("--plants", type=int, default=30)
    parser.add_argument("--broken", type=int, default=5)
    parser.add_argument("--seconds", type=float, default=45.0)
    parser.add_argument("--workers", type=int, default=1)
    arguments = parser.parse_args()
    seeds = range(FIRST_SEED, FIRST_SEED + arguments.plants)
    find_one = partial(find, arguments.seconds)
    one_broken = partial(break_one, arguments.seconds)
    found = list(processes.each(find_one, seeds, arguments.workers))
    broken = list(processes.each(one_broken, range(arguments.broken), arguments.workers))
    print(table(COLUMNS, found), end="\n\n")
    held = list(goals(found, broken))
    for met, words in held:
        print(f"{'holds' if met else 'MISSED'}: {words}")
    return int(not all(met for met, _ in held))


if __name__ == "__main__":
    sys.exit(main())
