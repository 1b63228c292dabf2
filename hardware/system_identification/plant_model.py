"""Accelerations that a robot's thrusters give it, for numbers of its plant: small motions.

Everything is per mass: motion sensors can't tell a heavy robot with strong thrusters from a light
one with weak ones. The cable pulls the hook back, sideways as a pendulum and along as a spring; how
far the robot has moved follows from the thrusts alone, not from what the accelerometer says
(output error, Ljung, System Identification (1999), ch. 4): its noise, twice integrated, would
be taken for motion and make all numbers smaller.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Final, TypeAlias

import numpy as np
from scipy.signal import bilinear, butter, lfilter, sosfiltfilt

from hardware.plant_parameters import BodyImuParameters, PlantParameters
from hardware.robot_physics import allocation_matrix
from hardware.system_identification.flight_record import SampledFlight
from hardware.system_identification.thrust_response import thrust_response
from pipeline.config import PERIOD_S
from pipeline.frames import GRAVITY, Array

BAND_HZ: Final = (0.5, 10.0)
"""Below, biases and the estimate's errors of attitude are as large as what thrusters do; above,
noise is."""
ENDS_S: Final = 2.0
"""Of a flight, spoilt by the filters that cut the band out."""
LEAST: Final = 0.05
"""Of inertia and stiffness that a file says."""
EVERY: Final = 5
"""Periods from one residual to the next: 40 Hz for a band of 10."""
KEPT: Final = 16
"""Springs that are remembered: of two axes, and of each way from there that a fit tries."""
Poles: TypeAlias = tuple[float, float, float]
"""Of a mass of 1 kg on a damped spring: 1, damping [1/s], stiffness [1/s²]."""


@dataclass(frozen=True, slots=True, eq=False)
class SpecificPlant:
    """A plant's numbers per mass, and those of its thrusters."""

    thrust: Array
    """(m,) what each gives of what is commanded [1/kg]."""
    lag: float
    """[s]."""
    delay: float
    """From a command of control to the thruster, link included [s]."""
    inertia: Array
    """(3,) [m²]."""
    air_rotation: float
    """[m²/s]."""
    air: float
    """[1/s]."""
    sideways: float = 0.0
    """Stiffness of the pendulum [1/s²], 0 of a robot that hangs from nothing; so are the others."""
    along: float = 0.0
    """Stiffness of the cable [1/s²]."""
    damping: float = 0.0
    """Of the cable, along it [1/s]."""
    hook: float = 0.0
    """Above the centre of mass [m]."""

    @classmethod
    def of(cls, plant: PlantParameters, link_s: float) -> SpecificPlant:
        """That of a robot file, whose link takes `link_s` [s]."""
        mass, cable = plant.mass, plant.suspension
        free = cls(
            np.full(len(plant.thruster_torques), 1.0 / mass),
            plant.lag,
            plant.delay + link_s,
            plant.inertia / mass,
            plant.air_damping_rotation / mass,
            plant.air_damping / mass,
        )
        if cable is None:
            return free
        return cls.unpacked(
            np.concatenate(
                (
                    free.packed,
                    (GRAVITY / cable.length, cable.stiffness / mass),
                    (cable.damping / mass, cable.hook_above_com),
                )
            ),
            len(free.thrust),
        )

    @property
    def hangs(self) -> bool:
        """Whether it hangs from a cable."""
        return self.sideways > 0.0

    @property
    def packed(self) -> Array:
        """All numbers that are to be found, (m + 7,) or, of one that hangs, (m + 11,)."""
        free = (*self.thrust, self.lag, self.delay, *self.inertia, self.air_rotation, self.air)
        cable = (self.sideways, self.along, self.damping, self.hook)
        return np.array((*free, *cable) if self.hangs else free)

    @property
    def scales(self) -> Array:
        """What is a small change of each of `packed`, also of one that is 0."""
        small = SpecificPlant(
            np.full(len(self.thrust), 0.01), 0.005, 0.005, np.full(3, 1e-4), 1e-3, 0.05
        )
        if self.hangs:
            small = replace(small, sideways=0.5, along=0.5, damping=0.1, hook=0.01)
        return np.maximum(self.packed, small.packed)

    @property
    def least(self) -> Array:
        """What each of `packed` can't be below; a thruster may push the wrong way."""
        free = SpecificPlant(
            np.full(len(self.thrust), -np.inf), 1e-3, 0.0, LEAST * self.inertia, 0.0, 0.0
        )
        if self.hangs:
            free = replace(free, sideways=LEAST * self.sideways, along=LEAST * self.along)
        return free.packed

    @classmethod
    def unpacked(cls, numbers: Array, thrusters: int) -> SpecificPlant:
        """The same from `packed`."""
        lag, delay, *inertia = numbers[thrusters : thrusters + 5].tolist()
        free = cls(
            numbers[:thrusters], lag, delay, np.array(inertia), *numbers[thrusters + 5 :][:2]
        )
        if len(numbers) == thrusters + 7:
            return free
        sideways, along, damping, hook = numbers[thrusters + 7 :].tolist()
        return replace(free, sideways=sideways, along=along, damping=damping, hook=hook)


class PlantModel:
    """One flight, held against plants."""

    def __init__(self, known: PlantParameters, flight: SampledFlight) -> None:
        """`known` says where the thrusters are and which way they push."""
        torques = known.thruster_torques
        directions = known.thruster_directions_in_b
        self._A = allocation_matrix(known.thruster_positions_in_b, directions, torques)
        self._flight = flight
        low = butter(2, BAND_HZ[0], "high", fs=1.0 / PERIOD_S, output="sos")
        self._band = np.vstack((low, butter(3, BAND_HZ[1], fs=1.0 / PERIOD_S, output="sos")))
        alpha = np.gradient(flight.omega_in_b, PERIOD_S, axis=0)
        # on average nobody accelerates: what the accelerometer says beside gravity is its bias,
        # which turns with the robot and would be taken for motion
        bias_in_b = (flight.force_in_b - GRAVITY * flight.R_fb[:, 2]).mean(axis=0)
        force_in_f = np.einsum("nij,nj->ni", flight.R_fb, flight.force_in_b - bias_in_b)
        self._force_in_f, self._alpha = self._cut(force_in_f), self._cut(alpha)
        self._swings = lru_cache(maxsize=KEPT)(self._swings_of)

    @property
    def measured(self) -> Array:
        """(k, 6) acceleration in f [m/s²] and angular acceleration in b [rad/s²], in the band."""
        return np.hstack((self._force_in_f, self._alpha))

    def noise(self, imu: BodyImuParameters) -> Array:
        """(6,) standard deviations of `measured` by the sensors alone."""
        impulse = np.zeros(len(self._flight.commands))
        impulse[len(impulse) // 2] = 1.0
        rate_hz = 1.0 / PERIOD_S
        gains = [
            float(np.linalg.norm(sosfiltfilt(self._band, signal)))
            for signal in (impulse, np.gradient(impulse, PERIOD_S))
        ]
        densities = np.array((imu.acc_noise, imu.gyro_noise)) * np.sqrt(0.5 * rate_hz)
        steps = np.array((imu.acc_step, imu.gyro_step)) / np.sqrt(12.0)
        return np.repeat(np.array(gains) * np.hypot(densities, steps), 3)

    def residuals(self, plant: SpecificPlant) -> Array:
        """(k, 6) measured less predicted, as `measured`."""
        flight = self._flight
        response = thrust_response(flight.commands, plant.lag, plant.delay, PERIOD_S)
        wrench = (response * plant.thrust) @ self._A.T
        pushed_in_f = np.einsum("nij,nj->ni", flight.R_fb, wrench[:, :3])
        off, pulled_in_b = self._pulled(plant, pushed_in_f)
        arm = plant.hook * np.array((0.0, 0.0, 1.0))
        omega = flight.omega_in_b
        turned = wrench[:, 3:] + np.cross(arm, pulled_in_b) - plant.air_rotation * omega
        turned -= np.cross(omega, omega * plant.inertia)
        return np.hstack((off, self._alpha - self._cut(_as_differences(turned / plant.inertia))))

    def _pulled(self, plant: SpecificPlant, pushed_in_f: Array) -> tuple[Array, Array]:
        """What of the acceleration is left (k, 3), and the cable's pull (n, 3) in b [m/s²].

        How the robot moved as the flight began nobody knows: the swing that explains most of what
        is left, two numbers for each axis, is taken for it.
        """
        hook = plant.hook * self._flight.R_fb[:, :, 2]
        hook = hook - hook.mean(axis=0)
        stiffness = np.array((plant.sideways, plant.sideways, plant.along))
        damping = plant.air + np.array((0.0, 0.0, plant.damping))
        force = pushed_in_f - pushed_in_f.mean(axis=0) - stiffness * hook
        left, pull_in_f = np.empty_like(self._force_in_f), np.empty_like(force)
        for axis in range(3):
            poles = (1.0, float(damping[axis]), float(stiffness[axis]))
            swings, columns = self._swings(poles)
            motion = _moved(force[:, axis], poles)
            off = self._force_in_f[:, axis] - self._cut(motion[2])
            shares, *_ = np.linalg.lstsq(columns, off)
            left[:, axis] = off - columns @ shares
            place, speed, _ = motion + np.tensordot(shares, swings, axes=1)
            pull_in_f[:, axis] = -stiffness[axis] * (place + hook[:, axis])
            pull_in_f[:, axis] -= (damping[axis] - plant.air) * speed
        pull_in_f[:, 2] += GRAVITY
        return left, np.einsum("nji,nj->ni", self._flight.R_fb, pull_in_f)

    def _swings_of(self, poles: Poles) -> tuple[list[Array], Array]:
        """Motions (3, n) after a kick to speed and to place, and what is seen of each (k, 2)."""
        start = np.zeros(len(self._flight.commands))
        start[0] = 1.0 / PERIOD_S
        swings = [_moved(kick, poles) for kick in (start, np.gradient(start, PERIOD_S))]
        return swings, np.column_stack([self._cut(swing[2]) for swing in swings])

    def _cut(self, signal: Array) -> Array:
        """What of a signal (n, ...) is in the band, without its ends, `EVERY` so many periods."""
        ends = round(ENDS_S / PERIOD_S)
        inner: Array = sosfiltfilt(self._band, signal, axis=0)[ends:-ends:EVERY]
        return inner


def _moved(force: Array, poles: Poles) -> Array:
    """Place, speed and acceleration (3, n) of a mass of 1 kg on a damped spring."""
    return np.array([lfilter(b, a, force) for b, a in _filters(poles)])


@lru_cache(maxsize=KEPT)
def _filters(poles: Poles) -> list[tuple[Array, Array]]:
    """For place, speed and acceleration; most of what a fit costs, if worked out each time."""
    numerators = ((0.0, 0.0, 1.0), (0.0, 1.0, 0.0), (1.0, 0.0, 0.0))
    return [bilinear(numerator, poles, fs=1.0 / PERIOD_S) for numerator in numerators]


def _as_differences(alpha: Array) -> Array:
    """Angular acceleration (n, 3) as differences of a rate give it: its mean over two periods.

    By Simpson's rule; without it thrusters seem to lag by what the differences smear.
    """
    smeared = alpha.copy()
    smeared[1:-1] = (alpha[:-2] + 4.0 * alpha[1:-1] + alpha[2:]) / 6.0
    return smeared
