"""Every number behind the figures that the paper does not give, and those of it that it does.

known: stands in the paper or follows from it; identified: fitted so that the simulated robot
reproduces Tables I and IV (`hardware/robots/ames.toml`); chosen: ours, plausible, not fitted.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import asdict, dataclass
from math import degrees
from typing import Literal

from hardware.plant_parameters import PlantParameters
from hardware.sim import person as people
from hardware.sim.person import Participant
from hardware.sim.render import RenderOptions
from pipeline.config import PERIOD_S
from pipeline.frames import Array
from server.experiments.paper.setup import published, task
from server.experiments.paper.setup.flight import HOVER_S, REST_S
from server.experiments.paper.setup.measure import WINDOW_S, ExperimentSetup
from server.simulation.sensors import PAPER, Leader, Pictures
from server.simulation.virtual_time import SimulationOptions

Status = Literal["known", "identified", "chosen"]


@dataclass(frozen=True, slots=True)
class Assumption:
    """One of them."""

    what: str
    value: str
    status: Status


def of(setup: ExperimentSetup) -> list[Assumption]:
    """Assumptions of the experiments as they are set up."""
    leader = sensors(setup.leader) if setup.leader == PAPER else phone_sensors(setup.leader)
    return [*method(), *leader, *plant(setup.robot_file.plant), *of_task()]


def method() -> Iterator[Assumption]:
    """How is it flown and judged?"""
    yield Assumption("gains", "Table II (a) with EKF, (b) without", "known")
    yield Assumption("control and filter", f"{1.0 / PERIOD_S:g} Hz", "known")
    yield Assumption("virtual camera", "τ = 3.18 s, 0.16 s (0.05 Hz)", "known")
    yield Assumption("window of RMS", f"{WINDOW_S:g} s from the start of the move", "identified")
    yield Assumption(
        "error", "what the controller sees, in b; true: against the simulated truth", "chosen"
    )
    yield Assumption("arm's velocity", "a triangle, 20 ms to turn the acceleration round", "chosen")
    yield Assumption(
        "hover before the move",
        f"{HOVER_S:g} s; the true error's mean over the last {REST_S:g} s of it is taken off",
        "chosen",
    )
    yield Assumption(
        "thrusts at their limits",
        "the paper's columns cut each (`lift`), as [26] knows no upper one; ours keeps the torque",
        "chosen",
    )
    yield Assumption("push of Fig. 9", f"{published.PUSH_N:g} N by the thrusters", "known")
    yield Assumption("noise of the EKF", "the project's defaults (`EkfConfig`)", "chosen")


def sensors(leader: Leader) -> Iterator[Assumption]:
    """The paper's handheld device."""
    o = leader.options
    yield Assumption("pictures", f"{o.frame_rate_hz:g} fps, the newest is taken", "known")
    yield Assumption("hand's IMU", f"{o.motion_rate_hz:g} Hz, no bias", "known")
    yield Assumption("its noise", "0.007 °/s/√Hz, 60 µg/√Hz (data sheet)", "known")
    yield Assumption("its delay", _ms(o.motion_delay_s), "chosen")
    yield Assumption("pictures' delay", _ms(o.picture_delay_s), "chosen")
    yield Assumption(
        "lens", f"10 mm: {leader.focal_px:g} px on {leader.width}x{leader.height}", "chosen"
    )
    yield from _common(leader)


def phone_sensors(leader: Leader) -> Iterator[Assumption]:
    """A phone on the same arm: nothing of it is the paper's."""
    o = leader.options
    yield Assumption("pictures", f"{o.frame_rate_hz:g} fps", "chosen")
    if leader.pictures != "spots":
        yield from _filmed(leader.pictures)
    yield Assumption("pictures' delay", _ms(o.picture_delay_s), "chosen")
    yield Assumption(
        "phone's IMU", f"{o.motion_rate_hz:g} Hz, {_ms(o.motion_delay_s)} late", "chosen"
    )
    yield Assumption("its rounding", "0.1 °/s, 0.1 m/s² (Chromium)", "known")
    yield Assumption("its biases", f"{o.bias_omega:g} rad/s, {o.bias_a:g} m/s²", "chosen")
    yield Assumption("clocks", "the phone's is known exactly", "chosen")
    yield Assumption("lens", f"{leader.focal_px:g} px on {leader.width}x{leader.height}", "chosen")
    yield from _common(leader)


def _filmed(codec: Pictures) -> Iterator[Assumption]:
    """Pictures that are rendered."""
    look = RenderOptions()
    # a JPEG's size follows from its quality
    rate = "" if codec == "jpeg" else f" at {1e-6 * SimulationOptions().bitrate_bps:g} Mbit/s"
    yield Assumption(
        "their way", f"rendered, {codec}{rate}, decoded, the server's vision looks", "chosen"
    )
    yield Assumption(
        "their light",
        f"{1e3 * look.exposure_s:g} ms exposure, all rows at once, LEDs of "
        f"{2e3 * look.led_radius_m:g} mm, a dim room without other lamps",
        "chosen",
    )


def _common(leader: Leader) -> Iterator[Assumption]:
    if leader.pictures == "spots":
        noise = f"{leader.noise_px:g} px per coordinate, white, names known: nothing is rendered"
        yield Assumption("LEDs' centres", noise, "chosen")
    yield Assumption(
        "derivative without EKF", f"low pass of {1e3 * leader.derivative_tau_s:g} ms", "chosen"
    )
    yield Assumption(
        "ours, unless wished otherwise",
        f"relative filter, gains {leader.gains}, feed-forward through a low pass of "
        f"{leader.feedforward_low_pass_hz:g} Hz",
        "chosen",
    )


def plant(plant: PlantParameters) -> Iterator[Assumption]:
    """The simulated robot; what each number rests on is said in its file."""
    hangs = plant.suspension
    yield Assumption("robot's mass", f"{plant.mass:g} kg", "identified")
    yield Assumption(
        "its inertia", " ".join(f"{x:g}" for x in plant.inertia) + " kg m²", "identified"
    )
    if hangs is not None:
        yield Assumption("cable", f"{hangs.length:g} m, {hangs.stiffness:g} N/m", "identified")
        yield Assumption(
            "its damping, hook",
            f"{hangs.damping:g} N s/m, {hangs.hook_above_com:g} m above the centre of mass",
            "chosen",
        )
    thrusters = len(plant.thruster_torques)
    yield Assumption("thrusters", f"{thrusters} on a cube's corners", "chosen")
    yield Assumption("largest thrust", f"{plant.f_max:g} N", "identified")
    yield Assumption(
        "thrusters' lag, delay",
        f"{1e3 * plant.lag:g} ms, {1e3 * plant.delay:g} ms with the link",
        "chosen",
    )
    yield Assumption("drag", f"{plant.air_damping:g} N s/m", "chosen")
    yield Assumption("body's IMU", "200 Hz, small MEMS: biases 0.5 °/s, 40 mg", "chosen")
    yield Assumption("LEDs", "five, on the arms", "known")
    yield Assumption("their places", "of the robot file", "chosen")


def _ms(span_s: tuple[float, float]) -> str:
    return f"{1e3 * span_s[0]:g}-{1e3 * span_s[1]:g} ms"


def lines(ones: Iterable[Assumption]) -> str:
    """One line each."""
    return "\n".join(f"  {one.status:<10} {one.what}: {one.value}" for one in ones)


def json(ones: Iterable[Assumption]) -> list[dict[str, str]]:
    """Values for programs."""
    return [asdict(one) for one in ones]


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
