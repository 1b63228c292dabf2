from dataclasses import replace

import numpy as np
import pytest

from hardware.sim.render import RenderOptions, render
from pipeline.signals import Frame
from pipeline.spots.leds import find_spots
from pipeline.vision_config import LedsConfig
from tests.pipeline.seeing import CAMERA

ONE = np.zeros((1, 3))
DARK = RenderOptions(noise=0.0, halo=0.0)


def still(x=2.5, y=0.1, z=0.05):
    return lambda _: (np.eye(3), np.array([x, y, z]))


def shot(pose, look=DARK, seed=0, leds=ONE, camera=CAMERA):
    return render(camera, pose, leds, look, np.random.default_rng(seed))


def bright(luma, level=128):
    return int((luma > level).sum())


def spots(luma):
    return find_spots(Frame(0.0, luma), LedsConfig())


def test_a_picture_is_grey_levels_of_the_cameras_size():
    luma = shot(still())
    assert luma.shape == (720, 1280)
    assert luma.dtype == np.uint8


def test_light_falls_where_the_camera_projects_it():
    expected = CAMERA.pixels(np.array([[2.5, 0.1, 0.05]]))
    np.testing.assert_allclose(spots(shot(still())).pixels, expected, atol=0.03)


def test_the_leds_size_counts():
    small, large = (bright(shot(still(), replace(DARK, led_radius_m=r))) for r in (0.008, 0.024))
    assert large > 4 * small


def test_twice_as_near_is_four_times_the_area():
    look = replace(DARK, led_radius_m=0.03)
    ratio = bright(shot(still(1.25), look)) / bright(shot(still(2.5), look))
    assert ratio == pytest.approx(4.0, rel=0.15)


def test_strong_light_saturates_and_weak_does_not():
    assert shot(still(), replace(DARK, led_light=5.0)).max() == 255
    assert shot(still(), replace(DARK, led_light=0.3)).max() < 200


def test_motion_blurs_along_its_way_and_leaves_the_middle():
    def moving(t):
        return np.eye(3), np.array([2.5, 0.1 + 4.0 * t, 0.05])  # 15 px in 10 ms

    look = replace(DARK, exposure_s=0.01, sub_exposures=12)
    luma = shot(moving, look)
    rows, columns = np.nonzero(luma > 128)
    assert np.ptp(columns) > np.ptp(rows) + 8
    expected = CAMERA.pixels(np.array([[2.5, 0.1, 0.05]]))
    np.testing.assert_allclose(spots(luma).pixels, expected, atol=0.3)


@pytest.mark.parametrize("place", [(-2.5, 0.1, 0.0), (0.05, 0.0, 0.0), (2.5, 9.0, 0.0)])
def test_leds_behind_too_near_or_beside_are_not_in_the_picture(place):
    assert np.array_equal(shot(still(*place)), shot(still(), leds=np.zeros((0, 3))))


def test_a_led_on_the_border_is_cut_not_wrapped():
    edge = CAMERA.normalised(np.array([[0.0, 300.0]]))[0]
    luma = shot(still(2.5, -2.5 * edge[0], -2.5 * edge[1]))
    assert luma[:, :20].max() > 200
    assert luma[:, 640:].max() < 128


def test_the_same_seed_gives_the_same_picture_and_another_one_other_noise():
    look = RenderOptions()
    assert np.array_equal(shot(still(), look, seed=1), shot(still(), look, seed=1))
    difference = shot(still(), look, seed=1).astype(int) - shot(still(), look, seed=2)
    assert 0.5 < difference.std() < 10.0
    assert abs(difference.mean()) < 0.1


def test_lamps_stay_where_they_are():
    look = replace(DARK, distractors=6)
    one, other = shot(still(), look), shot(still(2.5, 0.3), look)
    assert len(spots(one)) >= 5
    moved = (one.astype(int) - other) != 0
    assert moved.sum() < 3000  # nothing but the LED
