"""Relative motion by u and specific forces: against the truth, the paper's form and itself."""

import numpy as np
import pytest

from pipeline.estimation import gravity_free, relative_model
from pipeline.estimation.gravity_free import PredictedImu, RelativeMotion
from pipeline.estimation.relative_model import States
from pipeline.frames import R_from_rpy, S_in_b, cross, exp, log
from tests.pipeline.moving import H, imu_of, p_bc_in_c, pose_in_f, rate, vee, worst

LED = np.array([0.2, -0.3, 0.1])


def R_cb(t):
    return pose_in_f(0, t)[1].T @ pose_in_f(1, t)[1]


def u_bf_in_c(t):
    velocity = rate(lambda s: pose_in_f(1, s)[0] - pose_in_f(0, s)[0], t)
    return pose_in_f(0, t)[1].T @ velocity


def true_motion(t):
    return RelativeMotion(p_bc_in_c(t), R_cb(t), u_bf_in_c(t))


def true_felt(t):
    (_, omega_c, _, f_c), (_, omega_b, _, f_b) = imu_of(0, t), imu_of(1, t)
    return PredictedImu(omega_b, f_b, omega_c, f_c)


def drawn(seed, pitch=None):
    """A motion and inputs like nothing in particular."""
    rng = np.random.default_rng(seed)
    eta = rng.uniform(-3.0, 3.0, 3)
    if pitch is not None:
        eta[1] = pitch
    omega_b, f_b, omega_c, f_c = rng.normal(size=(4, 3)) * np.array([[1.0], [9.0], [1.0], [9.0]])
    x = RelativeMotion(
        np.array([2.5, 0.0, 0.0]) + 0.3 * rng.normal(size=3), R_from_rpy(eta), rng.normal(size=3)
    )
    return x, PredictedImu(omega_b, f_b, omega_c, f_c)


def moved(x, error):
    """`x` with (δp, θ, δu) added."""
    return RelativeMotion(x.p + error[:3], x.R @ exp(error[3:6]), x.u + error[6:])


def apart(a, b):
    """(δp, θ, δu) that turns b into a."""
    return np.concatenate((a.p - b.p, log(b.R.T @ a.R), a.u - b.u))


def changed(inputs, by):
    by = by.reshape(4, 3)
    return PredictedImu(
        inputs.omega_b + by[0], inputs.f_b + by[1], inputs.omega_c + by[2], inputs.f_c + by[3]
    )


def test_the_derivative_is_that_of_the_truth():
    """The model's three equations, gravity left in both forces; u̇ is differentiated twice over."""
    assert (
        worst(
            lambda t: gravity_free.derivative(true_motion(t), true_felt(t)).p - rate(p_bc_in_c, t)
        )
        < 1e-9
    )
    assert (
        worst(lambda t: gravity_free.derivative(true_motion(t), true_felt(t)).R - rate(R_cb, t))
        < 1e-9
    )
    assert (
        worst(
            lambda t: gravity_free.derivative(true_motion(t), true_felt(t)).u - rate(u_bf_in_c, t)
        )
        < 1e-9
    )


@pytest.mark.parametrize("seed", range(6))
def test_it_is_the_papers_motion_in_other_words(seed):
    """Eq. (3), (7), (8) with v = u − ω_c × p: δ_c, which u leaves out, is given back."""
    x, inputs = drawn(seed)
    delta = np.random.default_rng(seed).normal(size=3)
    paper = np.zeros(relative_model.N)
    eta = paper[States.eta_bc] = np.array([0.4, -1.2, 2.0]) * (seed - 2.5) / 2.5
    x = RelativeMotion(x.p, R_from_rpy(eta), x.u)
    paper[States.p_bc_in_c] = x.p
    paper[States.v_bc_in_c] = x.u - cross(inputs.omega_c, x.p)
    paper[States.omega_bf_in_b], paper[States.omega_cf_in_c] = inputs.omega_b, inputs.omega_c
    paper[States.a_bf_in_b], paper[States.a_cf_in_c] = inputs.f_b, inputs.f_c
    paper[States.delta_cf_in_c] = delta
    theirs, ours = relative_model.derivative(paper), gravity_free.derivative(x, inputs)
    v_rate = ours.u - cross(delta, x.p) - cross(inputs.omega_c, ours.p)
    assert np.abs(theirs[States.p_bc_in_c] - ours.p).max() < 1e-12
    assert np.abs(theirs[States.v_bc_in_c] - v_rate).max() < 1e-12 * 30.0
    assert np.abs(S_in_b(eta) @ theirs[States.eta_bc] - vee(x.R.T @ ours.R)).max() < 1e-12


@pytest.mark.parametrize("pitch", [0.3, np.pi / 2, -np.pi / 2, 1.5])
def test_the_error_jacobian_is_the_derivative_of_the_derivative(pitch):
    x, inputs = drawn(3, pitch)
    h = 2e-3

    def error_rate(error, by):
        """(δṗ, θ̇, δu̇) of an x that is off by `error`, fed with inputs that are off by `by`."""
        there, here = (
            gravity_free.derivative(moved(x, error), changed(inputs, by)),
            gravity_free.derivative(x, inputs),
        )
        theta_rate = vee(x.R.T @ (there.R - here.R @ exp(error[3:6])))
        return np.concatenate((there.p - here.p, theta_rate, there.u - here.u))

    def columns(n, f):
        return np.array([rate(lambda s, e=e: f(s * h / H * e), 0.0) * H / h for e in np.eye(n)]).T

    F, G = gravity_free.error_jacobian(x, inputs)
    by_error = columns(9, lambda e: error_rate(e, np.zeros(12)))
    by_input = columns(12, lambda e: error_rate(np.zeros(9), e))
    assert np.abs(F - by_error).max() < 1e-8 * np.abs(F).max()
    assert np.abs(G - by_input).max() < 1e-8 * np.abs(G).max()


def test_a_step_is_of_second_order():
    """Along the truth for a second, inputs taken in the middle of each step."""

    def error(n):
        h, x = 1.0 / n, true_motion(2.0)
        for k in range(n):
            x = gravity_free.step(x, true_felt(2.0 + (k + 0.5) * h), h)
        return np.abs(apart(x, true_motion(3.0))).max()

    coarse, fine = error(50), error(100)
    assert coarse < 3e-4
    assert 3.5 < coarse / fine < 4.5


def test_a_step_turns_exactly():
    """However far: rates are constant during it."""
    x, inputs = drawn(4)
    h = 2.0
    R = exp(-h * inputs.omega_c) @ x.R @ exp(h * inputs.omega_b)
    assert np.abs(gravity_free.step(x, inputs, h).R - R).max() < 1e-14


def test_a_step_without_turning_is_a_parabola():
    x, inputs = drawn(5)
    still = PredictedImu(np.zeros(3), inputs.f_b, np.zeros(3), inputs.f_c)
    h, a = 0.7, x.R @ inputs.f_b - inputs.f_c
    after = gravity_free.step(x, still, h)
    assert np.abs(after.p - (x.p + h * x.u + 0.5 * h * h * a)).max() < 1e-13
    assert np.abs(after.u - (x.u + h * a)).max() < 1e-13


def test_gravity_makes_no_difference():
    """Both devices at rest in f, however they are turned: only p and R as seen from c, for ever."""
    up, R_fc, R_fb = (
        np.array([0.0, 0.0, 9.8]),
        R_from_rpy(np.array([0.3, -0.9, 2.0])),
        R_from_rpy(np.array([-1.0, 1.2, 0.2])),
    )
    x = RelativeMotion(np.array([2.0, 0.1, 0.2]), R_fc.T @ R_fb, np.zeros(3))
    rest = PredictedImu(np.zeros(3), R_fb.T @ up, np.zeros(3), R_fc.T @ up)
    assert np.abs(apart(gravity_free.step(x, rest, 1.0), x)).max() < 1e-13


@pytest.mark.parametrize("pitch", [0.3, np.pi / 2, -1.5])
def test_the_picture_of_an_led_has_the_stated_derivatives(pitch):
    x, inputs = drawn(6, pitch)
    H_z, z_rate = gravity_free.seen_jacobian(x, inputs, LED)

    def seen(error):
        return gravity_free.seen_at(moved(x, np.append(error, np.zeros(3))), LED)

    columns = np.array([rate(lambda s, e=e: seen(s * e), 0.0) for e in np.eye(6)]).T
    assert np.abs(H_z - columns).max() < 1e-8 * np.abs(H_z).max()
    in_time = (
        rate(lambda s: gravity_free.seen_at(gravity_free.step(x, inputs, 0.01 * s), LED), 0.0)
        / 0.01
    )
    assert np.abs(z_rate - in_time).max() < 1e-8 * np.abs(z_rate).max()
