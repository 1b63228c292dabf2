"""What a recorded bring-up tells: what is built wrongly, then what the robot is."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace
from math import degrees, pi, sqrt
from typing import Final

import numpy as np

from hardware.plant_parameters import PlantParameters
from hardware.robot_schema import axes_from_R
from hardware.system_identification.fit import (
    LINK_S,
    IdentificationError,
    IdentifiedPlant,
    identify_sampled,
)
from hardware.system_identification.flight_record import SampledFlight
from hardware.system_identification.imu_attitude import attitude_by_imu
from hardware.system_identification.mount_rotation import mount_rotation, thruster_lags, turned
from hardware.system_identification.plant_model import SpecificPlant
from hardware.system_identification.thruster_sorting import Sorting, felt_of, sort, spans
from pipeline.config import PERIOD_S
from pipeline.frames import GRAVITY, Array, exp
from server.tools.bring_up.pulses import RESTING
from server.tools.identify.findings import (
    NORMAL_95,
    WIDENED,
    FoundNumber,
    found_numbers,
    objections,
)
from server.tools.identify.recorded_flights import GAP_S, State

BEFORE_S: Final = 3.0
"""Of rest before the first pulse, that is looked at."""
MOST_OFF_RAD: Final = 0.1
"""By which sensors may sit beside before people are told to mend it."""
LAG_UNSURE_S: Final = 0.0007
"""What a lag of one thruster may be off by beside its own scatter: the delay is one for all."""


@dataclass(frozen=True, slots=True)
class ThrusterFound:
    """One thruster, as it is told."""

    number: int
    """From 1."""
    is_which: str
    """Of the file's, in words."""
    gives: float
    """Of what it is told, the mean of all being 1; NaN if it was not found out."""
    gives_95: float
    """Half of its 95 % interval."""
    lag_ms: float
    lag_95_ms: float


@dataclass(frozen=True, slots=True, eq=False)
class BroughtUp:
    """What a bring-up found."""

    sorting: Sorting
    known: PlantParameters
    """The file's, with thrusters as they are built."""
    identified: IdentifiedPlant | None
    """None where thrusters could not be told, or it hangs from what its file doesn't know."""
    numbers: list[FoundNumber]
    thrusters: list[ThrusterFound]
    mount_off: Array
    """(3,) rotation vector by which the sensors sit beside [rad] ..."""
    mount_off_95: Array
    """... and half of its 95 % intervals."""
    against: list[str]
    """What must be mended, in words."""

    @property
    def is_sound(self) -> bool:
        """Whether numbers may go into a file: nothing but plugs is exchanged."""
        return self.sorting.is_but_for_plugs and self.identified is not None


def brought_up(known: PlantParameters, states: Iterable[State]) -> BroughtUp:
    """What statuses of a bring-up tell of a robot whose file says `known`.

    Raises:
        IdentificationError: no bring-up, or one with a gap.
    """
    commands, omega_in_s, force_in_s = _sampled(list(states), len(known.thruster_torques))
    seen = attitude_by_imu(omega_in_s, force_in_s, known.imu)
    rest = force_in_s[: round(0.5 * BEFORE_S / PERIOD_S)].mean(axis=0)
    sorting = sort(known, felt_of(commands, seen, known.delay), rest)
    positions, directions, torques = sorting.built(known)
    built = replace(
        known,
        thruster_positions_in_b=positions,
        thruster_directions_in_b=directions,
        thruster_torques=torques,
    )
    nothing = np.full(3, np.nan)
    words = list(_wrong(sorting))
    if sorting.unclear or sorting.is_ambiguous or known.suspension is None:
        return BroughtUp(sorting, built, None, [], _named(sorting), nothing, nothing, words)
    R_bs = sorting.R_bs
    in_b = attitude_by_imu(omega_in_s @ R_bs.T, force_in_s @ R_bs.T, known.imu)
    flight = SampledFlight(commands, in_b.omega_in_s, in_b.force_in_s, in_b.R_fs)
    identified = identify_sampled(built, [flight], SpecificPlant.of(built, LINK_S))
    off, covariance = mount_rotation(built, flight, identified)
    flight = turned(flight, exp(off))
    identified = identify_sampled(built, [flight], identified.plant)
    numbers = found_numbers(built, identified)
    lags = thruster_lags(built, flight, identified, spans(commands))
    off_95 = NORMAL_95 * WIDENED * np.sqrt(np.diag(covariance))
    words += _askew(off, off_95)
    if not words:
        words += objections(identified)
    thrusters = _named(sorting, {one.key: one for one in numbers}, lags)
    return BroughtUp(sorting, built, identified, numbers, thrusters, off, off_95, words)


def _sampled(states: list[State], thrusters: int) -> tuple[Array, Array, Array]:
    """Commands (n, m), rates and specific forces (n, 3) each `PERIOD_S`, from rest to the end."""
    rests = [RESTING in state.reason for state in states]
    begun = [k for k, rest in enumerate(rests) if rest and not (k and rests[k - 1])]
    states = states[begun[-1] :] if begun else states  # of several beginnings the last
    told = np.array([row for state in states for row in state.commands])
    body = np.array([row for state in states for row in state.body_samples])
    if told.ndim != 2 or told.shape[1] != thrusters + 1 or not told[:, 1:].any() or len(body) < 2:
        raise IdentificationError(f"no bring-up of a robot with {thrusters} thrusters in it")
    body = body[np.unique(body[:, 0], return_index=True)[1]]
    on = np.flatnonzero(told[:, 1:].any(axis=1))
    begin = max(float(told[on[0], 0]) - BEFORE_S, float(told[0, 0]), float(body[0, 0]))
    t = np.arange(begin, min(float(told[-1, 0]), float(body[-1, 0])), PERIOD_S)
    gaps = [float(np.diff(times[times >= begin]).max()) for times in (told[:, 0], body[:, 0])]
    if max(gaps) > GAP_S:
        raise IdentificationError(f"a gap of {max(gaps):.2f} s in it: bring it up again")
    silent = [k + 1 for k in range(thrusters) if not told[:, k + 1].any()]
    if silent:
        numbers = ", ".join(map(str, silent))
        raise IdentificationError(f"it ended before thruster {numbers} had its turn")
    columns = [np.interp(t, told[:, 0], column) for column in told[:, 1:].T]
    samples = np.column_stack([np.interp(t, body[:, 0], column) for column in body[:, 1:].T])
    return np.column_stack(columns), samples[:, :3], samples[:, 3:]


def _named(
    sorting: Sorting,
    numbers: dict[str, FoundNumber] | None = None,
    lags: list[tuple[float, float] | None] | None = None,
) -> list[ThrusterFound]:
    found = []
    for i, of_file in enumerate(sorting.order):
        share = (numbers or {}).get(f"thruster {i + 1}")
        lag = lags[i] if lags else None
        which = f"{of_file + 1}" + ", reversed" * (i in sorting.reversed)
        which = "none: gives nothing" if i in sorting.silent else which
        found.append(
            ThrusterFound(
                i + 1,
                "unclear" if i in sorting.unclear else which,
                share.found if share else np.nan,
                share.half_95 if share else np.nan,
                1e3 * lag[0] if lag else np.nan,
                1e3 * NORMAL_95 * sqrt((WIDENED * lag[1]) ** 2 + LAG_UNSURE_S**2)
                if lag
                else np.nan,
            )
        )
    return found


def _wrong(sorting: Sorting) -> Iterable[str]:
    """What is built another way than the file says, and what to do."""
    if sorting.is_turned:
        axes = ", ".join(f'"{axis}"' for axis in axes_from_R(sorting.R_bs))
        yield (
            f"The motion sensors sit turned: along their axes {axes} lie the body's x, y, z. Turn"
            " them, or tell the robot's own computer (imu_axes in the file, else its firmware)."
        )
    for i in sorting.silent:
        yield f"Thruster {i + 1} gives nothing: is its plug in, is its propeller on?"
    for i in sorting.reversed:
        yield (
            f"Thruster {i + 1} pushes the other way: its motor turns backwards (exchange two of its"
            " wires), or its propeller is of the other hand (exchange the propeller)."
        )
    told = set()
    for i in sorting.swapped:
        k = sorting.order[i]
        if sorting.order[k] == i and (k, i) not in told:
            told.add((i, k))
            yield (
                f"Thrusters {i + 1} and {k + 1} are exchanged: exchange their plugs, or fly by a"
                " file that has them so."
            )
        elif sorting.order[k] != i:
            yield f"Thruster {i + 1} is where the file has {k + 1}: exchange plugs, or the file."
    for i in sorting.unclear:
        yield f"Thruster {i + 1} is like none of the file's: are its position and direction right?"
    if sorting.is_ambiguous:
        yield "Two explanations are as good: sensors or thrusters are not as the file says."


def _askew(off: Array, off_95: Array) -> Iterable[str]:
    angle = float(np.linalg.norm(off))
    if angle > MOST_OFF_RAD and angle > 2.0 * float(np.linalg.norm(off_95)):
        turns = ", ".join(f"{degrees(one):.0f}" for one in off.tolist())
        yield (
            f"The motion sensors sit {degrees(angle):.0f}° beside the body's axes (about x, y, z by"
            f" {turns}): straighten them, or the positions and directions of thrusters in the file."
        )


def periods(numbers: list[FoundNumber]) -> list[str]:
    """How the suspension swings, in words, as far as that was told."""
    by_key = {one.key: one for one in numbers if one.is_told}
    said, cable = [], by_key.get("suspension.length_m")
    if cable is not None:
        period = 2.0 * pi * sqrt(cable.found / GRAVITY)
        said.append(
            f"sways within {period:.2f} ± {0.5 * period * cable.half_95 / cable.found:.1g} s"
        )
    spring, mass = by_key.get("suspension.stiffness_n_m"), by_key.get("body.mass_kg")
    if spring is not None and mass is not None:
        period = 2.0 * pi * sqrt(mass.found / spring.found)
        said.append(
            f"bounces within {period:.2f} ± {0.5 * period * spring.half_95 / spring.found:.1g} s"
        )
    return said
