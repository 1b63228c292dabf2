"""People who align the laser with the tube: what they see, when they react, how their hands move.

The crossover model (McRuer, Jex 1967): a person makes hand and machine together an integrator of
the error seen, ω_c e^(−τs)/s, through the muscles' lag. Noise of eyes and hands is added to it.
"""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass, replace
from math import radians, sqrt
from typing import Final

import numpy as np

from hardware.sim.plant.laser_task import Laser, Tube
from hardware.sim.reference_trajectory import Pose
from pipeline.frames import Array, cross

SLANT_RAD: Final = radians(1.0)
"""By which a line across the line of sight may lean against another and seem parallel."""
EVIDENT: Final = 2.0
"""How many σ of sight a lean has to be before it is turned back."""
FLATTEST: Final = 0.1
"""Sine of the angle below which nobody tries to look onto a rim."""
FIXATION_S: Final = 0.5
"""For which an error of judgement lasts."""
EFFORT_S: Final = 0.2
"""For which an error of force lasts."""
SPEED_M_S: Final = 0.08
TURN_RAD_S: Final = radians(8.0)
"""Faster a careful hand does not go."""
LEAST_DELAY_S: Final = 0.1
"""Of eye and nerves: no practice shortens it."""
KEPT_S: Final = 1.0
"""How much of the hand's past is remembered, for late sensors."""


@dataclass(frozen=True, slots=True)
class Participant:
    """Parameters that differ between people."""

    name: str
    delay_s: float
    """From what is seen to what the muscles are told."""
    crossover: float
    """ω_c [rad/s]."""
    muscle_s: float
    """Time constant of two equal poles."""
    acuity_rad: float
    """Error in where the spot of light is seen, across the line of sight."""
    wander_m: float
    """RMS of the hand's own slow drift, one axis."""
    wander_rad: float
    tremor_m: float
    """RMS of the hand's trembling, one axis."""
    tremor_rad: float
    effort_noise: float
    """Standard deviation of a speed per speed: more effort, more noise (Harris, Wolpert 1998)."""
    practice: float
    """Exponent of the power law of practice (Newell, Rosenbloom 1981)."""

    def practised(self, attempt: int) -> Participant:
        """The participant at an attempt, counted from 1: quicker to react, and steadier."""
        share = float(attempt) ** -self.practice
        return replace(
            self,
            delay_s=LEAST_DELAY_S + share * (self.delay_s - LEAST_DELAY_S),
            wander_m=share * self.wander_m,
            wander_rad=share * self.wander_rad,
            effort_noise=share * self.effort_noise,
        )

    def sight_noise(self, p_seen_in_f: Array, length: float) -> Array:
        """(6,) σ of spot [m] and lean [rad] seen at a place from the eye's, x being depth.

        The tube's rim is looked at from above, flat: depth is only seen foreshortened. A tube of
        `length` [m] leans in depth by the difference of its ends'.
        """
        distance = float(np.linalg.norm(p_seen_in_f))
        across = self.acuity_rad * distance
        depth = across * distance / max(abs(float(p_seen_in_f[2])), FLATTEST * distance)
        return np.array([depth, across, across, SLANT_RAD, sqrt(2.0) * depth / length, 0.0])


@dataclass(slots=True, eq=False)
class _Drift:
    """Noise of σ = 1 with a memory (Ornstein, Uhlenbeck)."""

    rng: np.random.Generator
    memory_s: float
    value: Array

    def step(self, h: float) -> Array:
        kept = 1.0 - h / self.memory_s
        new = self.rng.standard_normal(self.value.shape)
        self.value = kept * self.value + sqrt(1.0 - kept**2) * new
        return self.value


def misalignment(laser: Laser, tube: Tube, body: Pose) -> Array:
    """(6,) in f: from the tube's middle to the beam there [m]; the turn that makes it parallel."""
    origin, direction = laser.beam(*body)
    spot = tube.offset((origin, direction), 0.0)
    spot = spot if np.isfinite(spot).all() else np.zeros(3)
    return np.concatenate((spot, cross(direction, -tube.axis_in_f)))


def remedy(seen: Array, p_tb_in_f: Array, axis_in_f: Array) -> Array:
    """(6,) level shift [m] and turn [rad] of the robot against a misalignment seen.

    The shift is what the turn about the robot leaves to do; the tube is at `p_tb_in_f` from it.
    """
    spot, turn = seen[:3], seen[3:]
    shift = -spot - cross(turn, p_tb_in_f + spot)
    level = shift - shift[2] / axis_in_f[2] * axis_in_f  # along the axis nothing changes
    return np.concatenate((level, turn))


class GuidingHand:
    """A hand's own motion (a `MotionComponent`): each `look` moves it by a period at what it sees.

    It goes around the robot where it turns, so that turns do not shift the robot.
    """

    def __init__(
        self, person: Participant, laser: Laser, tube: Tube, rng: np.random.Generator, h: float
    ) -> None:
        """Begin at rest; `h` [s] from one look to the next."""
        self._person, self._laser, self._tube, self._h = person, laser, tube, h
        self._seen: deque[Array] = deque(maxlen=round(person.delay_s / h) + 1)
        self._sight = _Drift(rng, FIXATION_S, rng.standard_normal(6))
        self._effort = _Drift(rng, EFFORT_S, rng.standard_normal(6))
        self._state = np.zeros((3, 6))
        self._steps: deque[tuple[Array, Array]] = deque(maxlen=round(KEPT_S / h))
        self._count = 0

    def look(self, body: Pose, hand: Pose) -> None:
        """See the robot as it is now, and do what was decided on a delay ago."""
        self._seen.append(self._sees(body, hand[1]))
        waiting = len(self._seen) < (self._seen.maxlen or 0)
        wanted = np.zeros(6) if waiting else self._person.crossover * self._seen[0]
        self._move(self._rate(wanted, body[1] - hand[1]))

    def _sees(self, body: Pose, p_eye_in_f: Array) -> Array:
        """Remedy (6,) as it seems to the person."""
        centre_in_f = self._tube.centre_in_f
        sigma = self._person.sight_noise(centre_in_f - p_eye_in_f, self._tube.length)
        seen = misalignment(self._laser, self._tube, body) + sigma * self._sight.step(self._h)
        evident = EVIDENT * sigma[3:]
        seen[3:] -= np.clip(seen[3:], -evident, evident)
        return remedy(seen, centre_in_f - body[1], self._tube.axis_in_f)

    def _rate(self, wanted: Array, p_bc_in_f: Array) -> Array:
        """(6,) the hand's, for a robot's wanted one; x, y, z, roll, pitch, yaw."""
        shift, turn = _at_most(wanted[:3], SPEED_M_S), _at_most(wanted[3:], TURN_RAD_S)
        turn = np.array([turn[0], turn[1], 0.0])
        rate = np.concatenate((shift - cross(turn, p_bc_in_f), turn))
        noisy: Array = rate * (1.0 + self._person.effort_noise * self._effort.step(self._h))
        return noisy

    def _move(self, rate: Array) -> None:
        """Move by the muscles' two poles; the jerk is constant for a period."""
        _, v, a = self._state
        T, h = self._person.muscle_s, self._h
        jerk = (rate - v) / T**2 - 2.0 * a / T
        self._steps.append((self._state, jerk))
        self._count += 1
        self._state = _taylor(self._state, jerk, h)

    def at(self, t: float) -> Array:
        """(3, 6): value, rate and acceleration at `t` [s] since the first look."""
        if not self._steps or t <= 0.0:
            return np.zeros((3, 6))
        oldest = self._count - len(self._steps)
        k = min(max(int(t / self._h), oldest), self._count - 1)
        return _taylor(*self._steps[k - oldest], t - k * self._h)


def _taylor(state: Array, jerk: Array, dt: float) -> Array:
    x, v, a = state
    return np.array(
        [
            x + dt * (v + dt * (0.5 * a + dt / 6.0 * jerk)),
            v + dt * (a + 0.5 * dt * jerk),
            a + dt * jerk,
        ]
    )


def _at_most(v: Array, limit: float) -> Array:
    """`v`, not longer than `limit`."""
    longest: Array = v * min(1.0, limit / max(float(np.linalg.norm(v)), 1e-12))
    return longest
