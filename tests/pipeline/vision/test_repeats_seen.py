"""A frame that comes again leaves all that looks as it was, to the last bit."""

from __future__ import annotations

import numpy as np

from pipeline.frames import GRAVITY
from pipeline.signals import BodyImu, Frame, PhoneImu
from pipeline.vision.visual_front_end import VisualFrontEnd
from pipeline.vision_config import GatesConfig
from tests.pipeline.seeing import CAMERA, LEDS_IN_B, moved, picture, truth_at

DT = 1.0 / 30.0


def test_frames_that_come_again_change_nothing_to_the_last_bit() -> None:
    rng = np.random.default_rng(1000)
    once, again = (VisualFrontEnd(CAMERA, LEDS_IN_B, GatesConfig()) for _ in range(2))
    truth = truth_at(rng)
    for k in range(-6, 6):
        t, up_in_b = k * DT, truth.prior().up_in_b
        for front_end in (once, again):
            for sampled in (t, t + 0.5 * DT):  # the phone trembles, before its first picture too
                shaken = np.array([0.0, 0.12 * np.cos(30.0 * sampled), 0.0])
                front_end.add_imu(
                    PhoneImu(sampled, shaken, GRAVITY * truth.prior().up_in_c),
                    BodyImu(sampled, np.zeros(3), GRAVITY * up_in_b),
                )
        if k < 0:
            continue
        luma = picture(truth, rng)
        first, second = (x.process(Frame(t, luma)) for x in (once, again))
        for later in (0.3 * DT, 0.6 * DT):
            copy = again.process(Frame(t + later, luma.copy()))
            assert copy.comes_again
            assert copy.seen(CAMERA) is None
        assert not first.comes_again
        assert first.pose is not None
        assert second.pose is not None
        assert np.array_equal(first.pose.p_bc_in_c, second.pose.p_bc_in_c)
        assert np.array_equal(first.pose.R_cb, second.pose.R_cb)
        assert np.array_equal(first.pose.covariance, second.pose.covariance)
        assert np.array_equal(first.rays.tangents, second.rays.tangents)
        assert np.array_equal(first.rays.covariances, second.rays.covariances)
        truth = moved(truth, rng)
