import numpy as np

from pipeline.frames import GRAVITY, exp
from pipeline.imu_stream import ImuStream
from pipeline.vision.imu_buffer import STALE_S, ImuBuffer

UP = np.array([0.0, 0.0, 1.0])
ZERO = np.zeros(3)


def turned(rate, n=120, dt=0.01):
    """A sensor that turns about its y axis, and its true vertical at any time."""
    buffer, omega = ImuBuffer(ImuStream()), np.array([0.0, rate, 0.0])
    for k in range(n):
        buffer.add(k * dt, omega, GRAVITY * exp(-omega * k * dt) @ UP)
    return buffer, lambda t: exp(-omega * t) @ UP


def test_before_anything_is_felt_nothing_is_known():
    assert ImuBuffer(ImuStream()).at(0.0) is None


def test_the_vertical_is_that_of_the_asked_time_not_the_newest():
    buffer, truth = turned(1.0)
    for t in (0.7, 0.8549, 1.1):
        assert np.degrees(np.arccos(min(1.0, buffer.at(t).up @ truth(t)))) < 0.1


def test_between_two_samples_the_rate_is_between_theirs():
    buffer = ImuBuffer(ImuStream())
    for k in range(100):
        buffer.add(0.01 * k, np.array([0.0, 0.01 * k, 1.0]), GRAVITY * UP)
    np.testing.assert_allclose(buffer.at(0.905).omega, [0.0, 0.905, 1.0])


def test_a_little_beyond_the_samples_the_nearest_counts_and_then_none():
    buffer, _ = turned(0.5)
    newest = buffer.at(1.19)
    np.testing.assert_array_equal(buffer.at(1.19 + 0.9 * STALE_S).up, newest.up)
    assert buffer.at(1.19 + 1.1 * STALE_S) is None
    assert buffer.at(-1.1 * STALE_S) is None
    np.testing.assert_allclose(buffer.at(-0.9 * STALE_S).up, buffer.at(0.0).up)


def test_free_fall_has_a_rate_but_no_vertical():
    buffer = ImuBuffer(ImuStream())
    buffer.add(0.0, np.ones(3), ZERO)
    assert buffer.at(0.0).up is None
    buffer.add(0.1, np.ones(3), GRAVITY * UP)
    np.testing.assert_allclose(buffer.at(0.1).up, UP)
