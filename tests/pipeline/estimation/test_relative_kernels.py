"""Transitions through samples: the products, the motion, the doubt; all against plain numpy."""

from itertools import pairwise

import numpy as np
import pytest

from pipeline.estimation import gravity_free
from pipeline.estimation.gravity_free import PredictedImu, RelativeMotion
from pipeline.estimation.hand_predictor import NOTHING
from pipeline.estimation.imu_interpolation_kernels import sample_at
from pipeline.estimation.relative_kernels import (
    BIASES,
    INPUTS,
    MOVING,
    TONE,
    X_BIASES,
    X_TONE,
    N,
    apply,
    gather,
    inputs_at,
)
from pipeline.frames import exp, log
from tests.pipeline.way import BIAS, BODY, PHONE, UP, Way, samples


def interpolated(of, t):
    """The cubic through the four samples about `t`; a line at either end."""
    times, values = of
    i = int(np.searchsorted(times, t, side="right")) - 1
    if 1 <= i < len(times) - 2:
        near = slice(i - 1, i + 3)
        return lagrange_weights(times[near], t) @ values[near]
    return np.array([np.interp(t, times, column) for column in values.T])


def lagrange_weights(times, t):
    others = [np.delete(times, k) for k in range(len(times))]
    return np.array([np.prod((t - o) / (own - o)) for own, o in zip(times, others, strict=True)])


def test_a_tremor_is_followed_between_the_samples_of_a_browser():
    """A line would cut off a tenth of it."""
    times = np.arange(60) / 60.0
    wave = np.tile(np.sin(2.0 * np.pi * 10.0 * times)[:, None], (1, 6))
    out, worst = np.zeros(6), 0.0
    for t in np.linspace(0.1, 0.8, 400):
        sample_at(times, wave, int(np.searchsorted(times, t, side="right")) - 1, t, out)
        worst = max(worst, abs(out[0] - np.sin(2.0 * np.pi * 10.0 * t)))
    assert worst < 0.03
    line = np.interp(np.linspace(0.1, 0.8, 400), times, wave[:, 0])
    assert np.abs(line - np.sin(2.0 * np.pi * 10.0 * np.linspace(0.1, 0.8, 400))).max() > 0.1


def test_gathering_is_the_product_of_the_steps():
    """F and G of a chain, and its noise as if each step's were carried on by the others."""
    rng = np.random.default_rng(3)
    F, G, Q = np.eye(9), np.zeros((9, 12)), np.zeros((9, 9))
    F_dense, G_dense, Q_dense, h = F.copy(), G.copy(), Q.copy(), 0.005
    for _ in range(20):
        f, g, s = (
            np.eye(9) + 0.1 * rng.normal(size=(9, 9)),
            rng.normal(size=(9, 12)),
            rng.uniform(size=12),
        )
        f[3:, :3] = f[3:6, 6:] = 0.0
        gather(F, G, Q, f, g, s, h, np.empty((9, 12)))
        F_dense, G_dense = f @ F_dense, f @ G_dense + g
        Q_dense = f @ Q_dense @ f.T + g @ np.diag(s / h) @ g.T
    assert np.abs(F - F_dense).max() < 1e-12 * np.abs(F_dense).max()
    assert np.abs(G - G_dense).max() < 1e-12 * np.abs(G_dense).max()
    assert np.abs(Q - Q_dense).max() < 1e-12 * np.abs(Q_dense).max()
    assert np.array_equal(Q, Q.T)


def test_applying_is_the_dense_product():
    """Biases act through −G: an input is a sample less its bias."""
    rng = np.random.default_rng(4)
    F, G, A = rng.normal(size=(9, 9)), rng.normal(size=(9, 12)), rng.normal(size=(N, N))
    B, walks, span = rng.normal(size=(9, 9)), rng.uniform(size=13), 0.3
    P, Q, Phi, W = A @ A.T, B @ B.T, np.eye(N), np.zeros((N, N))
    Phi[:9, :9], Phi[:9, 9:21], W[:9, :9] = F, -G, Q
    W[BIASES:, BIASES:] = np.diag(walks * span)
    dense = Phi @ P @ Phi.T + W
    apply(P, F, G, Q, walks, span, np.empty((2, 9, N)))
    assert np.abs(P - dense).max() < 1e-12 * np.abs(dense).max()
    assert np.array_equal(P, P.T)


def test_a_transit_is_a_step_for_each_stretch_between_samples():
    """Both IMUs interpolated at the middle of each stretch, biases off."""
    way = Way()
    knots = np.unique(np.concatenate((BODY[0], PHONE[0], (0.1017, 0.4021))))
    knots = knots[(knots >= 0.1017) & (knots <= 0.4021)]
    x = RelativeMotion(way.x[:3].copy(), way.R.copy(), way.x[3:6].copy())
    assert way.go(0.1017, 0.4021) == len(knots) - 1
    for t, until in pairwise(knots.tolist()):
        middle = 0.5 * (t + until)
        inputs = np.concatenate((interpolated(BODY, middle), interpolated(PHONE, middle))) - BIAS
        x = gravity_free.step(x, PredictedImu(*inputs.reshape(4, 3)), until - t)
    assert np.abs(way.x[:3] - x.p).max() < 1e-11
    assert np.abs(way.R - x.R).max() < 1e-11
    assert np.abs(way.x[3:6] - x.u).max() < 1e-11
    assert np.array_equal(way.x[X_BIASES:-1], BIAS)


def test_inputs_are_interpolated_and_freed_of_bias():
    for t in (0.31, float(BODY[0][40]), 0.9):
        inputs = inputs_at(t, Way().x, *BODY, *PHONE, NOTHING)  # type: ignore[call-arg]
        expected = np.concatenate((interpolated(BODY, t), interpolated(PHONE, t))) - BIAS
        assert np.abs(inputs - expected).max() < 1e-12


def test_the_gathered_jacobians_are_those_of_the_whole_transit():
    """By the biases: −G. One by one, differences of two transits."""
    way, e = Way(), 1e-4
    way.go(0.2, 0.3)
    for k in range(INPUTS):
        ends = []
        for sign in (1.0, -1.0):
            other = Way()
            other.x[X_BIASES + k] += sign * e
            other.go(0.2, 0.3)
            ends.append(np.concatenate((other.x[:3], log(way.R.T @ other.R), other.x[3:6])))
        assert np.abs((ends[0] - ends[1]) / (2.0 * e) + way.G[:, k]).max() < 1e-7


def test_a_tone_is_taken_off_the_bodys_samples_and_its_amplitudes_act_as_biases_that_swing():
    tone, sizes = (2.0 * np.pi * 3.0, 0.02), np.array((0.04, -0.03, 0.05, 0.8, -0.5, 0.6) * 2)
    sizes[6:] *= -0.5
    phase = tone[0] * (BODY[0] - tone[1])
    waves = np.cos(phase)[:, None] * sizes[:6] + np.sin(phase)[:, None] * sizes[6:]
    calm, shaken = Way(), Way((BODY[0], BODY[1] + waves), tone=tone)
    shaken.x[X_TONE:] = sizes
    calm.go(0.1, 0.5)
    shaken.go(0.1, 0.5)
    assert np.abs(shaken.x[:6] - calm.x[:6]).max() < 1e-4
    assert np.abs(log(calm.R.T @ shaken.R)).max() < 1e-4
    inputs = [
        inputs_at(0.3, way.x, *way.body, *PHONE, NOTHING, way.tone)  # type: ignore[call-arg]
        for way in (calm, shaken)
    ]
    assert np.abs(inputs[0] - inputs[1]).max() < 1e-3
    e = 1e-6
    for k in range(12):
        other = Way(tone=tone)
        usual = Way(tone=tone)
        other.x[X_TONE + k] += e
        other.go(0.1, 0.5)
        usual.go(0.1, 0.5)
        moved = np.concatenate(
            (other.x[:3] - usual.x[:3], log(usual.R.T @ other.R), other.x[3:6] - usual.x[3:6])
        )
        np.testing.assert_allclose(-usual.G[:, INPUTS + k], moved / e, rtol=1e-3, atol=1e-5)


def test_applying_with_a_tone_is_the_dense_product_too():
    rng, n = np.random.default_rng(5), N + 12
    F, G, A = rng.normal(size=(9, 9)), rng.normal(size=(9, 24)), rng.normal(size=(n, n))
    walks, P, Phi, W = rng.uniform(size=25), A @ A.T, np.eye(n), np.zeros((n, n))
    Phi[:9, :9], Phi[:9, BIASES : BIASES + 12], Phi[:9, TONE:] = F, -G[:, :12], -G[:, 12:]
    W[BIASES:, BIASES:] = np.diag(walks * 0.3)
    dense = Phi @ P @ Phi.T + W
    apply(P, F, G, np.zeros((9, 9)), walks, 0.3, np.empty((2, 9, n)))
    assert np.abs(P - dense).max() < 1e-12 * np.abs(dense).max()


def test_a_transit_can_be_made_in_pieces():
    """Cut at samples it is the same; P but for the walk of the biases within it."""
    whole, pieces = Way(), Way()
    cuts = [0.2, *BODY[0][60:80:7].tolist(), 0.5]
    whole.go(0.2, 0.5)
    for start, stop in pairwise(cuts):
        pieces.go(start, stop)
    assert np.abs(whole.x - pieces.x).max() < 1e-12
    assert np.abs(whole.P / pieces.P.max() - pieces.P / pieces.P.max()).max() < 1e-6


@pytest.mark.parametrize("span", [(0.5, 0.5), (0.5, 0.5 + 1e-12), (0.7, 0.2)])
def test_a_transit_of_no_time_changes_nothing(span):
    way, before = Way(), Way()
    assert way.go(*span) <= 1
    assert way.x == pytest.approx(before.x, abs=1e-11)
    assert np.abs(way.F - np.eye(MOVING)).max() < 1e-10
    assert np.abs(way.Q).max() < 1e-10


@pytest.mark.parametrize("what", ["body", "phone"])
def test_held_samples_are_doubted_more_and_more(what):
    """Density of the noise after 0.1, 0.2, 0.4 s of silence, from the growth of σ of u."""
    growth = []
    for silence in (0.0, 0.1, 0.2, 0.4):
        t_last = 0.5 - silence
        way = Way()
        times, values = getattr(way, what)
        setattr(way, what, (times[times < t_last].copy(), values[times < t_last].copy()))
        way.go(0.5, 0.51)
        growth.append(np.trace(way.Q[6:9, 6:9]))
    assert growth[0] < 0.5 * growth[1]
    assert 4.0 * growth[1] < growth[2] < growth[3] / 4.0


@pytest.mark.parametrize("predicts", [False, True])
def test_a_gap_between_samples_is_doubted_but_less_than_silence(predicts):
    sigmas = {}
    for name, stop in (("dense", 0.0), ("gap", 0.6), ("silence", 9.0)):
        way = Way(predicts=predicts)
        keep = (PHONE[0] <= 0.3) | (PHONE[0] >= stop)
        way.phone = (PHONE[0][keep].copy(), PHONE[1][keep].copy())
        way.go(0.2, 0.6)
        sigmas[name] = way.sigma(3), way.sigma(6)
    for dense, gap, silence in zip(*sigmas.values(), strict=True):
        assert dense < gap < silence


def test_a_sample_from_the_far_future_is_no_better_than_none_and_no_worse():
    way, poisoned, silent = Way(), Way(), Way()
    until = [column[PHONE[0] <= 0.6].copy() for column in PHONE]
    silent.phone = tuple(until)
    poisoned.phone = np.append(until[0], 3600.0), np.vstack((until[1], np.full(6, 50.0)))
    for each in (way, poisoned, silent):
        each.go(0.2, 0.62)
    assert np.abs(poisoned.x - silent.x).max() < 1e-3
    assert poisoned.sigma(0) < 1.05 * silent.sigma(0)


def test_samples_before_the_first_one_are_the_first_one():
    way = Way(body=samples(0.5, 1.0, 0.005, 1), phone=samples(0.5, 1.0, 1 / 60, 2))
    way.go(0.4, 0.49)
    assert np.isfinite(way.x).all()
    assert way.sigma(6) > 0.05


@pytest.mark.parametrize("predicts", [False, True])
def test_the_rotation_of_the_camera_since_its_last_sample(predicts):
    """However the way there is cut; begun anew at each sample."""
    phone = PHONE[0][:31].copy(), PHONE[1][:31].copy()
    t_last = phone[0][-1]
    once, often = (Way(phone=phone, predicts=predicts) for _ in range(2))
    once.go(0.2, t_last + 0.05)
    for start, stop in (
        (0.2, 0.3),
        (0.3, t_last),
        (t_last, t_last + 0.02),
        (t_last + 0.02, t_last + 0.05),
    ):
        often.go(start, stop)
    assert np.abs(once.R_ic - often.R_ic).max() < 1e-6
    held = exp(0.05 * (phone[1][-1, :3] - BIAS[6:9]))
    assert np.abs(log(held.T @ once.R_ic)).max() < (0.05 if predicts else 1e-12)
    once.phone = PHONE
    once.go(t_last + 0.05, t_last + 0.1)
    assert np.array_equal(once.R_ic, np.eye(3))


def test_ten_minutes_with_outages_leave_the_covariance_symmetric_and_positive():
    """200 Hz; each tenth second without samples; fixed to the ground once a second."""
    rng = np.random.default_rng(5)
    way, h = Way(), 0.005
    for second in range(600):
        t = np.arange(0.0, 1.0, h)
        if second % 10 == 9:
            t = t[:1]
        felt = 0.5 * rng.normal(size=(len(t), 6)) + np.append(np.zeros(3), UP)
        way.body = way.phone = (t, felt)
        for cut in (0.0, 0.5):
            way.go(cut, cut + 0.5)
        for k in range(6):  # p and θ to 1 cm, 0.01 rad
            row = way.P[k].copy()
            way.P -= np.outer(row, row) / (way.P[k, k] + 1e-4)
        way.x[:6] = 2.5, 0.0, 0.0, 0.0, 0.0, 0.0
    assert np.isfinite(way.P).all()
    assert np.array_equal(way.P, way.P.T)
    scale = np.sqrt(np.diag(way.P))
    assert np.linalg.eigvalsh(way.P / np.outer(scale, scale))[0] > 1e-12
    assert np.abs(way.R @ way.R.T - np.eye(3)).max() < 1e-10
