from dataclasses import replace

import numpy as np
import pytest

from pipeline.identification.initialisation_kernels import FIT_COST
from pipeline.identification.relocalisation import (
    ALL,
    FEWER,
    LOOSE,
    TIGHT,
    Relocalisation,
    SearchHints,
)
from tests.pipeline.seeing import CAMERA, LEDS_IN_B, Truth, is_wrong, truth_at
from tests.pipeline.spotting import (
    CONFIG,
    NOISE_PX,
    best,
    explains_truly,
    hints_of,
    lamps_beside,
    seen,
    spots_of,
)

GRAVITY = pytest.mark.parametrize("gravity", [True, False], ids=["gravity", "no gravity"])
OVERDRAFT = 12 * FIT_COST * 60
"""A hypothesis that was begun is finished."""


def test_gravity_finds_the_robot_among_two_dozen_lamps():
    rng = np.random.default_rng(30)
    for _ in range(40):
        truth = truth_at(rng, rng.uniform(1.2, 5.0))
        spots = seen(truth, rng, lamps=24)
        one = best(spots, hints_of(truth))
        assert explains_truly(one, truth, spots)
        assert one.leds == 5


@pytest.mark.parametrize("covered", range(5))
def test_gravity_finds_any_four_of_five(covered):
    rng = np.random.default_rng(31 + covered)
    leds = [led for led in range(5) if led != covered]
    for _ in range(12):
        truth = truth_at(rng)
        spots = seen(truth, rng, leds, lamps=6)
        one = best(spots, hints_of(truth))
        assert explains_truly(one, truth, spots)
        assert covered not in one.match.led


def test_gravity_may_be_six_degrees_off():
    rng = np.random.default_rng(32)
    found = 0
    for _ in range(25):
        truth = truth_at(rng)
        spots = seen(truth, rng, lamps=3)
        direction = rng.normal(0.0, 1.0, 3)
        tilt = np.deg2rad(6.0) * direction / np.linalg.norm(direction)
        one = best(spots, hints_of(truth, tilt))
        assert one is None or explains_truly(one, truth, spots)
        found += one is not None
    assert found >= 23


@GRAVITY
@pytest.mark.parametrize("leds", [(), (1, 3), (0, 2, 4)])
def test_lamps_and_too_few_leds_are_no_robot(leds, gravity):
    rng = np.random.default_rng(33)
    for lamps in (2, 6, 12, 25):
        for _ in range(8):
            truth = truth_at(rng)
            one = best(seen(truth, rng, leds, lamps), hints_of(truth, gravity=gravity))
            assert one is None or not is_wrong(one, truth)


@GRAVITY
def test_a_mirrored_constellation_is_none(gravity):
    rng = np.random.default_rng(34)
    for _ in range(25):
        truth = truth_at(rng)
        spots = seen(truth, rng, lamps=4)
        mirrored = replace(spots, pixels=spots.pixels * (-1.0, 1.0) + (CAMERA.width - 1.0, 0.0))
        assert best(mirrored, hints_of(truth, gravity=gravity)) is None


@pytest.mark.parametrize("axes", [(-1.0, -1.0), (1.0, -1.0)], ids=["half a turn", "upside down"])
def test_a_turned_constellation_is_none_where_gravity_is_known(axes):
    rng = np.random.default_rng(35)
    middle = 0.5 * np.array([CAMERA.width - 1.0, CAMERA.height - 1.0])
    for _ in range(25):
        truth = truth_at(rng)
        spots = seen(truth, rng, lamps=4)
        turned = replace(spots, pixels=middle + (spots.pixels - middle) * axes)
        assert best(turned, hints_of(truth)) is None


def test_of_two_robots_each_is_explained_and_neither_is_the_others_rival():
    rng = np.random.default_rng(36)
    for _ in range(5):
        truth = truth_at(rng)
        other = Truth(truth.p + np.array([0.4, 1.1, 0.1]), truth.R, truth.R_fc)
        pixels = np.vstack((truth.pixels(), other.pixels()))
        spots = spots_of(pixels + rng.normal(0.0, NOISE_PX, pixels.shape))
        one = best(spots, hints_of(truth))
        assert not is_wrong(one, truth) or not is_wrong(one, other)


def test_a_lamp_beside_an_led_is_not_taken_for_it():
    """Two lights that merge: fits to a pixel, turned by ten degrees, were it not left out."""
    rng = np.random.default_rng(37)
    for _ in range(20):
        truth = truth_at(rng)
        pixels = truth.pixels()
        angle = rng.uniform(0.0, 2.0 * np.pi)
        pixels[rng.integers(5)] += 15.0 * np.array([np.cos(angle), np.sin(angle)])
        one = best(spots_of(pixels), hints_of(truth))
        assert one is None or not is_wrong(one, truth)


def test_without_gravity_all_leds_are_enough():
    rng = np.random.default_rng(38)
    for lamps in (0, 1, 8):
        truth = truth_at(rng)
        spots = seen(truth, rng, lamps=lamps)
        assert explains_truly(best(spots, SearchHints()), truth, spots)


def test_work_left_undone_goes_on_in_the_next_picture():
    """Too many lamps for one picture if nothing is known; a few pictures find the robot."""
    rng = np.random.default_rng(39)
    for _ in range(3):
        truth, search, first = truth_at(rng), Relocalisation(CAMERA, LEDS_IN_B, CONFIG), None
        spots, bounded = seen(truth, rng, lamps=25), 0
        for picture in range(8):
            one = best(spots, SearchHints(), search)
            bounded += search.bounded
            first = picture if first is None and one is not None else first
            assert one is None or explains_truly(one, truth, spots)
        assert first is not None
        assert bounded > 0


@GRAVITY
def test_the_order_of_the_spots_changes_nothing(gravity):
    rng = np.random.default_rng(40)
    for _ in range(6):
        truth = truth_at(rng)
        spots = seen(truth, rng, lamps=5)
        one = best(spots, hints_of(truth, gravity=gravity))
        order = rng.permutation(len(spots))
        shuffled = spots_of(spots.pixels[order])
        other = best(shuffled, hints_of(truth, gravity=gravity))
        assert dict(zip(one.match.led, one.match.spot, strict=True)) == {
            led: order[spot] for led, spot in zip(other.match.led, other.match.spot, strict=True)
        }
        np.testing.assert_allclose(one.p_bc_in_c, other.p_bc_in_c, atol=1e-6)


@GRAVITY
def test_more_lamps_never_make_a_wrong_pose(gravity):
    rng = np.random.default_rng(41)
    for _ in range(6):
        truth = truth_at(rng)
        pixels = truth.pixels() + rng.normal(0.0, NOISE_PX, (5, 2))
        lamps = lamps_beside(truth.pixels(), 40, rng)
        for k in (0, 1, 3, 8, 20, 40):
            spots = spots_of(np.vstack((pixels, lamps[:k])))
            one = best(spots, hints_of(truth, gravity=gravity))
            assert one is None or explains_truly(one, truth, spots)


@GRAVITY
def test_two_hundred_lights_are_bounded_work(gravity):
    rng = np.random.default_rng(42)
    truth, search = truth_at(rng), Relocalisation(CAMERA, LEDS_IN_B, CONFIG)
    spots = seen(truth, rng, lamps=195)
    for _ in range(3):
        one = best(spots, hints_of(truth, gravity=gravity), search)
        assert one is None or explains_truly(one, truth, spots)
        assert search.bounded
        assert search.looked < (TIGHT + LOOSE if gravity else ALL + FEWER) + OVERDRAFT


@GRAVITY
def test_a_remembered_attitude_makes_four_leds_surer(gravity):
    rng = np.random.default_rng(43)
    for _ in range(6):
        truth = truth_at(rng)
        spots = seen(truth, rng, leds=(0, 1, 2, 4), lamps=5)
        blind = hints_of(truth, gravity=gravity)
        known = replace(blind, R_cb=truth.R, turn=0.25)
        search = Relocalisation(CAMERA, LEDS_IN_B, CONFIG)
        sure, unsure = (search.explanations(spots, hints)[0] for hints in (known, blind))
        assert explains_truly(sure, truth, spots)
        assert sure.log_false_alarms < unsure.log_false_alarms - 2.0


def test_an_attitude_that_is_remembered_wrong_is_not_confirmed():
    rng = np.random.default_rng(44)
    truth = truth_at(rng)
    hints = replace(hints_of(truth), R_cb=truth.R.T, turn=0.25)
    assert best(seen(truth, rng), hints) is None


def test_spots_of_very_different_sizes_are_no_robot():
    rng = np.random.default_rng(45)
    truth = truth_at(rng)
    assert best(spots_of(truth.pixels()), hints_of(truth)) is not None
    areas = [20.0, 20.0, 500.0, 20.0, 500.0]
    assert best(spots_of(truth.pixels(), areas), hints_of(truth)) is None


def test_nothing_seen_is_nothing_found():
    search = Relocalisation(CAMERA, LEDS_IN_B, CONFIG)
    assert search.explanations(spots_of(np.zeros((0, 2))), SearchHints()) == []
    assert search.explanations(spots_of(np.full((9, 2), 300.0)), SearchHints()) == []
