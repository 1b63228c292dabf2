"""A twist of the tip to rates of joints: as wanted where it can be, within bounds everywhere."""

from __future__ import annotations

import mujoco
import numpy as np
import pytest

from hardware.arm.bounds import LEAST_M, MARGIN_RAD, RATE_SHARE, TURN_M
from hardware.arm.inverse_kinematics import InverseKinematics
from pipeline.frames import Array, log
from tests.hardware.arm.arms import ARM, AXES, H_S, HOME, PARAMETERS

RATE = RATE_SHARE * PARAMETERS.rate
GAIN_PER_S = 4.0
"""Of the loop that leads it here."""


@pytest.fixture
def kinematics() -> InverseKinematics:
    return InverseKinematics(ARM, AXES)


def twists(seed: int, many: int, v: float, omega: float) -> Array:
    """(many, 6) with standard deviations of one axis [m/s, rad/s]."""
    sigmas = np.repeat((v, omega), 3)
    return np.random.default_rng(seed).normal(size=(many, 6)) * sigmas


@pytest.mark.parametrize("twist", twists(1, 20, 0.03, 0.1))
def test_away_from_bounds_it_is_what_a_linear_equation_gives(
    kinematics: InverseKinematics, twist: Array
) -> None:
    """Five joints, five axes: one solution, without any programme."""
    reference = np.linalg.solve(ARM.jacobian(HOME)[AXES], twist[AXES])
    rates = kinematics.rates(HOME, twist, H_S)
    assert rates == pytest.approx(reference, abs=0.03 * float(np.linalg.norm(reference)))
    off = ARM.jacobian(HOME) @ rates - twist
    assert np.linalg.norm(off[:3]) < 0.03 * np.linalg.norm(twist[:3]) + 1e-3
    assert np.linalg.norm(off[3:5]) < 0.03 * np.linalg.norm(twist[3:]) + 1e-3


def test_told_nothing_nothing_moves(kinematics: InverseKinematics) -> None:
    assert not kinematics.rates(HOME, np.zeros(6), H_S).any()


def gap_m(q: Array) -> float:
    """Between the nearest two parts that are kept apart."""
    data = mujoco.MjData(ARM.model)
    data.qpos[:] = ARM.configuration(q)
    mujoco.mj_kinematics(ARM.model, data)
    return min(mujoco.mj_geomDistance(ARM.model, data, *pair, 1.0, None) for pair in ARM.pairs)


def least_m(q: Array) -> float:
    weights = np.array([1.0, 1.0, 1.0, TURN_M, TURN_M, TURN_M])[AXES, None]
    sizes = np.linalg.svd(weights * ARM.jacobian(q)[AXES], compute_uv=False)
    return float(sizes[-1])


@pytest.mark.parametrize("seed", range(4))
def test_walking_anywhere_it_never_leaves_its_bounds_nor_jumps(
    kinematics: InverseKinematics, seed: int
) -> None:
    """Half a minute by twists that change smoothly, beyond what its file allows."""
    q, halfway, twist, before = HOME.copy(), np.zeros(6), np.zeros(6), np.zeros(len(HOME))
    jumps = []
    for k, kick in enumerate(twists(seed + 10, 6000, 0.04, 0.12)):
        halfway = 0.98 * halfway + kick
        twist = 0.98 * twist + 0.02 * halfway
        rates = kinematics.rates(q, twist, H_S)
        q = q + H_S * rates
        jumps.append(np.abs(rates - before).max())
        before = rates
        assert np.abs(rates).max() <= RATE * (1.0 + 1e-3)
        assert (q >= ARM.low + MARGIN_RAD - 1e-4).all()
        assert (q <= ARM.high - MARGIN_RAD + 1e-4).all()
        if k % 10 == 0:
            assert gap_m(q) > PARAMETERS.apart - 1e-4
            assert least_m(q) > 0.95 * LEAST_M
    assert np.linalg.norm(q - HOME) > 0.1
    assert np.quantile(jumps, 0.999) < 0.25 * PARAMETERS.rate


def led(kinematics: InverseKinematics, way_in_k: Array, turn: Array, seconds: float = 6.0) -> Array:
    """Joints (n,) [rad] after it was led to a pose beside home as a controller leads it."""
    R_home, p_home = ARM.tip(HOME)
    drive, q = np.array([0.3, np.radians(90.0)]), HOME.copy()
    for _ in range(round(seconds / H_S)):
        R, p = ARM.tip(q)
        v = GAIN_PER_S * R.T @ (p_home + way_in_k - p)
        omega = GAIN_PER_S * (log(R.T @ R_home) + turn)
        sizes = np.maximum(1.0, np.array([np.linalg.norm(v), np.linalg.norm(omega)]) / drive)
        twist = np.concatenate((v / sizes[0], omega / sizes[1]))
        q = q + H_S * kinematics.rates(q, np.where(AXES, twist, 0.0), H_S)
    return q


@pytest.mark.parametrize(
    ("way_m", "goes_m"),
    [((0.5, 0.0, 0.0), 0.14), ((0.0, 0.0, 0.5), 0.15), ((0.0, 0.0, -0.5), 0.12)],
)
def test_led_beyond_its_reach_it_goes_to_the_border_and_stays_level(
    kinematics: InverseKinematics, way_m: tuple[float, float, float], goes_m: float
) -> None:
    way = np.array(way_m)
    q = led(kinematics, way, np.zeros(3))
    R, p = ARM.tip(q)
    assert (p - ARM.tip(HOME)[1]) @ way / np.linalg.norm(way) > goes_m
    tilt = log(R.T @ ARM.tip(HOME)[0])[:2]
    assert np.degrees(np.linalg.norm(tilt)) < 2.0
    assert np.linalg.norm(kinematics.rates(q, np.zeros(6), H_S)) == 0.0


def test_turned_beyond_its_wrists_range_it_stays_in_its_place(
    kinematics: InverseKinematics,
) -> None:
    q = led(kinematics, np.zeros(3), np.array([0.0, -1.0, 0.0]))
    _, p = ARM.tip(q)
    assert np.linalg.norm(p - ARM.tip(HOME)[1]) < 0.02
    assert np.degrees(q - HOME)[3] < -60.0


def test_what_it_was_led_to_beyond_its_reach_it_comes_back_from(
    kinematics: InverseKinematics,
) -> None:
    q = led(kinematics, np.array([0.5, 0.0, 0.0]), np.zeros(3))
    R_home, p_home = ARM.tip(HOME)
    for _ in range(round(3.0 / H_S)):
        R, p = ARM.tip(q)
        twist = GAIN_PER_S * np.append(R.T @ (p_home - p), log(R.T @ R_home))
        q = q + H_S * kinematics.rates(q, np.where(AXES, twist, 0.0), H_S)
    assert np.abs(np.degrees(q - HOME)).max() < 0.5
