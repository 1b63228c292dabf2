"""What a spot claims of its place, against where the LED was: light, dark, still, moving."""

import numpy as np
import pytest

from hardware.codec import Decoder, Encoder
from hardware.sim.render import RenderOptions, render
from pipeline.frames import exp
from pipeline.signals import Frame
from pipeline.spots.leds import find_spots
from pipeline.vision_config import LedsConfig
from tests.pipeline.seeing import CAMERA, LEDS_IN_B, moved, picture, truth_at

LOOKS = {
    "clean": RenderOptions(),
    "ordinary room": RenderOptions(room=0.06, noise=0.004, exposure_s=0.008),
    "low light": RenderOptions(led_light=0.6, room=0.01, noise=0.012),
    "trembling": RenderOptions(exposure_s=0.008, sub_exposures=8),
}
TREMOR_RAD, TREMOR_HZ, HAND_RAD_S = 0.0005, 9.0, 0.1


def pictures(rng, look, count):
    for _ in range(count):
        truth = truth_at(rng)
        turn, tremor = rng.normal(0.0, HAND_RAD_S, 3), rng.normal(0.0, TREMOR_RAD, 3)
        phase = rng.uniform(0.0, 2.0 * np.pi)

        def pose(t, truth=truth, turn=turn, tremor=tremor, phase=phase):
            shake = np.sin(2.0 * np.pi * TREMOR_HZ * t + phase) - np.sin(phase)
            turned = exp(-(t * turn + shake * tremor))
            return turned @ truth.R, turned @ truth.p

        yield truth, render(CAMERA, pose, LEDS_IN_B, look, rng)


def whitened(truth, frame):
    """Squared error over its claimed covariance of each LED's spot."""
    spots = find_spots(frame, LedsConfig())
    off = truth.pixels()[:, None] - spots.pixels[None]
    nearest = np.argmin((off**2).sum(axis=2), axis=1)
    own = off[np.arange(len(off)), nearest]
    close = (own**2).sum(axis=1) < 1.0
    solved = np.linalg.solve(spots.covariances[nearest[close]], own[close][:, :, None])
    return (own[close] * solved[:, :, 0]).sum(axis=1)


def is_honest(squares):
    """Two degrees of freedom: the median of a true claim is 1.39."""
    assert len(squares) > 60
    return 0.6 < np.median(squares) < 1.8


@pytest.mark.parametrize("look", LOOKS.values(), ids=LOOKS)
def test_a_spots_covariance_is_what_its_places_scatter(look):
    rng = np.random.default_rng(31)
    squares = [whitened(truth, Frame(0.0, luma)) for truth, luma in pictures(rng, look, 16)]
    assert is_honest(np.concatenate(squares))


@pytest.mark.parametrize("bitrate_bps", [1_000_000, 4_000_000])
def test_a_spot_of_a_coded_stream_claims_what_the_codec_leaves(bitrate_bps):
    rng, squares = np.random.default_rng(32), []
    encoder = Encoder(CAMERA.width, CAMERA.height, 30.0, bitrate_bps)
    decoder = Decoder("h264", CAMERA.width, CAMERA.height)
    truth = truth_at(rng)
    for _ in range(16):
        luma = picture(truth, rng, LOOKS["ordinary room"])
        decoded = decoder.decode(encoder.encode(luma)[0])
        squares.append(whitened(truth, Frame(0.0, decoded, full_range=False)))
        truth = moved(truth, rng)
    assert is_honest(np.concatenate(squares))


def test_noise_around_a_spot_makes_it_less_sure():
    rng = np.random.default_rng(33)
    luma = np.full((240, 320), 40, np.uint8)
    v, u = np.mgrid[:240, :320]
    luma = luma + np.round(160.0 * np.exp(-((u - 100.3) ** 2 + (v - 80.6) ** 2) / 8.0))
    noisy = luma + rng.normal(0.0, 8.0, luma.shape)
    areas = [
        np.linalg.det(find_spots(Frame(0.0, x.astype(np.uint8)), LedsConfig()).covariances[0])
        for x in (luma, noisy)
    ]
    assert areas[1] > 1.5 * areas[0]
