"""Hands that lead a robot beyond its reach, and what came of them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.interpolate import make_interp_spline

from hardware.robot_file import load_robot
from hardware.sim.hand import MovingHand, steady_wander, tremor
from hardware.sim.hand_parts import Keyed
from pipeline.config import TeleopConfig
from pipeline.control.reach import ThrustReach
from pipeline.frames import Array
from pipeline.signals import Mode
from server.simulation.virtual_time import SimulationOptions, VirtualTimeSimulation

AMES = load_robot("ames")
PERIOD_S = 0.005
START_IN_F = np.array([-2.5, 0.0, 0.0])
GO_AT_S, STAY_S, AFTER_S = 2.0, 5.0, 3.0
MOST_AT_LIMIT_S = 0.5
TOLD_S = 0.1


@dataclass(frozen=True)
class BeyondFlight:
    """What came of a hand that left the reach."""

    at_f_max_s: float
    """Longest that one thruster was at its upper limit [s]."""
    told_late_s: float
    """From the reference's leaving the reach, as it truly was, to the word of it [s]."""
    back_mm: float
    """The robot from its reference, once the hand has come back."""
    left: str
    modes: set[Mode]


def beyond(seed: int, config: TeleopConfig, stay_s: float = STAY_S) -> BeyondFlight:
    """A hand goes somewhere 0.3 to 0.45 m away, in 1.5 to 3 s, stays and comes back."""
    rng = np.random.default_rng((seed, 29))
    away = rng.normal(size=3)
    away *= rng.uniform(0.3, 0.45) / np.linalg.norm(away)
    go_s = rng.uniform(1.5, 3.0)
    there = np.concatenate((away, np.zeros(3)))
    still = [(order, np.zeros(6)) for order in (1, 2)]
    knots = GO_AT_S + np.array([0.0, go_s, go_s + stay_s, 2.0 * go_s + stay_s])
    legs = [
        Keyed(make_interp_spline(knots[k : k + 2], [0.0 * there, way], k=5, bc_type=(still, still)))
        for k, way in ((0, there), (2, -there))
    ]
    parts = (*legs, steady_wander(rng), tremor(rng))
    hand = MovingHand(parts, START_IN_F, np.zeros(3), 0.0)
    scene = SimulationOptions(seed=seed, led_noise_px=0.3, knows_clock=True)
    sim = VirtualTimeSimulation(AMES, config, scene, hand=hand)
    rest = sim.truth()[1][1]
    modes, told = set(), []
    while sim.t < knots[-1] + AFTER_S:
        output = sim.advance()
        if len(sim.trace.t) > len(told):
            told.append(output.at_limit)
            modes.add(output.failsafe.mode)
    trace = sim.trace
    reach = ThrustReach(AMES.robot, config.leash.kept * AMES.robot.f_max)
    stiffness = AMES.robot.stiffness_in_f
    left = [reach.taken(stiffness * (p - rest))[0] > 1.0 for p in trace.intended_in_f]
    first, said = int(np.argmax(left)), int(np.argmax(told)) if any(told) else len(told)
    assert left[first]
    full = np.array(trace.thrusts) > AMES.robot.f_max - 1e-6
    late = np.array(trace.error_in_f)[-100:]
    return BeyondFlight(
        at_f_max_s=PERIOD_S * longest(full),
        told_late_s=PERIOD_S * (said - first),
        back_mm=1e3 * float(np.sqrt((late**2).sum(axis=1).mean())),
        left=trace.left,
        modes=modes,
    )


def longest(full: Array) -> int:
    """Rows for which one column (n, m) stays true."""
    most, run = 0, np.zeros(full.shape[1], dtype=int)
    for row in full:
        run = (run + 1) * row
        most = max(most, int(run.max()))
    return most
