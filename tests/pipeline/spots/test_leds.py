from dataclasses import replace

import numpy as np
import pytest

from hardware.sim.render import RenderOptions
from pipeline.signals import Frame
from pipeline.spots import leds
from pipeline.spots.leds import find_spots, spots_near
from pipeline.spots.spot_kernels import measure
from pipeline.vision_config import LedsConfig
from tests.pipeline.seeing import picture, truth_at

CONFIG = LedsConfig()
ROOM = 30


def spot_at(u, v, sigma=1.5, peak=160.0, size=(240, 320), room=ROOM):
    x, y = np.arange(size[1])[None], np.arange(size[0])[:, None]
    light = peak * np.exp(-0.5 * ((x - u) ** 2 + (y - v) ** 2) / sigma**2)
    return np.clip(np.round(room + light), 0, 255).astype(np.uint8)


def limited(luma):
    return np.round(16.0 + luma * (219.0 / 255.0)).astype(np.uint8)


def nearest_distance(pixels, spots):
    return np.linalg.norm(pixels[:, None] - spots.pixels[None], axis=2).min(axis=1)


LOOKS = {
    "saturated": RenderOptions(),
    "not saturated": RenderOptions(led_light=0.7),
    "blurred": RenderOptions(blur_px=1.6),
    "noisy": RenderOptions(noise=0.01),
    "bright room": RenderOptions(room=0.1),
}


@pytest.mark.parametrize("look", LOOKS.values(), ids=LOOKS)
@pytest.mark.parametrize("is_limited", [False, True], ids=["full range", "video range"])
def test_leds_are_found_to_a_few_hundredths_of_a_pixel(look, is_limited):
    rng = np.random.default_rng(20)
    errors = []
    for distance in (1.5, 2.5, 3.5):
        truth = truth_at(rng, distance)
        luma = picture(truth, rng, look)
        frame = Frame(0.0, limited(luma) if is_limited else luma, not is_limited)
        errors.extend(nearest_distance(truth.pixels(), find_spots(frame, CONFIG)))
        near = spots_near(frame, truth.pixels() + 3.0, np.full(5, 12.0), CONFIG)
        errors.extend(nearest_distance(truth.pixels(), near))
    assert np.median(errors) <= 0.06
    assert max(errors) <= 0.2


def test_a_spot_is_where_its_light_is_whatever_part_of_a_pixel():
    for shift in np.linspace(0.0, 1.0, 5):
        spots = find_spots(Frame(0.0, spot_at(100.0 + shift, 80.0 - shift)), CONFIG)
        np.testing.assert_allclose(spots.pixels, [[100.0 + shift, 80.0 - shift]], atol=0.06)


@pytest.mark.parametrize("place", [(1.0, 100.0), (318.5, 100.0), (160.0, 0.0), (160.0, 238.6)])
def test_a_spot_cut_by_the_pictures_border_is_none(place):
    frame = Frame(0.0, spot_at(*place))
    assert len(find_spots(frame, CONFIG)) == 0
    assert len(spots_near(frame, np.array([place]), np.array([12.0]), CONFIG)) == 0


def test_windows_outside_the_picture_hold_nothing():
    frame = Frame(0.0, spot_at(100.0, 80.0))
    outside = np.array([[-500.0, 20.0], [1e6, 1e6], [100.0, -40.0]])
    assert len(spots_near(frame, outside, np.full(3, 15.0), CONFIG)) == 0


@pytest.mark.parametrize("half", [1e-3, 1e9])
def test_windows_of_any_size_are_bounded(half):
    frame = Frame(0.0, spot_at(100.0, 80.0))
    assert len(spots_near(frame, np.array([[101.0, 80.0]]), np.array([half]), CONFIG)) <= 1


def test_dim_small_and_huge_lights_are_no_spots():
    for luma in (
        spot_at(100, 80, peak=5.0),
        spot_at(100, 80, sigma=0.25),
        spot_at(100, 80, sigma=60.0),
        np.zeros((240, 320), np.uint8),
        np.full((240, 320), 255, np.uint8),
    ):
        assert len(find_spots(Frame(0.0, luma), CONFIG)) == 0


def test_the_same_contrast_counts_in_video_range():
    at_limit = spot_at(100, 80, peak=CONFIG.min_contrast + 3.0, room=0)
    assert len(find_spots(Frame(0.0, at_limit), CONFIG)) == 1
    assert len(find_spots(Frame(0.0, limited(at_limit), full_range=False), CONFIG)) == 1


def test_the_brightest_come_first_and_overlapping_windows_count_a_spot_once():
    luma = np.maximum(spot_at(100, 80, peak=90.0), spot_at(200, 150, peak=200.0))
    centres = np.array([[99.0, 80.0], [102.0, 81.0], [200.0, 150.0]])
    spots = spots_near(Frame(0.0, luma), centres, np.full(3, 10.0), CONFIG)
    np.testing.assert_allclose(spots.pixels, [[200.0, 150.0], [100.0, 80.0]], atol=0.05)
    assert spots.brightness[0] > spots.brightness[1]


def test_elongated_and_dim_spots_claim_less():
    def covariance(luma):
        return find_spots(Frame(0.0, luma), CONFIG).covariances[0]

    streak = np.max([spot_at(100 + k, 80) for k in range(-6, 7)], axis=0)
    assert covariance(streak)[0, 0] > 2.0 * covariance(spot_at(100, 80))[0, 0]
    assert covariance(streak)[0, 0] > 2.0 * covariance(streak)[1, 1]
    assert covariance(spot_at(100, 80, peak=45.0))[0, 0] > covariance(spot_at(100, 80))[0, 0]


def test_a_room_full_of_lamps_is_bounded_work_and_says_so(monkeypatch):
    rng = np.random.default_rng(21)
    windows = []

    def counting(luma, light, slope, places, *arguments):
        windows.append(len(places))
        return measure(luma, light, slope, places, *arguments)

    monkeypatch.setattr(leds, "measure", counting)
    lamps = picture(truth_at(rng), rng, RenderOptions(distractors=400))
    static = rng.integers(0, 256, (720, 1280), dtype=np.uint8)
    for luma in (lamps, static):
        spots = find_spots(Frame(0.0, luma), CONFIG)
        assert len(spots) <= CONFIG.max_spots
        assert spots.bounded
        assert windows.pop() <= leds.MAX_PLACES
    assert not find_spots(Frame(0.0, picture(truth_at(rng), rng)), CONFIG).bounded


def test_leds_are_found_in_a_picture_full_of_noise():
    rng = np.random.default_rng(24)
    luma = np.clip(spot_at(250.0, 200.0, peak=200.0) + rng.normal(0.0, 10.0, (240, 320)), 0, 255)
    spots = find_spots(Frame(0.0, luma.astype(np.uint8)), CONFIG)
    assert nearest_distance(np.array([[250.0, 200.0]]), spots)[0] < 0.2


def test_leds_much_dimmer_than_four_lamps_are_found_beside_lamps():
    lamps = [spot_at(60.0 + 50.0 * k, 40.0, peak=210.0) for k in range(4)]
    leds_at = np.array([[60.0 + 40.0 * k, 150.0 + 10.0 * k] for k in range(5)])
    luma = np.max([*lamps, *(spot_at(u, v, peak=30.0) for u, v in leds_at)], axis=0)
    rng = np.random.default_rng(25)
    luma = np.clip(np.round(luma + rng.normal(0.0, 2.0, luma.shape)), 0, 255).astype(np.uint8)
    assert len(find_spots(Frame(0.0, luma), CONFIG)) == 4
    spots = find_spots(Frame(0.0, luma), CONFIG, beside_lamps=True)
    assert len(spots) == 9
    assert nearest_distance(leds_at, spots).max() < 0.2


def test_max_spots_keeps_the_brightest():
    rng = np.random.default_rng(22)
    frame = Frame(0.0, picture(truth_at(rng), rng))
    five, three = find_spots(frame, CONFIG), find_spots(frame, replace(CONFIG, max_spots=3))
    assert np.array_equal(five.pixels[:3], three.pixels)


def test_read_only_rows_with_gaps_give_the_same_and_compile_nothing():
    rng = np.random.default_rng(23)
    luma = picture(truth_at(rng), rng)
    gaps = np.zeros((720, 1344), np.uint8)
    gaps[:, :1280] = luma
    decoded = np.frombuffer(gaps.tobytes(), np.uint8).reshape(720, 1344)[:, :1280]
    assert not decoded.flags.writeable
    assert not decoded.flags.c_contiguous
    expected = find_spots(Frame(0.0, luma), CONFIG)
    for same in (decoded, gaps[:, :1280]):
        assert np.array_equal(find_spots(Frame(0.0, same), CONFIG).pixels, expected.pixels)
    assert len(measure.signatures) == 1
