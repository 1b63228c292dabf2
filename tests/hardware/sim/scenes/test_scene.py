from dataclasses import replace

import numpy as np
import pytest

from hardware.sim.scenes.crlb import place_information
from hardware.sim.scenes.kernels import STEP_PX
from hardware.sim.scenes.motion import FLAT_LEDS, START_S, movers
from hardware.sim.scenes.optics import Lamp, Optics, Pane, profile_of
from hardware.sim.scenes.scene import (
    HD,
    SCENES,
    SIZES,
    VGA,
    HandMotion,
    ImageOrientation,
    at_reference,
    is_reporting,
)
from hardware.sim.scenes.sensor import Sensor
from hardware.sim.scenes.video import RenderedVideo, camera_of
from pipeline.frames import log

FINE = np.linspace(0.0, 1.0, 2000)
PLAIN = Optics(0.9, 0.0, 6.0, 5e3, 1e-6, 0.004)
QUIET = {"electrons": (1e7, 1e7), "read_noise": (1e-6, 1e-6)}
DARK = {"room_light": (1e-4, 1e-4), "texture": 0.0, "lamps": (0, 0), "halo": (0.0, 0.0)}


def shots(name, seed=3, frames=3, size=VGA, **changes):
    return list(RenderedVideo(replace(SCENES[name], **changes), seed, size, frames))


def centroid(luma, place, half, optics=PLAIN):
    """Intensity-weighted, in linear light."""
    linear = np.interp(np.arange(256), optics.tone(FINE), FINE)
    u, v = np.round(place).astype(int)
    light = linear[luma[v - half : v + half + 1, u - half : u + half + 1]]
    light[light < 0.004] = 0.0
    rows, columns = np.mgrid[v - half : v + half + 1, u - half : u + half + 1]
    return np.array([(light * columns).sum(), (light * rows).sum()]) / light.sum()


def sensor(**changes):
    return Sensor(replace(PLAIN, **changes), 64, 64, 0.0)


def lamp_at(u, v, radius_px=2.0, light=0.5):
    return Lamp(np.array([u, v, 0.0, 0.0, 0.0, 0.0]), radius_px, light)


def drawn(eye, lamps=(), panes=(), room=1e-4):
    dark = np.full((64, 64), room, dtype=np.float32)
    grey = np.full((64, 64), round(255.0 * room ** (1 / 2.2)), dtype=np.uint8)
    return eye.picture(dark, grey, list(lamps), list(panes), (0, 0)), dark


@pytest.mark.parametrize("name", ["clean", "rolling_shutter"])
def test_an_unsaturated_leds_centroid_is_its_projection_at_its_rows_time(name):
    near = {"led_light": (0.6, 0.6), "distance_m": (1.5, 1.5)}
    film = RenderedVideo(replace(SCENES[name], **near, **QUIET, **DARK), 3, HD, 1)
    (shot,) = film
    assert shot.visible.all()
    for place in shot.pixels:
        seen = centroid(shot.luma, place, 11, film.optics)
        np.testing.assert_allclose(seen, place, atol=0.02)


def test_a_streak_of_even_motion_is_centred_on_its_middle():
    eye = sensor(exposure_s=0.01, electrons=1e8)
    way = np.array([30.3, 31.8, 900.0, -400.0, 0.0, 0.0])
    luma, _ = drawn(eye, [Lamp(way, 2.0, 1.0)])
    np.testing.assert_allclose(centroid(luma, way[:2], 20), way[:2], atol=0.02)
    assert np.ptp(np.nonzero(luma > 60)[1]) > np.ptp(np.nonzero(luma > 60)[0]) + 3


HELD = ["rolling_shutter", "portrait", "landscape_secondary", "portrait_secondary"]


@pytest.mark.parametrize("name", HELD)
def test_pixels_are_the_exact_pose_of_the_lines_time(name):
    film = RenderedVideo(SCENES[name], 5, VGA, 4)
    for shot in film:
        delays = film.camera.delays(shot.pixels)
        for led, (place, delay) in enumerate(zip(shot.pixels, delays, strict=True)):
            R_cb, p_bc_in_c = film.moving.relative(shot.t + delay)
            exact = film.camera.pixels((p_bc_in_c + film.leds_in_b @ R_cb.T)[led : led + 1])
            np.testing.assert_allclose(place, exact[0], atol=2e-3)


@pytest.mark.parametrize("name", HELD)
def test_however_the_phone_is_held_light_is_where_the_pixels_say_and_gravity_is_down(name):
    near = {"led_light": (0.6, 0.6), "distance_m": (1.5, 1.5), "exposure_s": (1e-5, 1e-5)}
    scene = replace(SCENES[name], **near, **QUIET, **DARK)
    film = RenderedVideo(scene, 3, HD, 1, bound=True)
    (shot,) = film
    assert shot.luma.shape == (film.camera.height, film.camera.width)
    assert shot.visible.all()
    for place in shot.pixels:
        seen = centroid(shot.luma, place, 11, film.optics)
        np.testing.assert_allclose(seen, place, atol=0.05)
    assert np.mean([s.a_m_cf_in_c for s in shot.phone], axis=0)[2] == pytest.approx(9.8, abs=1.0)
    np.testing.assert_allclose(shot.information, shot.information.transpose(0, 2, 1))


def test_the_pose_is_the_middle_rows():
    film = RenderedVideo(SCENES["typical"], 2, VGA, 2)
    for k, shot in enumerate(film):
        R_cb, p_bc_in_c = film.moving.relative(START_S + k / 30.0)
        np.testing.assert_array_equal(shot.R_cb, R_cb)
        np.testing.assert_array_equal(shot.p_bc_in_c, p_bc_in_c)


def test_a_film_seen_again_is_the_same_and_another_seeds_is_another():
    film = RenderedVideo(SCENES["distractors"], 4, VGA, 3)
    again, other = list(film), list(RenderedVideo(SCENES["distractors"], 5, VGA, 3))
    for one, two, three in zip(film, again, other, strict=True):
        assert np.array_equal(one.luma, two.luma)
        assert one.phone[-1].t == two.phone[-1].t
        assert np.array_equal(one.phone[-1].omega_m_cf_in_c, two.phone[-1].omega_m_cf_in_c)
        assert not np.array_equal(one.luma, three.luma)


def test_seeds_vary_distance_light_and_lamps():
    films = [RenderedVideo(SCENES["distractors"], seed, VGA, 1) for seed in (1, 2, 1001)]
    distances = {round(float(next(iter(f)).p_bc_in_c[0]), 3) for f in films}
    assert len(distances) == 3
    assert len({f.optics for f in films}) == 3
    assert [is_reporting(f.seed) for f in films] == [False, False, True]


@pytest.mark.parametrize("name", SCENES)
def test_every_scene_can_be_filmed(name):
    (shot,) = shots(name, frames=1)
    is_upright = SCENES[name].quarters % 2 == 1
    assert shot.luma.shape == ((640, 480) if is_upright else (480, 640))
    assert shot.luma.dtype == np.uint8
    assert shot.solvable == (shot.solvable and SCENES[name].picture is ImageOrientation.UPRIGHT)


def test_the_family_has_enough_scenes_at_every_size():
    upright = [s for s in SCENES.values() if s.picture is ImageOrientation.UPRIGHT]
    assert len(upright) >= 16
    assert all(sum(size in s.sizes for s in upright) >= 16 for size in SIZES)
    assert at_reference(SCENES["far"]).distance_m == (2.5, 2.5)


def test_with_two_leds_covered_nothing_is_solvable_and_with_one_it_is():
    for shot in shots("two_covered"):
        assert shot.visible.sum() == 3
        assert not shot.solvable
    assert all(s.visible.sum() == 4 and s.solvable for s in shots("one_covered", lamps=(0, 0)))


def test_each_led_is_the_covered_one_for_some_seed():
    hidden = {int(np.argmin(shots("one_covered", seed, 1)[0].visible)) for seed in range(5)}
    assert hidden == set(range(5))


def test_who_leaves_comes_back():
    film = RenderedVideo(SCENES["leave_return"], 1, VGA, 90)
    out = [not s.solvable for s in film]
    assert not out[0]
    assert 10 < sum(out) < 70
    assert not all(out[out.index(True) :])


def test_a_bar_hides_leds_for_a_while():
    hidden = [5 - int(s.visible.sum()) for s in RenderedVideo(SCENES["bar"], 1, VGA, 90)]
    assert max(hidden) > 0
    assert min(hidden) == 0


@pytest.mark.parametrize("name", ["turned_90", "turned_180", "mirrored"])
def test_pictures_to_be_refused_are_never_solvable(name):
    assert not any(shot.solvable for shot in shots(name))


def test_a_mirrored_picture_has_its_leds_on_the_other_side():
    (plain,) = shots("mirrored", frames=1, picture=ImageOrientation.UPRIGHT)
    (mirrored,) = shots("mirrored", frames=1)
    np.testing.assert_array_equal(mirrored.luma, plain.luma[:, ::-1])
    np.testing.assert_allclose(mirrored.pixels[:, 0], 639 - plain.pixels[:, 0])


def test_a_turned_pictures_motion_sensors_disagree_by_the_turn():
    (plain,) = shots("turned_90", frames=1, picture=ImageOrientation.UPRIGHT)
    (turned,) = shots("turned_90", frames=1)
    a, b = (np.mean([s.a_m_cf_in_c for s in x.phone], axis=0) for x in (plain, turned))
    assert a[2] == pytest.approx(9.8, abs=0.5)
    assert abs(b[1]) == pytest.approx(9.8, abs=0.5)


@pytest.mark.parametrize("seed", [1, 7])
def test_gyroscopes_turn_as_the_poses_do(seed):
    film = RenderedVideo(SCENES["rolling_shutter"], seed, VGA, 10)
    samples = [s for shot in film for s in shot.phone if s.t > START_S]
    t, rates = [s.t for s in samples], np.array([s.omega_m_cf_in_c for s in samples])
    turned = log(film.moving.hand.pose(t[0])[0].T @ film.moving.hand.pose(t[-1])[0])
    felt = ((rates[1:] + rates[:-1]) / 2 * np.diff(t)[:, None]).sum(axis=0)
    np.testing.assert_allclose(felt, turned, atol=0.02)


def test_the_shaken_hand_turns_at_up_to_60_degrees_a_second():
    hand = movers(SCENES["rolling_shutter"], np.random.default_rng(0)).hand
    fastest = max(np.linalg.norm(hand.omega_in_c(START_S + 0.02 * k)) for k in range(300))
    assert 50.0 < np.rad2deg(fastest) < 85.0


def test_readings_come_in_order_and_only_once():
    film = RenderedVideo(SCENES["typical"], 1, VGA, 5)
    for stream in ("phone", "body"):
        times = [s.t for shot in film for s in getattr(shot, stream)]
        assert np.all(np.diff(times) > 0.0)


@pytest.mark.parametrize("radius_px", [0.3, 1.2, 4.0, 20.0])
def test_the_point_spread_keeps_all_light(radius_px):
    profile = profile_of(radius_px, 0.9)
    d = STEP_PX * np.arange(len(profile))
    flux = 2.0 * np.pi * float((profile * d).sum()) * STEP_PX
    assert flux == pytest.approx(np.pi * radius_px**2, rel=0.01)


def test_light_beyond_saturation_is_clipped_before_gamma():
    bright, _ = drawn(sensor(), [lamp_at(32.0, 32.0, 3.0, 20.0)])
    assert bright[32, 32] == 255
    wide, narrow = (
        (drawn(sensor(), [lamp_at(32.0, 32.0, 3.0, x)])[0] > 250).sum() for x in (20, 2)
    )
    assert wide > narrow


def test_noise_is_that_of_the_electrons():
    luma, _ = drawn(sensor(electrons=400.0), panes=[Pane((-9, 99), (-9, 99), 0.25, 1.0, False)])
    light = np.interp(luma, PLAIN.tone(FINE), FINE)
    assert light.mean() == pytest.approx(0.25, rel=0.02)
    assert light.std() == pytest.approx(np.sqrt(0.25 / 400.0), rel=0.1)


def test_the_bound_of_a_small_bright_spot_is_spread_over_root_electrons():
    eye = sensor(electrons=1e3)
    lamp = lamp_at(32.2, 31.7, 0.3, 6.0)  # 0.33 at its peak: nothing clips
    drawn(eye, [lamp], room=1e-6)
    known = place_information(eye, lamp)
    electrons = 1e3 * 6.0 * np.pi * 0.3**2
    np.testing.assert_allclose(known, electrons / 0.9**2 * np.eye(2), rtol=0.15, atol=20.0)


def test_the_bound_is_lower_where_more_clips():
    def known(light):
        eye, lamp = sensor(), lamp_at(32.0, 32.0, 2.0, light)
        drawn(eye, [lamp])
        return np.trace(place_information(eye, lamp)) / light

    assert known(0.5) > known(5.0) > known(50.0)


def test_a_lamp_beside_an_led_merges_only_in_one_saturated_area():
    from hardware.sim.scenes.crlb import is_merged

    def merges(apart_px, light):
        eye, led = sensor(), lamp_at(32.0, 32.0, 2.0, 3.0)
        other = lamp_at(32.0 + apart_px, 32.0, 3.0, light)
        _, room = drawn(eye, [led, other])
        return is_merged(eye, room, [led, other], [], led)

    assert merges(3.0, 5.0)
    assert not merges(20.0, 5.0)
    assert not merges(3.0, 0.2)


def test_an_opaque_bar_hides_what_is_behind_it():
    luma, _ = drawn(sensor(), [lamp_at(32.0, 32.0)], [Pane((25, 40), (-99, 99), 1e-4, 1.5, True)])
    assert luma[32, 32] < 20


def test_a_flat_rig_is_flat_and_leaving_is_a_motion():
    assert np.ptp(FLAT_LEDS[:, 0]) == 0.0
    assert SCENES["leave_return"].motion is HandMotion.LEAVING
    assert camera_of(HD, 0.01).readout_s == 0.01


def test_another_robot_shines_beside_ours_and_moves_by_itself():
    film = RenderedVideo(SCENES["twin"], 1, VGA, 2)
    (shot, _), moving = list(film), film.moving
    assert shot.visible.sum() == 5
    (R_fc, p_cf_in_f), (R_ft, p_tf_in_f) = moving.hand.pose(shot.t), moving.twin.pose(shot.t)
    at = film.camera.pixels((p_tf_in_f + film.leds_in_b @ R_ft.T - p_cf_in_f) @ R_fc)
    assert np.linalg.norm(at[:, None] - shot.pixels, axis=2).min() > 20.0
    for u, v in np.round(at).astype(int):
        assert shot.luma[v - 2 : v + 3, u - 2 : u + 3].max() > 150
    turns = [log(body.pose(3.0)[0].T @ body.pose(3.5)[0]) for body in (moving.robot, moving.twin)]
    assert np.linalg.norm(turns[0] - turns[1]) > 1e-3


def test_ours_goes_dark_and_the_other_one_shines_on():
    first, *_, last = shots("twin_left", frames=4, dark_after_s=0.05)
    assert first.solvable
    assert not last.solvable
    assert last.visible.sum() == 0
    assert last.luma.max() > 200
