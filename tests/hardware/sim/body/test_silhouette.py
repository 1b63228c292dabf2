"""A body's cover of the picture, against its shape seen through a point spread; who hides whom."""

from dataclasses import replace

import cv2
import numpy as np
import pytest
from scipy.special import ndtr

from hardware.robot_file import load_robot
from hardware.sim.body.shape import body_of
from hardware.sim.body.silhouette_kernels import cover_disc, cover_rod
from hardware.sim.render import RenderOptions, render
from hardware.sim.scenes.scene import SCENES, VGA
from hardware.sim.scenes.video import RenderedVideo
from pipeline.frames import R_from_rpy
from tests.pipeline.seeing import CAMERA, LEDS_IN_B

SIDE, FINE = 48, 16
BLUR_PX, ROW_S = 0.9, 4e-5
NOW = np.zeros(1)
PLANT = load_robot("ames").plant
BUILT = {name: replace(scene, has_body=True) for name, scene in SCENES.items()}
BEHIND, BEFORE = np.array([[0.0, 0.0, 0.0]]), np.array([[-0.30, 0.0, 0.0]])


def rod(ends, half_px, times=NOW, velocity=(0.0, 0.0), row_s=0.0, shade=0.0):
    ways = np.zeros((2, 6))
    ways[:, :2], ways[:, 2:4] = ends, velocity
    cover, tone = np.zeros((2, SIDE, SIDE), np.float32)
    half = np.array(half_px, dtype=float)
    cover_rod(0, 0, ways, half, row_s, np.asarray(times), BLUR_PX, shade, cover, tone)
    return cover, tone


def disc(middle, one, other, thick_px=0.0, times=NOW, velocity=(0.0, 0.0)):
    ways = np.zeros((3, 6))
    ways[:, :2] = middle
    ways[1, :2] += one
    ways[2, :2] += other
    ways[:, 2:4] = velocity
    cover = np.zeros((SIDE, SIDE), np.float32)
    cover_disc(0, 0, ways, thick_px, 0.0, np.asarray(times), BLUR_PX, cover)
    return cover


def plain_rod(ends, half_px, times=NOW, velocity=(0.0, 0.0), row_s=0.0):
    """The same as `cover_rod`, for all pixels at once."""
    v, u = np.mgrid[:SIDE, :SIDE].astype(float)
    total = np.zeros((SIDE, SIDE))
    for time in times:
        at = [e + ((v - e[1]) * row_s + time)[..., None] * np.array(velocity) for e in ends]
        x, along = np.stack((u, v), axis=2) - at[0], at[1] - at[0]
        s = np.clip((x * along).sum(axis=2) / (along**2).sum(axis=2), 0.0, 1.0)
        off = np.linalg.norm(x - s[..., None] * along, axis=2)
        half = half_px[0] + s * (half_px[1] - half_px[0])
        total += ndtr((half - off) / BLUR_PX) + ndtr((half + off) / BLUR_PX) - 1.0
    return total / len(times)


def blurred(inside):
    """A shape (x, y → bool), seen through the point spread."""
    at = (np.arange(SIDE * FINE) + 0.5) / FINE - 0.5
    shape = inside(at[None], at[:, None]).astype(np.float32)
    soft = cv2.GaussianBlur(shape, (0, 0), BLUR_PX * FINE)
    return soft.reshape(SIDE, FINE, SIDE, FINE).mean(axis=(1, 3))


@pytest.mark.parametrize("row_s", [0.0, ROW_S])
@pytest.mark.parametrize("velocity", [(0.0, 0.0), (700.0, -300.0)])
@pytest.mark.parametrize(
    "ends", [[(8.3, 30.1), (39.2, 14.7)], [(20, 9.5), (20, 38)], [(9, 9), (9.1, 9)]]
)
def test_a_rods_cover_is_what_it_is_by_its_readable_twin(ends, velocity, row_s):
    ends, times = np.array(ends, dtype=float), np.linspace(-4e-3, 4e-3, 5)
    cover, tone = rod(ends, (2.5, 1.2), times, velocity, row_s)
    expected = plain_rod(ends, (2.5, 1.2), times, velocity, row_s)
    np.testing.assert_allclose(cover, expected, atol=2e-3)
    np.testing.assert_array_equal(cover, tone)


@pytest.mark.parametrize("half_px", [0.3, 2.0, 6.0])
def test_a_rods_sides_are_a_strips_seen_through_the_point_spread(half_px):
    ends = np.array([(-40.0, 10.0), (90.0, 40.0)])
    way = (ends[1] - ends[0]) / np.linalg.norm(ends[1] - ends[0])
    inside = blurred(
        lambda x, y: np.abs((x - ends[0, 0]) * way[1] - (y - ends[0, 1]) * way[0]) < half_px
    )
    cover = rod(ends, (half_px, half_px))[0]
    inner = np.s_[4:-4, 4:-4]
    np.testing.assert_allclose(cover[inner], inside[inner], atol=0.02)


@pytest.mark.parametrize(
    ("one", "other"),
    [((9.0, 0.0), (0.0, 9.0)), ((11.0, 3.0), (-1.0, 5.0)), ((8.0, 8.0), (3.0, -3.0))],
)
def test_a_discs_cover_is_an_ellipse_seen_through_the_point_spread(one, other):
    middle, to_disc = np.array([23.4, 22.8]), np.linalg.inv(np.array([one, other]).T)

    def inside(x, y):
        a, b = (row[0] * (x - middle[0]) + row[1] * (y - middle[1]) for row in to_disc)
        return a * a + b * b < 1.0

    np.testing.assert_allclose(disc(middle, one, other), blurred(inside), atol=0.13)
    area = np.pi * abs(np.linalg.det(to_disc)) ** -1
    assert disc(middle, one, other).sum() == pytest.approx(area, rel=0.03)


def test_a_disc_from_its_edge_is_as_thick_as_its_blade():
    thin = disc((24.0, 24.0), (12.0, 0.0), (0.0, 0.0), thick_px=0.8)
    assert thin.sum() == pytest.approx(np.pi * 12.0 * 0.8, rel=0.3)
    assert thin[24, 24] > 3.0 * thin[21, 24]


def test_motion_blurs_a_disc_and_keeps_what_it_covers():
    still = disc((24.0, 24.0), (6.0, 0.0), (0.0, 6.0))
    times = np.linspace(-5e-3, 5e-3, 21)
    blurred = disc((24.0, 24.0), (6.0, 0.0), (0.0, 6.0), 0.0, times, (1200.0, 0.0))
    assert blurred.sum() == pytest.approx(still.sum(), rel=1e-3)
    assert (blurred > 0.02).any(axis=0).sum() > (still > 0.02).any(axis=0).sum() + 8


def test_a_rod_joins_the_places_at_which_its_ends_are_seen_whatever_its_rows_times():
    ends = np.array([(24.0, 5.0), (24.0, 43.0)])
    cover = rod(ends, (2.0, 2.0), velocity=(5000.0, 0.0), row_s=ROW_S)[0]
    still = rod(ends, (2.0, 2.0))[0]
    np.testing.assert_allclose(cover[10:38], still[10:38], atol=0.03)


def test_one_side_of_a_shaded_rod_is_brighter_by_as_much_as_the_other_is_darker():
    cover, tone = rod(np.array([(4.0, 24.0), (44.0, 24.0)]), (5.0, 5.0), shade=0.4)
    column = (tone / np.maximum(cover, 1e-6))[:, 24]
    assert column[21] == pytest.approx(2.0 - column[27], abs=1e-5)
    assert abs(column[21] - column[27]) == pytest.approx(0.48, abs=1e-3)


def alone(led_in_b, light=0.3, seed=0, **look):
    """A lone LED and its robot, seen straight from behind."""
    body = replace(body_of(LEDS_IN_B, PLANT, 0.02, np.random.default_rng(seed)), opacity=1.0)
    body = replace(body, lights=np.full(len(body.lights), light))
    still = (R_from_rpy(np.zeros(3)), np.array([2.5, 0.0, 0.0]))
    at = CAMERA.pixels(still[1] + led_in_b)[0].round().astype(int)
    options = RenderOptions(noise=0.0, halo=0.0, **look)
    luma = render(CAMERA, lambda _: still, led_in_b, options, np.random.default_rng(0), body)
    return int(luma[at[1], at[0]])


def test_a_light_behind_the_hub_is_hidden_and_one_before_it_shines():
    assert alone(BEFORE) == 255
    assert alone(np.array([[0.30, 0.0, 0.0]])) < 160


def test_an_arm_does_not_hide_the_led_that_it_carries():
    for led in LEDS_IN_B[[0, 2, 4]]:
        assert alone(led[None]) == 255


def films(name, seed, **changes):
    scene = SCENES[name]
    return [
        RenderedVideo(replace(scene, has_body=b, **changes), seed, VGA, 2) for b in (False, True)
    ]


@pytest.mark.parametrize("name", ["typical", "rolling_shutter"])
def test_a_body_changes_the_picture_and_nothing_else_that_is_true(name):
    bare, built = films(name, 3)
    for a, b in zip(bare, built, strict=True):
        np.testing.assert_array_equal(a.pixels, b.pixels)
        np.testing.assert_array_equal(a.p_bc_in_c, b.p_bc_in_c)
        assert [x.t for x in a.phone] == [x.t for x in b.phone]
        changed = a.luma != b.luma
        assert 500 < changed.sum() < 0.3 * changed.size


def test_a_film_seen_again_has_the_same_body_and_another_seed_another():
    (one, again), (two, _) = (
        [f.luma for f in RenderedVideo(BUILT["typical"], seed, VGA, 2)] for seed in (3, 4)
    )
    film = RenderedVideo(BUILT["typical"], 3, VGA, 2)
    np.testing.assert_array_equal(next(iter(film)).luma, one)
    assert not np.array_equal(one, two)
    assert again.shape == one.shape


def test_bodies_are_darker_and_brighter_than_their_rooms():
    lights = [
        body_of(LEDS_IN_B, PLANT, 0.02, np.random.default_rng(k)).lights.mean() for k in range(40)
    ]
    assert min(lights) < 0.005
    assert max(lights) > 0.08


def test_a_propeller_dims_what_is_behind_it_and_does_not_count_as_hiding():
    body = body_of(LEDS_IN_B, PLANT, 0.02, np.random.default_rng(0))
    assert 0.0 < body.opacity < 0.5
    shots = [next(iter(RenderedVideo(BUILT["clean"], seed, VGA, 1))) for seed in range(12)]
    assert np.mean([shot.visible.mean() for shot in shots]) > 0.95
