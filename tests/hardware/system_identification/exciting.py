"""A robot that hangs and is shaken by its own thrusters, with what a recording would hold of it."""

from __future__ import annotations

import numpy as np
from scipy.signal import butter, sosfiltfilt

from hardware.robot_physics import allocation_matrix
from hardware.sim.plant.plant import Plant, PlantOptions
from hardware.system_identification.flight_record import FlightRecord
from pipeline.config import PERIOD_S

LINK_S = 0.0005
"""Commands act in the middle of a simulated step."""
YAW_GAINS = 0.5, 0.3
"""[N m/rad, N m s/rad]: nothing else brings its yaw back."""


def shaken(
    parameters, gains=1.0, seconds=25.0, seed=1, axes=range(6), every=1, options=None, built=None
):
    """Flight of `seconds` [s] with random wrenches along `axes`; every so many commands is kept.

    Commands are for `parameters`, whatever is `built`.
    """
    rng = np.random.default_rng(seed)
    plant = Plant(built or parameters, rng, options or PlantOptions())
    plant.thruster_health[:] = gains
    n = round(seconds / PERIOD_S)
    band = butter(2, (0.3, 4.0), "band", fs=1.0 / PERIOD_S, output="sos")
    wrench = sosfiltfilt(band, rng.standard_normal((n, 6)), axis=0)
    wrench *= np.array((1.0, 1.0, 1.0, 0.05, 0.05, 0.1)) / wrench.std(axis=0)
    wrench[:, [axis for axis in range(6) if axis not in axes]] = 0.0
    places, directions = parameters.thruster_positions_in_b, parameters.thruster_directions_in_b
    allocation = np.linalg.pinv(allocation_matrix(places, directions, parameters.thruster_torques))
    samples, attitudes, commands = np.empty((n, 6)), np.empty((n, 3, 3)), np.empty((n, 8))
    for k in range(n):
        samples[k], attitudes[k] = np.concatenate(plant.imu()), plant.R_fb
        yaw = np.arctan2(plant.R_fb[1, 0], plant.R_fb[0, 0])
        wrench[k, 5] -= YAW_GAINS[0] * yaw + YAW_GAINS[1] * plant.omega_bf_in_b[2]
        commands[k] = np.clip(0.9 + allocation @ wrench[k], 0.05, parameters.f_max)
        plant.step(commands[k], PERIOD_S)
    t = PERIOD_S * np.arange(n)
    return FlightRecord(
        t[::every], commands[::every], t, samples[:, :3], samples[:, 3:], t[::4], attitudes[::4]
    )
