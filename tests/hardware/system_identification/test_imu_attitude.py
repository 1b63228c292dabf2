"""A robot that hangs knows how it turned by its own sensors, whatever their biases."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest

from hardware.robot_file import load_robot
from hardware.system_identification.imu_attitude import attitude_by_imu
from pipeline.frames import exp
from tests.hardware.system_identification.pulses import pulsed

KNOWN = load_robot("ames").plant
pytestmark = pytest.mark.slow


@cache
def hanging(seed):
    return pulsed(KNOWN, 0.3, seed=seed)


@pytest.mark.parametrize("beside_deg", [0.0, 3.0])
@pytest.mark.parametrize("seed", [1, 2])
def test_a_bias_of_the_accelerometer_is_no_tilt_and_a_tilt_no_bias(seed, beside_deg):
    """Turning about the vertical tells them apart."""
    _, omega, force, R_fb = hanging(seed)
    R_bs = exp(np.radians((beside_deg, 0.0, 0.0)))
    seen = attitude_by_imu(omega @ R_bs, force @ R_bs, KNOWN.imu)
    up, true = seen.R_fs[:, 2], (R_fb @ R_bs)[:, 2]
    off = np.arccos(np.clip(np.einsum("nj,nj->n", up, true), -1.0, 1.0))
    assert np.degrees(off.max()) < 0.15
    tilt_by_bias = np.arctan2(np.linalg.norm(force[:400].mean(axis=0)[:2]), 9.81)
    assert off.max() < 0.25 * tilt_by_bias


def test_sensors_that_sit_turned_are_level_all_the_same():
    _, omega, force, R_fb = hanging(1)
    R_sb = np.array(((0.0, 0.0, -1.0), (0.0, 1.0, 0.0), (1.0, 0.0, 0.0)))
    seen = attitude_by_imu(omega @ R_sb.T, force @ R_sb.T, KNOWN.imu)
    up_in_b = np.einsum("nij,j->ni", seen.R_fs @ R_sb, (0.0, 0.0, 1.0))
    level = np.einsum("nj,nj->n", up_in_b, R_fb[:, :, 2])
    assert np.degrees(np.arccos(np.clip(level[0], -1.0, 1.0))) < 5.0
