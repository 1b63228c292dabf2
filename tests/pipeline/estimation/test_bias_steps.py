"""A bias that steps is found, by its sensor; chance, and pictures that lie, are no step."""

import numpy as np
import pytest

from hardware.sim.world import evaluator
from hardware.sim.world.sensor_faults import ImuFault
from hardware.sim.world.world import World, WorldOptions
from pipeline.estimation.bias_steps import AGAIN_S, FADE_S, MEMORY_S, BiasSteps
from pipeline.estimation.relative_kernels import BIASES, N
from tests.pipeline.flight import new

INITIAL = np.array([0.03, 0.3, 0.005, 0.1])
PERIOD = 1.0 / 30.0


def predicted():
    """P of pictures that tell three sensors' biases by place and attitude, each by its axis."""
    H = np.zeros((6, N))
    H[0:3, 0:3] = H[3:6, 3:6] = np.eye(3)
    P = np.eye(N) * 1e-8
    P[BIASES : BIASES + 3, BIASES : BIASES + 3] = 1e-6 * np.eye(3)  # body gyroscope
    P[3:6, 3:6] += 1e-6 * np.eye(3)
    P[3:6, BIASES : BIASES + 3] = P[BIASES : BIASES + 3, 3:6] = 5e-7 * np.eye(3)
    P[BIASES + 3 : BIASES + 6, BIASES + 3 : BIASES + 6] = 1e-4 * np.eye(3)  # its accelerometer
    P[0:3, 0:3] += 1e-6 * np.eye(3)
    P[0:3, BIASES + 3 : BIASES + 6] = P[BIASES + 3 : BIASES + 6, 0:3] = 5e-6 * np.eye(3)
    return P


P = predicted()
S = P[:6, :6] + 1e-6 * np.eye(6)


def found(steps, miss, pictures=15, start=0.0):
    """What is said at each of so many pictures, missed by chance and by `miss` (6,) of its σ."""
    rng, L = np.random.default_rng(3), np.linalg.cholesky(S)
    said = []
    for k in range(pictures):
        e = L @ (rng.normal(size=6) + np.array(miss))
        said.append(steps.learn(start + k * PERIOD, e, S, P))
    return np.array(said)


def test_chance_moves_nothing():
    said = found(BiasSteps(INITIAL), np.zeros(6), pictures=1800)
    assert (said.any(axis=1)).sum() <= 1


@pytest.mark.parametrize(("sensor", "axis"), [(0, 4), (1, 1)])
def test_the_sensor_that_explains_the_misses_has_moved(sensor, axis):
    miss = 3.0 * np.eye(6)[axis]
    said = found(BiasSteps(INITIAL), miss)
    first = said[np.flatnonzero(said.any(axis=1))[0]]
    assert np.argmax(first) == sensor
    assert np.count_nonzero(first) == 1


@pytest.mark.parametrize(("size", "pictures"), [(10.0, 1), (1000.0, 30)])
def test_a_picture_that_lies_is_no_sensors_fault(size, pictures):
    steps, still = BiasSteps(INITIAL), np.zeros(6)
    found(steps, still, pictures=2)
    assert not found(steps, size * np.eye(6)[1], pictures, start=2.0 * PERIOD).any()


def test_a_bias_that_moves_again_and_again_walks_until_it_shows_no_more():
    steps, miss = BiasSteps(INITIAL), 3.0 * np.eye(6)[1]
    found(steps, miss, pictures=1)
    assert not steps.walks.any()
    found(steps, miss, pictures=int(AGAIN_S / PERIOD))
    walks = steps.walks.copy()
    assert np.flatnonzero(walks).tolist() == [1]
    found(steps, np.zeros(6), pictures=int(2.0 * FADE_S / PERIOD), start=AGAIN_S)
    assert steps.walks[1] < 0.2 * walks[1]


def test_two_alarms_in_a_row_are_no_faster_a_walk_than_two_in_its_memory():
    steps, miss = BiasSteps(INITIAL), 6.0 * np.eye(6)[1]
    said = found(steps, miss, pictures=6)
    moved = np.flatnonzero(said[:, 1])
    assert len(moved) > 1
    assert np.diff(moved).min() * PERIOD < MEMORY_S / 2.0
    assert 0.0 < steps.walks[1] <= said[:, 1].max() ** 2 / MEMORY_S


def test_a_walk_that_shows_no_more_is_forgotten_sooner_than_one_of_which_nothing_is_seen():
    steps = BiasSteps(INITIAL)
    found(steps, np.zeros(6), pictures=30)
    steps.walks[1] = 1.0
    for k in range(30):
        steps.learn((30 + k) * PERIOD, np.zeros(6), S, P)
    assert 0.5 < steps.walks[1] < 0.9  # pictures that fit too well say nothing
    found(steps, 0.0 * np.ones(6), pictures=30, start=60 * PERIOD)
    assert steps.walks[1] < 0.5


@pytest.mark.slow
@pytest.mark.parametrize(("step", "worst"), [((0.2, 0.0), 0.012), ((0.0, 1.0), 0.012)])
def test_a_step_of_the_robots_sensors_is_forgotten_after_three_seconds(step, worst):
    rms = []
    for seed in (71, 72):
        fault = ImuFault(step=step, start=4.0)
        world = World(WorldOptions(seed=seed, duration=9.0, hand="filming", body_fault=fault))
        e = evaluator.run(new(), world).now.during(7.0, 9.0).e[:, :3]
        rms.append(np.sqrt(np.square(e).sum(axis=1).mean()))
    assert max(rms) < worst
