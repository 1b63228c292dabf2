"""Vertical: turned at once by the gyroscope, put right in the long run by gravity."""

import numpy as np

from pipeline.estimation.gravity_direction import TIME_S, GravityDirection
from pipeline.frames import GRAVITY, exp

UP = np.array([0.0, 0.0, 1.0])
STILL = np.zeros(3)


def test_a_turning_sensor_keeps_up_where_it_is():
    vertical, R, omega = GravityDirection(), np.eye(3), np.array([0.4, -0.3, 0.8])
    for k in range(400):
        vertical.add(0.005 * k, omega, GRAVITY * R.T @ UP)
        R = R @ exp(0.005 * omega)
    assert np.degrees(np.arccos(min(1.0, vertical.up @ exp(-0.005 * omega).T @ R.T @ UP))) < 0.5


def test_a_shove_tilts_it_by_its_share_of_the_time_constant():
    vertical, side = GravityDirection(), np.array([GRAVITY, 0.0, GRAVITY])
    vertical.add(0.0, STILL, GRAVITY * UP)
    vertical.add(0.05 * TIME_S, STILL, side)
    assert 0.0 < vertical.up[0] < 0.05


def test_free_fall_says_nothing_and_a_gap_starts_anew():
    vertical = GravityDirection()
    vertical.add(0.0, STILL, 0.01 * UP)
    assert vertical.up is None
    vertical.add(0.01, STILL, GRAVITY * UP)
    vertical.add(5.0, STILL, np.array([GRAVITY, 0.0, 0.0]))
    np.testing.assert_allclose(vertical.up, (1.0, 0.0, 0.0))
