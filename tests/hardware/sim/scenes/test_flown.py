"""What a virtual phone sees of a scene in flight: LEDs where they are, and what is around them."""

from dataclasses import replace

import numpy as np
import pytest

from hardware.camera_file import find_camera
from hardware.plant_parameters import StartParameters
from hardware.robot_file import load_robot
from hardware.sim.hand import make_hand
from hardware.sim.phone import VirtualPhone
from hardware.sim.render import RenderOptions
from hardware.sim.scenes.flown import FLOWN, FlownScene, seen_from
from hardware.sim.scenes.scene import SCENES
from pipeline.frames import R_from_rpy

AMES = load_robot("ames")
SIZE = (640, 480)
CAMERA = find_camera("lightleash-virtual-phone", *SIZE)


def still(_):
    return R_from_rpy(np.zeros(3)), np.zeros(3)


def phone_in(scene, seed=0, robot_file=AMES, hidden=lambda _: ()):
    camera, start = seen_from(scene, seed, CAMERA, robot_file.start)
    leds, rng = robot_file.robot.leds_in_b, np.random.default_rng(5)
    hand = make_hand("still", start=start)
    phone = VirtualPhone(camera, hand, leds, RenderOptions(), rng, hidden=hidden)
    phone.films = FlownScene(scene, seed, robot_file, phone).film
    return phone


def brightest(phone, luma, led, reach=3):
    """Grey level near where an LED is."""
    R_cb, p_bc_in_c = phone.relative_pose(0.1, still)
    u, v = phone.camera.pixels((p_bc_in_c + R_cb @ phone.leds_in_b[led])[None])[0]
    u, v = round(u), round(v)
    return int(luma[v - reach : v + reach + 1, u - reach : u + reach + 1].max())


@pytest.mark.parametrize("name", FLOWN)
def test_leds_shine_where_they_are(name):
    seen = []
    for seed in range(3):
        phone = phone_in(FLOWN[name], seed)
        luma = phone.picture(0.1, still)
        assert luma.shape == SIZE[::-1]
        seen += [brightest(phone, luma, led) for led in range(5)]
    lit = np.sort(seen)
    hidden = 3 * FLOWN[name].covered + (5 if name == "bar" else 0)
    assert lit[hidden] > (50 if name in ("dim", "low_light", "defocus", "far") else 150)
    assert lit[:3].max() < 120 or FLOWN[name].covered == 0


def test_an_led_that_is_kept_dark_does_not_shine():
    phone = phone_in(FLOWN["clean"], hidden=lambda t: (2,) if t > 0.5 else ())
    assert brightest(phone, phone.picture(0.1, still), 2) > 150
    assert brightest(phone, phone.picture(0.6, still), 2) < 120


def test_a_seed_is_one_room_and_one_body():
    one, again, other = (phone_in(FLOWN["typical"], seed).picture(0.1, still) for seed in (3, 3, 4))
    np.testing.assert_array_equal(one, again)
    assert (one != other).mean() > 0.3
    bare = phone_in(replace(FLOWN["typical"], has_body=False), 3).picture(0.1, still)
    assert 200 < (one != bare).sum() < 0.3 * one.size


def test_the_room_stands_still_while_the_phone_turns():
    phone = phone_in(FLOWN["clutter"], 1)
    first = phone.picture(0.1, still).astype(float)
    R_fc, p_cf_in_f = phone.hand.pose(0.0)
    phone.hand.pose = lambda _: (R_fc @ R_from_rpy(np.array([0.0, 0.0, 0.05])), p_cf_in_f)
    turned = phone.picture(0.2, still).astype(float)
    shift = round(0.05 * phone.camera.focal_px)
    same = np.corrcoef(first[:, :-shift].ravel(), turned[:, shift:].ravel())[0, 1]
    assert same > 0.9 > np.corrcoef(first.ravel(), turned.ravel())[0, 1]


def test_distance_and_readout_are_the_scene_s():
    camera, usual = CAMERA, StartParameters(2.0, 0.3, 0.0)
    for name in ("near_bloom", "far", "rolling_shutter"):
        seen = [seen_from(FLOWN[name], seed, camera, usual) for seed in range(20)]
        low, high = SCENES[name].distance_m
        assert {0.8 * low <= start.distance <= 0.8 * high for _, start in seen} == {True}
        low, high = SCENES[name].readout_s
        assert {low <= one.readout_s <= high for one, _ in seen} == {True}
        assert {start.above for _, start in seen} == {0.3}


def test_a_robot_without_thrusters_has_a_hub_and_arms():
    base = load_robot("ground")
    phone = phone_in(FLOWN["typical"], robot_file=base)
    bare = phone_in(replace(FLOWN["typical"], has_body=False), robot_file=base)
    assert (phone.picture(0.1, still) != bare.picture(0.1, still)).sum() > 100
