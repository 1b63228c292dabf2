"""A body that tells its velocity: the motion, its Jacobians and its doubt, against plain numpy."""

import numpy as np
import pytest

from pipeline.estimation.relative_kernels import MOVING, SAID, TOLD
from pipeline.frames import cross, exp, log
from tests.pipeline.way import BIAS, BODY, PHONE, UP, Way


def told(doubts=(0.0, 0.0, 0.0)):
    """(times, values): rates as BODY's, gravity, a velocity of its own, and their doubts."""
    times, felt = BODY
    v = 0.4 * np.sin(np.outer(times, (3.0, 4.0, 2.0)) + np.arange(3.0))
    force = np.tile(UP, (len(times), 1))
    return times, np.hstack((felt[:, :3], force, v, np.tile(doubts, (len(times), 1))))


def at(of, t):
    return np.array([np.interp(t, of[0], column) for column in of[1].T])


def integrated(way, start, stop, n=4000):
    """p, R, u' by small steps of ṗ = u' + R v − ω_c × p, u̇' = R f_b − f_c − ω_c × u'."""
    p, R, u, h = way.x[:3].copy(), way.R.copy(), way.x[3:6].copy(), (stop - start) / n
    for k in range(n):
        said, phone = at(way.body, start + (k + 0.5) * h), at(way.phone, start + (k + 0.5) * h)
        omega_b, f_b, v = said[:3] - BIAS[:3], said[3:6] - BIAS[3:6], said[6:9]
        omega_c, f_c = phone[:3] - BIAS[6:9], phone[3:] - BIAS[9:]
        E, B = exp(-0.5 * h * omega_c), exp(0.5 * h * omega_b)
        middle = E @ R @ B
        p = p + h * (u + middle @ v - cross(omega_c, p))
        u = u + h * (middle @ f_b - f_c - cross(omega_c, u))
        R = E @ middle @ B
    return p, R, u


def test_the_place_goes_on_by_its_velocity_and_what_is_left_of_u_does_not():
    """Beside one that does not tell it: how samples are joined matters to both alike."""
    way, still = Way(body=told()), Way(body=(BODY[0], told()[1][:, :6]))
    p, R, _ = integrated(way, 0.2, 0.4)
    no_velocity = Way(body=(BODY[0], told()[1] * np.repeat((1.0, 0.0), 6)))
    p_still = integrated(no_velocity, 0.2, 0.4)[0]
    still.go(0.2, 0.4)
    way.go(0.2, 0.4)
    assert np.abs((way.x[:3] - still.x[:3]) - (p - p_still)).max() < 3e-5
    assert np.linalg.norm(p - p_still) > 0.03
    assert np.abs(log(way.R.T @ R)).max() < 1e-3
    assert np.array_equal(way.x[3:6], still.x[3:6])


def gone(k, by, rates=0.0):
    way = Way(body=told())
    if k < 3:
        way.x[k] += by
    elif k < 6:
        way.R = way.R @ exp(by * np.eye(3)[k - 3])
    elif k < 9:
        way.x[k - 3] += by
    way.x[6] += rates
    way.go(0.2, 0.3)
    return way


def off(a, b):
    turn = log(b.R.T @ a.R)
    return np.concatenate((a.x[:3] - b.x[:3], turn, a.x[3:6] - b.x[3:6]))


@pytest.mark.parametrize("k", range(MOVING))
def test_the_gathered_jacobian_is_that_of_finite_differences(k):
    e, here = 1e-5, gone(0, 0.0)
    column = (off(gone(k, e), here) - off(gone(k, -e), here)) / (2.0 * e)
    assert np.abs(here.F[:, k] - column).max() < 1e-6


def test_that_by_the_rates_bias_too():
    e, here = 1e-5, gone(0, 0.0)
    column = (off(gone(0, 0.0, e), here) - off(gone(0, 0.0, -e), here)) / (2.0 * e)
    assert np.abs(-here.G[:, 0] - column).max() < 1e-6


def test_a_doubted_velocity_leaves_the_place_unsure_and_no_speed():
    sure, unsure = Way(body=told()), Way(body=told((0.0, 0.0, 0.01)))
    sure.go(0.2, 0.3)
    unsure.go(0.2, 0.3)
    more = unsure.P - sure.P
    assert np.diag(more)[:3] == pytest.approx(0.1 * 0.01**2, rel=0.02)
    assert np.abs(np.diag(more)[6:9]).max() < 1e-12


def test_samples_have_what_they_say_and_the_doubts_of_it():
    assert told()[1].shape[1] == TOLD == SAID + 3
    assert PHONE[1].shape[1] == 6
