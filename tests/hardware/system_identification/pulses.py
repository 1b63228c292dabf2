"""A robot that hangs and whose thrusters give pulses one after the other, in simulation."""

from __future__ import annotations

import numpy as np

from hardware.sim.plant.plant import Plant, PlantOptions
from pipeline.config import PERIOD_S

REST = 500
"""Ticks."""


def pulsed(
    parameters, level, options=None, seed=1, gains=1.0, seconds=2.5, pause=1.0, thrusters=None
):
    """Commands (n, m) [N], rates and specific forces (n, 3) of a plant, and its attitudes."""
    plant = Plant(parameters, np.random.default_rng(seed), options or PlantOptions())
    plant.thruster_health[:] = gains
    count = len(parameters.thruster_torques)
    t = PERIOD_S * np.arange(round(seconds / PERIOD_S))
    on = (0.5 * t + t**2) % 1.0 < 0.5
    blocks = [np.zeros((REST, count))]
    for thruster in range(count) if thrusters is None else thrusters:
        block = np.zeros((len(t) + round(pause / PERIOD_S), count))
        block[: len(t), thruster] = level * on
        blocks.append(block)
    commands = np.vstack(blocks)
    samples, attitudes = np.empty((len(commands), 6)), np.empty((len(commands), 3, 3))
    for k, command in enumerate(commands):
        samples[k], attitudes[k] = np.concatenate(plant.imu()), plant.R_fb
        plant.step(command, PERIOD_S)
    return commands, samples[:, :3], samples[:, 3:], attitudes
