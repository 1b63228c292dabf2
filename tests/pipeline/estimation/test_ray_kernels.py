"""LEDs fused one by one: against finite differences and against Kalman's formula in one block."""

import numpy as np
import pytest

from pipeline.camera.lens_kernels import NEAREST_M
from pipeline.estimation import gravity_free, ray_kernels
from pipeline.estimation.gravity_free import PredictedImu, RelativeMotion
from pipeline.estimation.ray_kernels import TOUCHED, correct, fuse_rays, is_sound
from pipeline.estimation.relative_kernels import OFFSET, X_OFFSET, N, X
from pipeline.frames import R_from_rpy, exp, log

LEDS = np.array([[0.28, 0.0, 0.05], [0.0, 0.3, -0.06], [-0.05, -0.3, -0.03], [-0.2, 0.05, 0.2]])
GATE = 13.8
FELT = np.array([0.3, -0.8, 0.5, 0.1, 0.2, 9.8, 0.4, 0.6, -0.7, 0.3, 0.1, 9.7])
HERE, NOTHING_TOLD = np.zeros(4), np.zeros(4)


def state(pitch=0.3):
    """(x, R, P): P full, of plausible size."""
    rng = np.random.default_rng(1)
    x, R = np.zeros(X), R_from_rpy(np.array([0.4, pitch, -0.8]))
    x[:6] = 2.5, 0.3, -0.2, 0.4, -0.5, 0.3
    sigma = np.repeat((0.02, 0.02, 0.1, 0.01, 0.1, 0.003, 0.05, 0.01), (3,) * 7 + (1,))
    A = rng.normal(size=(N, N)) / np.sqrt(N) * sigma[:, None]
    return x, R, A @ A.T + 1e-8 * np.eye(N)


def expected(x, R, led, ahead=0.0):
    """Tangents, H (2, 22); the readable way."""
    motion, felt = RelativeMotion(x[:3], R, x[3:6]), PredictedImu(*FELT.reshape(4, 3))
    H_z, z_rate = gravity_free.seen_jacobian(motion, felt, led)
    H = np.zeros((2, N))
    H[:, :6], H[:, OFFSET] = H_z, z_rate
    return gravity_free.seen_at(motion, led) + z_rate * ahead, H


def covariances(m, sigma=5e-4):
    rng = np.random.default_rng(2)
    A = rng.normal(size=(m, 2, 2))
    C = sigma**2 * (np.eye(2) + 0.3 * A @ A.transpose(0, 2, 1))
    return 0.5 * (C + C.transpose(0, 2, 1))


def picture(x, R, noise=1e-3, seed=3):
    rng = np.random.default_rng(seed)
    places = np.array([expected(x, R, led)[0] for led in LEDS])
    return places + noise * rng.normal(size=places.shape)


def fuse(x, R, P, tangents, C, ahead=HERE, gate=GATE, use=None, leds=LEDS, still=0.0):
    """(χ², use); x, R, P are changed."""
    use = np.full(len(leds), -1, dtype=np.int8) if use is None else use
    return fuse_rays(
        x, R, P, FELT[None], NOTHING_TOLD, leds, ahead, tangents, C, gate, still, use
    ), use


@pytest.mark.parametrize("pitch", [0.3, np.pi / 2, -np.pi / 2])
def test_expected_tangents_and_jacobian_are_the_readable_ones(pitch):
    """Which finite differences vouch for, the derivative by time included: `test_gravity_free`."""
    x, R, _ = state(pitch)
    for led in LEDS:
        place, H = np.empty(2), np.full((2, 8), np.nan)
        assert ray_kernels._expect(x, R, FELT, NOTHING_TOLD, led, 0.01, place, H)
        there, dense = expected(x, R, led, 0.01)
        assert np.abs(place - there).max() < 1e-14
        assert np.abs(H[:, :7] - dense[:, TOUCHED]).max() < 1e-13
        assert not H[:, 7].any()
        assert not np.delete(dense, TOUCHED, axis=1).any()


def test_a_motion_that_is_told_moves_leds_and_is_told_apart():
    x, R, _ = state()
    v, ahead, by_phone = np.array([0.3, -0.2, 0.4]), 0.02, FELT.copy()
    by_phone[:3] = 0.0
    told, whole = np.append(v, 1.0), x.copy()
    whole[3:6] += v
    for led in LEDS:
        (place, H), (other, alone) = ((np.empty(2), np.empty((2, 8))) for _ in range(2))
        assert ray_kernels._expect(x, R, FELT, told, led, ahead, place, H)
        there, dense = expected(whole, R, led, ahead)
        assert place == pytest.approx(there)
        np.testing.assert_allclose(H[:, :7], dense[:, TOUCHED])
        assert ray_kernels._expect(x, R, by_phone, NOTHING_TOLD, led, ahead, other, alone)
        np.testing.assert_allclose(H[:, 6] - H[:, 7], alone[:, 6])
        assert not alone[:, 7].any()
        assert np.abs(H[:, 7]).max() > 0.01


def test_the_compiled_jacobian_is_that_of_finite_differences():
    x, R, _ = state()
    place, H, e = np.empty(2), np.empty((2, 8)), 1e-5

    def seen(error):
        moved = RelativeMotion(x[:3] + error[:3], R @ exp(error[3:6]), x[3:6])
        return gravity_free.seen_at(moved, LEDS[0])

    ray_kernels._expect(x, R, FELT, NOTHING_TOLD, LEDS[0], 0.0, place, H)
    columns = np.array([(seen(e * k) - seen(-e * k)) / (2.0 * e) for k in np.eye(6)]).T
    assert np.abs(H[:, :6] - columns).max() < 1e-9


def test_fusing_is_kalmans_update_in_one_block():
    x, R, P = state()
    tangents, C, ahead = picture(x, R), covariances(4), np.array([0.004, -0.01, 0.0, 0.02])
    rows = [expected(x, R, led, a) for led, a in zip(LEDS, ahead, strict=True)]
    H, S = np.vstack([row[1] for row in rows]), np.zeros((8, 8))
    miss = np.concatenate([z - row[0] for z, row in zip(tangents, rows, strict=True)])
    for i in range(4):
        S[2 * i : 2 * i + 2, 2 * i : 2 * i + 2] = C[i]
    S += H @ P @ H.T
    K = np.linalg.solve(S, H @ P).T
    dx, P_after = K @ miss, P - K @ S @ K.T
    x_before, R_before = x.copy(), R.copy()
    chi2, use = fuse(x, R, P, tangents, C, ahead, gate=np.inf)
    assert (use == 1).all()
    assert chi2 == pytest.approx(miss @ np.linalg.solve(S, miss), rel=1e-9)
    assert np.abs(P - P_after).max() < 1e-12
    assert np.array_equal(P, P.T)
    assert np.abs(x[:3] - x_before[:3] - dx[:3]).max() < 1e-12
    assert np.abs(log(R_before.T @ R) - dx[3:6]).max() < 1e-12
    assert np.abs(x[3:6] - x_before[3:6] - dx[6:9]).max() < 1e-12
    assert np.abs(x[6:] - x_before[6:] - dx[9:]).max() < 1e-12


def test_only_the_led_beyond_its_gate_is_left_out():
    """And the others are fused as if it had not been there."""
    x, R, P = state()
    tangents, C = picture(x, R), covariances(4)
    tangents[2] += 0.1
    others = [0, 1, 3]
    x_o, R_o, P_o = state()
    chi2_o, _ = fuse(x_o, R_o, P_o, tangents[others], C[others], HERE[others], leds=LEDS[others])
    chi2, use = fuse(x, R, P, tangents, C)
    assert use.tolist() == [1, 1, 0, 1]
    assert chi2 == pytest.approx(chi2_o, rel=1e-12)
    assert np.array_equal(x, x_o)
    assert np.array_equal(P, P_o)


def test_the_gate_lets_the_stated_share_of_honest_leds_through():
    """99.9 % of those whose misses are as P and C say; 99 % at another gate."""
    x, R, P = state()
    rng, C = np.random.default_rng(7), covariances(4)[:1]
    place, H = expected(x, R, LEDS[0])
    S = np.linalg.cholesky(H @ P @ H.T + C[0])
    passed = {GATE: 0, 9.21: 0}
    for gate in passed:
        for _ in range(2000):
            z = place + S @ rng.normal(size=2)
            x_k, R_k, P_k = x.copy(), R.copy(), P.copy()
            passed[gate] += int(
                fuse(x_k, R_k, P_k, z[None], C, HERE[:1], gate, leds=LEDS[:1])[1][0]
            )
    assert 1993 <= passed[GATE] <= 2000
    assert 1965 <= passed[9.21] <= 1993


def test_decisions_made_before_are_kept():
    x, R, P = state()
    tangents, C = picture(x, R), covariances(4)
    tangents[0] += 0.5
    decided = np.array([1, 0, 1, 0], dtype=np.int8)
    _, use = fuse(x, R, P, tangents, C, use=decided)
    assert use.tolist() == [1, 0, 1, 0]


def test_a_row_exposed_later_is_compared_with_where_the_led_will_be():
    """30 ms of rolling shutter over a moving robot agree with the state at its middle."""
    x, R, P = state()
    inputs, ahead = PredictedImu(*FELT.reshape(4, 3)), np.array([-0.015, -0.005, 0.005, 0.015])
    at = [gravity_free.step(RelativeMotion(x[:3], R, x[3:6]), inputs, h) for h in ahead]
    tangents = np.array([gravity_free.seen_at(m, led) for m, led in zip(at, LEDS, strict=True)])
    C = np.tile(1e-7 * np.eye(2), (4, 1, 1))
    dated, ignorant = (fuse(x.copy(), R.copy(), P.copy(), tangents, C, a)[0] for a in (ahead, HERE))
    assert dated < 0.02 * ignorant


def test_the_time_offset_is_learnt_from_the_motion_in_the_picture():
    x, R, P = state()
    P = np.diag(np.diag(P))
    P[:6, :6] = 1e-10 * np.eye(6)
    tangents = np.array([expected(x, R, led, 0.004)[0] for led in LEDS])
    fuse(x, R, P, tangents, 1e-10 * np.tile(np.eye(2), (4, 1, 1)), gate=np.inf)
    assert x[X_OFFSET] == pytest.approx(0.004, abs=2e-4)


def test_an_led_behind_the_picture_is_no_measurement():
    x, R, P = state()
    x[0] = 0.15
    before = P.copy()
    chi2, use = fuse(x, R, P, np.zeros((4, 2)), covariances(4))
    behind = (x[0] + LEDS @ R.T[:, 0]) <= NEAREST_M
    assert behind.any()
    assert not use[behind].any()
    x[0] = -2.0
    chi2, use = fuse(x, R, before.copy(), np.zeros((4, 2)), covariances(4), gate=np.inf)
    assert (chi2, use.any()) == (0.0, False)


def test_a_hundred_pictures_leave_p_symmetric_and_positive():
    x, R, P = state()
    for seed in range(100):
        fuse(x, R, P, picture(x, R, 1e-5, seed), covariances(4, 1e-5))
    scale = np.sqrt(np.diag(P))
    assert is_sound(x, R, P)
    assert np.array_equal(P, P.T)
    assert np.linalg.eigvalsh(P / np.outer(scale, scale))[0] > -1e-9


@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf, 1e10])
def test_a_state_that_is_no_number_is_not_sound(bad):
    assert is_sound(*state())
    for k, index in ((0, (4,)), (1, (0, 0)), (2, (7, 7))):
        parts = state()
        parts[k][index] = bad
        assert not is_sound(*parts)
    x, R, P = state()
    P[3, 3] = -1e-12
    assert not is_sound(x, R, P)


def test_nan_in_the_covariance_is_told_by_chi2_or_refused():
    x, R, P = state()
    P[0, 0] = np.nan
    chi2, _ = fuse(x, R, P, np.zeros((4, 2)), covariances(4), use=np.ones(4, dtype=np.int8))
    assert np.isnan(chi2)
    x, R, P = state()
    P[0, 0] = np.nan
    assert not fuse(x, R, P, np.zeros((4, 2)), covariances(4))[1].any()


def test_a_correction_is_added_where_it_belongs():
    x, R, _ = state()
    dx = np.arange(1.0, N + 1.0) * 1e-3
    before, R_before = x.copy(), R.copy()
    correct(x, R, dx)
    added = x - before
    assert np.allclose(added, np.concatenate((dx[:3], dx[6:9], dx[9:])))
    assert np.abs(R - R_before @ exp(dx[3:6])).max() < 1e-15


def fused(still):
    """(x, R, P) of one picture, LEDs slower than `still` [rad/s] not believed about the offset."""
    x, R, P = state(0.3)
    fuse(x, R, P, picture(x, R), covariances(4), still=still)
    return x, R, P


def test_of_slow_leds_nothing_is_believed_about_the_time_offset():
    x, _, P = state(0.3)
    whole, held = fused(0.0), fused(1e6)
    rest = np.arange(len(P)) != OFFSET
    assert held[0][X_OFFSET] == pytest.approx(x[X_OFFSET], abs=1e-12)
    assert held[2][OFFSET, OFFSET] == pytest.approx(P[OFFSET, OFFSET])
    assert whole[2][OFFSET, OFFSET] < P[OFFSET, OFFSET]
    np.testing.assert_allclose(held[2][np.ix_(rest, rest)], whole[2][np.ix_(rest, rest)])
    np.testing.assert_allclose(np.delete(held[0], X_OFFSET), np.delete(whole[0], X_OFFSET))


def test_of_leds_that_pass_by_what_is_told_little_is_believed_about_the_time_offset():
    """Of the same picture all is, where sensors of the body's own say that it moves so."""
    x, R, P = state()
    tangents, offsets, speed = picture(x, R), {}, np.array([2.0, -2.0, 1.0])
    for name, told in (("felt", NOTHING_TOLD), ("told", np.append(speed, 1.0))):
        here, there, known = x.copy(), R.copy(), P.copy()
        if name == "felt":
            here[3:6] += speed
        before = here[X_OFFSET]
        use = np.full(len(LEDS), -1, dtype=np.int8)
        C = covariances(4)
        fuse_rays(here, there, known, FELT[None], told, LEDS, HERE, tangents, C, GATE, 0.01, use)
        offsets[name] = here[X_OFFSET] - before, known[OFFSET, OFFSET] / P[OFFSET, OFFSET]
    assert abs(offsets["told"][0]) < 0.1 * abs(offsets["felt"][0])
    assert offsets["told"][1] > 0.8 > 0.5 > offsets["felt"][1]


def test_of_fast_leds_all_is_believed_about_the_time_offset():
    for a, b in zip(fused(0.0), fused(1e-3), strict=True):
        np.testing.assert_allclose(a, b, rtol=1e-6, atol=1e-9)
