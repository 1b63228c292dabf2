import numpy as np

from pipeline.frames import exp
from pipeline.identification.tilt_bias import TiltBias
from tests.pipeline.seeing import truth_at


def angle(a, b):
    return float(np.arccos(np.clip(a @ b, -1.0, 1.0)))


def test_a_vertical_that_is_off_is_put_right_by_believed_poses():
    rng = np.random.default_rng(90)
    leaning, bias = TiltBias(), np.array([0.09, -0.06, 0.02])
    for _ in range(60):
        truth = truth_at(rng)
        prior = truth.prior(rng, 0.005)
        leaning.learn(prior.up_in_c, exp(bias) @ prior.up_in_b, truth.R)
    truth = truth_at(rng)
    true = truth.prior().up_in_b
    felt = exp(bias) @ true
    assert angle(leaning.corrected(felt), true) < 0.15 * angle(felt, true)


def test_without_verticals_nothing_is_learnt_and_nothing_changed():
    leaning, up = TiltBias(), np.array([0.0, 0.6, 0.8])
    leaning.learn(None, up, np.eye(3))
    leaning.learn(up, None, np.eye(3))
    np.testing.assert_array_equal(leaning.corrected(up), up)
    assert leaning.corrected(None) is None
