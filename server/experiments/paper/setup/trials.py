"""All attempts of Table III: who flies what, in which order, with which noise."""

from __future__ import annotations

from collections.abc import Generator, Iterator, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from hardware.robot_file import RobotFile
from pipeline.config import TeleopConfig
from server.experiments import processes
from server.experiments.paper.setup import published
from server.experiments.paper.setup.measure import ExperimentSetup
from server.experiments.paper.setup.task import PEOPLE, Attempt, attempt
from server.experiments.paper.setup.variants import WITH_EKF, WITHOUT_EKF, Variant, config_of
from server.simulation.sensors import Leader

ORDERS: Final = {
    "1": (WITHOUT_EKF.name, WITH_EKF.name),
    "2": (WITH_EKF.name, WITHOUT_EKF.name),
}
"""Which flavour each person flies first; the paper says only that they differ."""


@dataclass(frozen=True, slots=True, eq=False)
class Trial:
    """An attempt to be flown; another process can."""

    robot_file: RobotFile
    leader: Leader
    config: TeleopConfig
    variant: str
    person: int
    """Of `PEOPLE`."""
    repetition: int
    """From 1, with this variant."""
    seed: int

    @property
    def name(self) -> str:
        """Name of the person."""
        return PEOPLE[self.person].name

    @property
    def number(self) -> int:
        """Number of the attempt, from 1. A variant not in the paper is where its EKF is."""
        order = ORDERS[self.name]
        place = order.index(self.variant if self.variant in order else WITH_EKF.name)
        return place * published.REPETITIONS + self.repetition


def fly(trial: Trial) -> Attempt:
    """Fly with the same noise of hands, eyes and sensors, so that only the variant differs."""
    seed = np.random.SeedSequence((trial.seed, trial.person, trial.repetition))
    return attempt(
        trial.robot_file,
        trial.config,
        trial.leader,
        PEOPLE[trial.person].practised(trial.number),
        int(seed.generate_state(1)[0] >> 1),
    )


def _fly(numbered: tuple[int, Trial]) -> tuple[int, Attempt]:
    return numbered[0], fly(numbered[1])


def flown(trials: Sequence[Trial], workers: int) -> Generator[tuple[int, Attempt], None, None]:
    """What came of each, with its place in `trials`, as they come."""
    if workers > 1:
        return processes.each(_fly, enumerate(trials), min(workers, len(trials)))
    return (_fly(numbered) for numbered in enumerate(trials))


def trials_of(setup: ExperimentSetup, variants: Sequence[Variant]) -> Iterator[Trial]:
    """In order of seed, person, variant, repetition."""
    for seed in setup.seeds:
        for person in range(len(PEOPLE)):
            for variant in variants:
                config = config_of(setup.robot_file, variant, setup.leader)
                for repetition in range(1, published.REPETITIONS + 1):
                    yield Trial(
                        setup.robot_file,
                        setup.leader,
                        config,
                        variant.name,
                        person,
                        repetition,
                        seed,
                    )
