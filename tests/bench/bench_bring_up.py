"""`lightleash robot bring-up` on robots that are not what their file says, in virtual time.

    python -m tests.bench.bench_bring_up [--plants 30] [--wrong 5] [--workers 1]

Each plant is drawn as `experiments plants` draws them, with sensors that sit up to three degrees
beside, and propellers that shake them. Of the first ones two plugs are exchanged, a motor turns
backwards, a propeller is of the other hand, or sensors are turned, too. All goes by the link,
watchdog and session of the command. Then control flies each sound robot by the file that was
written, and by one with the true numbers. The exit code is 1 if a goal is missed.
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
from typing import Any, Final

os.environ.setdefault("OMP_NUM_THREADS", "1")

sys.path.insert(0, str(Path(__file__).parents[2]))

import numpy as np

from hardware.robot_file import ROBOTS, load_robot, robot_of
from hardware.robot_text import with_numbers
from hardware.sim.plant.built import AsBuilt
from hardware.sim.virtual_time_follower import VirtualTimeFollower
from server.common.options import Parser
from server.common.text import dashed
from server.control.ipc import ControlStatus
from server.control.robot_clock import RobotLink
from server.experiments import processes
from server.experiments.plants import UntoldPlant, drawn
from server.tools.bring_up import session
from server.tools.bring_up.command import written
from server.tools.bring_up.findings import BroughtUp, brought_up
from server.tools.bring_up.pulses import PulseProgramme
from tests.bench.bench_identify import LEAST_INSIDE, MOST_RATIO, tracked, truth

ROBOT: Final = "ames"
FIRST_SEED: Final = 2100
MOST_ASKEW_DEG: Final = 3.0
SHAKES: Final = (0.02, 0.5)
"""Amplitudes at most of rate [rad/s] and specific force [m/s²]."""


@dataclass(frozen=True, slots=True)
class Row:
    """One plant."""

    seed: int
    built: str
    """What is wrong with it, or ""."""
    said: str
    """What of its wiring bring-up has against it."""
    is_right: bool
    """What was said is what is wrong, and nothing else."""
    numbers: int
    """That were told, those of thrusters and sensors among them."""
    outside: str
    """Those whose interval misses the truth."""
    mass_pct: float
    lag_pct: float
    gain_pct: float
    """The worst thruster."""
    askew_deg: float
    """How far the sensors' mounting was missed."""
    ratio: float
    """RMS error with the file that was written, to that with the true numbers."""


def built_wrong(rng: np.random.Generator, number: int) -> tuple[dict[str, Any], str]:
    """A mistake of a kind by its number, and its words: those that must be said."""
    first, second = (rng.choice(8, 2, replace=False) + 1).tolist()
    order = list(range(1, 9))
    order[first - 1], order[second - 1] = second, first
    low, high = sorted((first, second))
    swapped = f"{low} and {high} exchanged"
    kinds: list[tuple[dict[str, Any], str]] = [
        ({"order": order}, swapped),
        ({"backward": [{"thruster": first}]}, f"{first} reversed"),
        ({"backward": [{"thruster": first, "why": "propeller"}]}, f"{first} reversed"),
        ({"order": order, "imu_axes": ["y", "-x", "z"]}, f"{swapped}, sensors turned"),
        ({"order": order, "backward": [{"thruster": first}]}, f"{swapped}, {first} reversed"),
    ]
    return kinds[number % len(kinds)]


def said_of(found: BroughtUp) -> str:
    """What was found of the wiring, as `built_wrong` words it."""
    sorting, words = found.sorting, []
    pairs = [(i, k) for i, k in enumerate(sorting.order) if i < k and sorting.order[k] == i]
    words += [f"{i + 1} and {k + 1} exchanged" for i, k in pairs]
    words += [f"{i + 1} moved" for i in sorting.swapped if sorting.order[sorting.order[i]] != i]
    words += [f"{i + 1} reversed" for i in sorting.reversed]
    words += [f"{i + 1} silent" for i in sorting.silent]
    words += [f"{i + 1} unclear" for i in sorting.unclear]
    words += ["sensors turned"] * sorting.is_turned + ["ambiguous"] * sorting.is_ambiguous
    return ", ".join(words)


def brought(real: AsBuilt, plant: UntoldPlant, seed: int) -> list[ControlStatus]:
    """Statuses as the recording of a bring-up has them."""
    known = load_robot(ROBOT)
    body = replace(known, plant=real.plant(plant.parameters))
    follower = VirtualTimeFollower(body, seed, options=real.options())
    follower.plant.thruster_health[:] = plant.thrust_gains * real.thrust_gains(8)

    def wait() -> float:
        follower.advance()
        return follower.t

    states: list[ControlStatus] = []
    stand, link = PulseProgramme(known), RobotLink(follower)
    session.run(
        stand,
        follower,
        link,
        wait,
        lambda state, _: states.append(state),
        lambda: "",
        lambda _: None,
    )
    if stand.stopped:
        raise RuntimeError(f"seed {seed}: {stand.stopped}")
    return states


def find(wrong: int, seed: int) -> Row:
    """Bring one up, judge what was found, fly it if it is sound."""
    known, rng = load_robot(ROBOT), np.random.default_rng((seed, 23))
    plant = drawn(known.plant, np.random.default_rng((seed, 17)))
    number = seed - FIRST_SEED
    mistake, words = built_wrong(rng, number) if number < wrong else ({}, "")
    off_deg = rng.uniform(-1.0, 1.0, 3) * MOST_ASKEW_DEG / np.sqrt(3.0)
    shakes = rng.uniform(0.0, SHAKES)
    vibration = {
        "hz": float(rng.uniform(30.0, 90.0)),
        "rate_rad_s": float(shakes[0]),
        "force_m_s2": float(shakes[1]),
    }
    real = AsBuilt.model_validate(
        {**mistake, "imu_off_deg": off_deg.tolist(), "vibration": vibration}
    )
    found = brought_up(known.plant, brought(real, plant, seed))
    said = said_of(found)
    if found.identified is None:
        return Row(seed, words, said, said == words, 0, "", nan, nan, nan, nan, nan)
    gains = plant.thrust_gains * real.thrust_gains(8)
    true = truth(replace(plant, thrust_gains=gains))
    told = [one for one in found.numbers if one.is_told]
    missed = [one.key for one in told if abs(one.found - true[one.key]) > one.half_95]
    lag_ms = 1e3 * plant.parameters.lag
    lags = [one for one in found.thrusters if abs(one.lag_ms - lag_ms) > one.lag_95_ms]
    missed += [f"lag {one.number}" for one in lags]
    askew = np.abs(np.degrees(found.mount_off) + off_deg)
    missed += ["mount"] * int((askew > np.degrees(found.mount_off_95)).sum())
    share = {one.key: abs(one.found - true[one.key]) / true[one.key] for one in told}
    return Row(
        seed=seed,
        built=words,
        said=said,
        is_right=said == words,
        numbers=len(told) + len(found.thrusters) + 3,
        outside=" ".join(missed),
        mass_pct=100.0 * share["body.mass_kg"],
        lag_pct=100.0 * share["thrusters.lag_s"],
        gain_pct=100.0 * max(share[f"thruster {i}"] for i in range(1, 9)),
        askew_deg=float(askew.max()),
        ratio=nan if words else _ratio(found, plant, true, seed),
    )


def _ratio(found: BroughtUp, plant: UntoldPlant, true: dict[str, float], seed: int) -> float:
    """Flown with the file that is written, to flown with the true numbers; by straight sensors."""
    text = (ROBOTS / f"{ROBOT}.toml").read_text()
    file = robot_of(tomllib.loads(written(text, found, "bench")), "found")
    moments = [true[f"body.inertia_kg_m2.{i}"] for i in range(3)]
    exact = {"body.mass_kg": true["body.mass_kg"], "thrusters.lag_s": plant.parameters.lag}
    numbers = {**exact, "body.inertia_kg_m2": moments}
    perfect = robot_of(
        tomllib.loads(with_numbers(text, numbers, dict.fromkeys(numbers, ""))), "true"
    )
    rms = [tracked(one, seed, plant) for one in (file, perfect)]
    return rms[0] / rms[1]


def goals(rows: Sequence[Row], wrong: int) -> Iterator[tuple[bool, str]]:
    """(met, words) of each."""
    bad, good = rows[:wrong], rows[wrong:]
    named = sum(one.is_right for one in bad)
    yield named == len(bad), f"{named} of {len(bad)} that are built wrongly are named rightly"
    false = sum(bool(one.said) for one in good)
    yield false == 0, f"{false} of {len(good)} that are built as told are called wrong"
    numbers = sum(one.numbers for one in rows)
    inside = numbers - sum(len(one.outside.replace("lag ", "lag_").split()) for one in rows)
    least = f"{LEAST_INSIDE:.0%} at least"
    yield (
        inside >= LEAST_INSIDE * numbers,
        f"{inside} of {numbers} numbers in their intervals, {least}",
    )
    worst = max((one.ratio for one in good), default=nan)
    yield worst <= MOST_RATIO, f"RMS to the known robot's {worst:.2f}, at most {MOST_RATIO}"


COLUMNS: Final = (
    ("seed", "seed", "{}"),
    ("built", "built", "{}"),
    ("said", "said", "{}"),
    ("numbers", "told", "{}"),
    ("mass_pct", "mass off %", "{:.1f}"),
    ("lag_pct", "lag off %", "{:.1f}"),
    ("gain_pct", "thruster off %", "{:.1f}"),
    ("askew_deg", "sensors off °", "{:.2f}"),
    ("ratio", "RMS ratio", "{:.2f}"),
    ("outside", "not in its interval", "{}"),
)


def main() -> int:
    """Bring up, judge."""
    parser = Parser(prog="python -m tests.bench.bench_bring_up", description=__doc__)
    parser.add_argument("--plants", type=int, default=30)
    parser.add_argument("--wrong", type=int, default=5)
    parser.add_argument("--workers", type=int, default=1)
    arguments = parser.parse_args()
    seeds = range(FIRST_SEED, FIRST_SEED + arguments.plants)
    found = processes.each(partial(find, arguments.wrong), seeds, arguments.workers)
    rows = sorted(found, key=lambda row: row.seed)
    print(dashed(COLUMNS, rows), end="\n\n")
    held = list(goals(rows, arguments.wrong))
    for met, words in held:
        print(f"{'holds' if met else 'MISSED'}: {words}")
    return int(not all(met for met, _ in held))


if __name__ == "__main__":
    sys.exit(main())
