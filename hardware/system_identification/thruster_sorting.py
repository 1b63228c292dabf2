"""Which thruster of the file each one is, which way it pushes, and how the motion sensors sit.

Each thruster was given pulses alone; what the robot felt is held against what the file's thrusters
would make it feel. A thruster in another's place, one that pushes the other way and sensors that
are turned may look alike (a layout that a quarter turn brings onto itself), so all are judged at
once, and of what explains the pulses equally well the least is believed: one turned sensor before
eight exchanged thrusters.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from scipy.optimize import linear_sum_assignment
from scipy.signal import butter, sosfiltfilt

from hardware.plant_parameters import PlantParameters
from hardware.robot_physics import allocation_matrix
from hardware.system_identification.imu_attitude import ImuAttitude
from hardware.system_identification.thrust_response import thrust_response
from pipeline.config import PERIOD_S
from pipeline.estimation.rate_axes import WAYS
from pipeline.frames import Array

BAND_HZ: Final = (1.0, 10.0)
"""Below, the suspension answers; above, propellers shake."""
AFTER_S: Final = 0.5
"""Of a thruster's last pulse, that still belongs to it."""
LAGS_S: Final = tuple(0.001 * ms for ms in range(5, 81, 5))
"""Of a thruster, tried."""
LEAST_SHARE: Final = 0.2
"""Of what thrusters do on average: less, and it may as well be how the robot still swings by the
one before, of which a tenth was seen."""
CHANGED: Final = 0.25
"""What a thruster in another's place, or one reversed, must explain more to be believed; a thruster
that is explained wholly is 1 ..."""
TURNED: Final = 0.5
"""... and what turned sensors must."""
LEAST_LIKE: Final = 0.75
"""Cosine between what was felt and what should be: inertia that is off by 40 % leaves 0.9."""
LEAST_AHEAD: Final = 0.15
"""Of the best explanation before the next, likewise."""
LEAST_UPRIGHT: Final = 0.9
"""Cosine of how far from upright sensors may be that are said to sit so."""

TURNS: Final = WAYS[np.linalg.det(WAYS) > 0.0]
"""(24, 3, 3) by right angles."""


@dataclass(frozen=True, slots=True, eq=False)
class Felt:
    """What the robot felt of one thruster, per newton that it was told."""

    specific_force_in_s: Array
    """(3,) in the sensors' axes [1/kg]."""
    alpha_in_s: Array
    """(3,) angular acceleration [rad/s²/N]."""


@dataclass(frozen=True, slots=True, eq=False)
class Sorting:
    """What explains the pulses best."""

    R_bs: Array
    """(3, 3) from the axes in which samples came to the body's: the identity if sensors sit as the
    file, or the robot's firmware, says; else one of 23 turns by right angles."""
    order: tuple[int, ...]
    """Which thruster of the file each one is, from 0; itself if it gives nothing."""
    reversed: tuple[int, ...]
    """Those that push the other way, from 0 ..."""
    silent: tuple[int, ...]
    """... or not at all."""
    unclear: tuple[int, ...]
    """Those that are like none of the file's."""
    is_ambiguous: bool
    """Another explanation is as good."""

    @property
    def swapped(self) -> tuple[int, ...]:
        """Those in another one's place, from 0."""
        return tuple(i for i, k in enumerate(self.order) if i != k)

    @property
    def is_turned(self) -> bool:
        """Whether the sensors are."""
        return not np.array_equal(self.R_bs, np.eye(3))

    @property
    def is_but_for_plugs(self) -> bool:
        """Whether all is as the file says, or thrusters have changed places and nothing else."""
        odd = self.reversed or self.silent or self.unclear
        return not (odd or self.is_turned or self.is_ambiguous)

    @property
    def is_as_told(self) -> bool:
        """Whether all is as the file says."""
        return self.is_but_for_plugs and not self.swapped

    def built(self, known: PlantParameters) -> tuple[Array, Array, Array]:
        """Positions (m, 3), directions (m, 3) and torques (m,) in the order that was found."""
        order = list(self.order)
        signs = np.ones(len(order))
        signs[list(self.reversed)] = -1.0
        directions = known.thruster_directions_in_b[order] * signs[:, None]
        return (
            known.thruster_positions_in_b[order],
            directions,
            known.thruster_torques[order],
        )


def spans(commands: Array) -> list[tuple[int, int] | None]:
    """From when to when each thruster had its pulses, with what followed; None: it had none."""
    after, found = round(AFTER_S / PERIOD_S), []
    for column in commands.T:
        on = np.flatnonzero(column)
        found.append((int(on[0]), min(int(on[-1]) + after, len(commands))) if len(on) else None)
    return found


def felt_of(commands: Array, seen: ImuAttitude, delay: float) -> list[Felt | None]:
    """What was felt of each thruster, by commands (n, m) [N] that take `delay` [s] to act."""
    band = butter(2, BAND_HZ, "band", fs=1.0 / PERIOD_S, output="sos")
    alpha = sosfiltfilt(band, np.gradient(seen.omega_in_s, PERIOD_S, axis=0), axis=0)
    in_f = sosfiltfilt(band, np.einsum("nij,nj->ni", seen.R_fs, seen.force_in_s), axis=0)
    measured = np.hstack((np.einsum("nji,nj->ni", seen.R_fs, in_f), alpha))
    answers = [
        sosfiltfilt(band, thrust_response(commands, lag, delay, PERIOD_S), axis=0) for lag in LAGS_S
    ]
    found: list[Felt | None] = []
    for i, span in enumerate(spans(commands)):
        if span is None:
            found.append(None)
            continue
        window = slice(*span)
        best = max(
            (_fitted(answer[window, i], measured[window]) for answer in answers),
            key=lambda fit: fit[1],
        )[0]
        found.append(Felt(best[:3], best[3:]))
    return found


def _fitted(answer: Array, measured: Array) -> tuple[Array, float]:
    """What (n, 6) is per newton of the answer (n,), and how much of its turns that explains."""
    power = float(answer @ answer)
    by_newton: Array = answer @ measured / power
    return by_newton, power * float(by_newton[3:] @ by_newton[3:])


def sort(known: PlantParameters, felt: Sequence[Felt | None], up_in_s: Array) -> Sorting:
    """The simplest that explains all. `up_in_s` (3,): specific force in the rest."""
    arm = max(float(np.linalg.norm(known.thruster_positions_in_b, axis=1).mean()), 1e-6)
    columns = allocation_matrix(
        known.thruster_positions_in_b, known.thruster_directions_in_b, known.thruster_torques
    )
    columns[3:] /= arm
    told = columns / np.linalg.norm(columns, axis=0)
    up = up_in_s / np.linalg.norm(up_in_s)
    ranked = sorted(
        (_judged(known, felt, told, arm, R_bs) for R_bs in TURNS if R_bs[2] @ up > LEAST_UPRIGHT),
        key=lambda one: one[0],
        reverse=True,
    )
    best = ranked[0][1] if ranked else _nothing(len(felt))
    rival = ranked[1][0] if len(ranked) > 1 else -np.inf
    ahead = ranked[0][0] - rival if ranked else 0.0
    return Sorting(
        best.R_bs, best.order, best.reversed, best.silent, best.unclear, ahead < LEAST_AHEAD
    )


def _judged(
    known: PlantParameters, felt: Sequence[Felt | None], told: Array, arm: float, R_bs: Array
) -> tuple[float, Sorting]:
    """How well sensors that are turned so explain it, by which thrusters."""
    in_b = np.array([_wrench(known, one, arm, R_bs) for one in felt])
    sizes = np.linalg.norm(in_b, axis=1)
    is_silent = sizes < LEAST_SHARE * np.median(sizes)
    like = (in_b / np.maximum(sizes, 1e-12)[:, None]) @ told
    like[is_silent] = 0.0
    own = np.eye(len(felt), dtype=bool)
    worth = np.maximum(np.where(own, like, like - CHANGED), -like - CHANGED)
    rows, columns = linear_sum_assignment(worth, maximize=True)
    matched = like[rows, columns]
    pairs = list(zip(rows.tolist(), columns.tolist(), strict=True))
    total = float(worth[rows, columns].sum()) - TURNED * (not np.array_equal(R_bs, np.eye(3)))
    return total, Sorting(
        R_bs,
        tuple(k for _, k in pairs),
        tuple(i for i, _ in pairs if matched[i] < 0.0 and not is_silent[i]),
        tuple(np.flatnonzero(is_silent).tolist()),
        tuple(i for i, _ in pairs if abs(matched[i]) < LEAST_LIKE and not is_silent[i]),
        is_ambiguous=False,
    )


def _wrench(known: PlantParameters, felt: Felt | None, arm: float, R_bs: Array) -> Array:
    """Force and torque per arm (6,), by the file's mass and inertia; zeros if it had no pulses."""
    if felt is None:
        return np.zeros(6)
    force = known.mass * (R_bs @ felt.specific_force_in_s)
    torque = known.inertia * (R_bs @ felt.alpha_in_s)
    return np.concatenate((force, torque / arm))


def _nothing(thrusters: int) -> Sorting:
    everything = tuple(range(thrusters))
    return Sorting(np.eye(3), everything, (), (), everything, is_ambiguous=True)
