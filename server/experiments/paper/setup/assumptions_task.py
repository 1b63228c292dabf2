"""What Table III's task takes for granted beside what all experiments do."""

from __future__ import annotations

from collections.abc import Iterator
from math import degrees

from hardware.sim import person as people
from hardware.sim.person import Participant
from pipeline.frames import Array
from server.experiments.paper.setup import published, task
from server.experiments.paper.setup.assumption import Assumption


def of_task() -> Iterator[Assumption]:
    """The tube, the laser, and the two who align them."""
    tube, laser = task.TUBE, task.LASER
    yield Assumption(
        "tube's bore, tilt",
        f"{2e3 * tube.radius:g} mm, {published.TUBE_TILT_DEG:g}° from the vertical",
        "known",
    )
    yield Assumption(
        "task",
        f"held {published.HELD_S:g} s within {published.LIMIT_S:g} s, "
        f"{published.REPETITIONS} times with each flavour, in opposite orders",
        "known",
    )
    yield Assumption(
        "tube's length, place",
        f"{1e3 * tube.length:g} mm, {1e3 * task.REACH_M:g} mm under the robot when aligned, "
        f"which is {_mm(task.ALIGNED_IN_F)} mm from its start; leans across the line of sight",
        "chosen",
    )
    yield Assumption(
        "laser", f"at {_mm(laser.p_lb_in_b)} mm in b, along −z_b; the tube can't be hit", "chosen"
    )
    yield Assumption(
        "who begins without EKF", "operator 1; the paper says only that orders differ", "chosen"
    )
    yield Assumption("time of an attempt", "with the 3 s; 60 s where it failed", "chosen")
    for one in task.PEOPLE:
        yield Assumption(f"operator {one.name}", _who(one), "chosen")
    yield Assumption(
        "both operators",
        f"look from the camera, see a lean to {degrees(people.SLANT_RAD):g}° and act on one of "
        f"{people.EVIDENT:g}σ, move by at most {people.SPEED_M_S:g} m/s and "
        f"{degrees(people.TURN_RAD_S):g} °/s; of the delay {people.LEAST_DELAY_S:g} s stays",
        "chosen",
    )


def _who(one: Participant) -> str:
    return (
        f"{one.delay_s:g} s late, {one.crossover:g} rad/s, muscles {one.muscle_s:g} s, sees "
        f"{60.0 * degrees(one.acuity_rad):g}', drifts by {1e3 * one.wander_m:g} mm and "
        f"{degrees(one.wander_rad):g}°, trembles by {1e3 * one.tremor_m:g} mm and "
        f"{degrees(one.tremor_rad):g}°, {100.0 * one.effort_noise:g} % noise of effort, "
        f"practice n^−{one.practice:g}"
    )


def _mm(p_m: Array) -> str:
    return "(" + ", ".join(f"{1e3 * x:g}" for x in p_m) + ")"
