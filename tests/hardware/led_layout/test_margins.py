"""Margins of wrong namings against brute force, and what bad layouts are told."""

from itertools import permutations

import numpy as np
import pytest
from scipy.optimize import least_squares

from hardware.led_layout.crlb import one_hidden, sigmas
from hardware.led_layout.margins import check, margins, namings, thickness, worst, wrong
from hardware.led_layout.viewpoints import (
    LedLayoutError,
    Viewpoints,
    attitude,
    direction,
    looks_about,
    seen,
)
from hardware.robot_file import load_robot
from pipeline.frames import exp

F, Z = 914.0, 2.5
AMES = load_robot("ames").robot.leds_in_b
FOUR = AMES[:4]
BEHIND = (0.0, 0.0)
SPREAD = (np.radians(35.0), np.radians(20.0))
TILT = np.radians(10.0)


def few(count=4, distances=(Z,)):
    return looks_about(BEHIND, SPREAD, count, np.array(distances), F)


def missed(px, leds, R, p):
    q = p + leds @ R.T
    return (px + F * q[:, 1:] / np.maximum(q[:, :1], 0.05)).ravel()


def brute_free(px, leds, R, rng, starts=8):
    best = np.inf
    for _ in range(starts):
        turn = rng.normal(size=3)
        turn *= rng.uniform(0.0, np.pi) / np.linalg.norm(turn)
        start = np.concatenate(([rng.uniform(1.5, 4.0), 0.0, 0.0], turn))
        fit = least_squares(
            lambda a: missed(px, leds, R @ exp(a[3:]), a[:3]), start, method="lm", max_nfev=120
        )
        best = min(best, np.sqrt(2.0 * fit.cost / len(px)))
    return best


def brute_tilted(px, leds, R, rng, starts=8):
    def turned(a):
        tilt = a[3] * np.array([np.cos(a[4]), np.sin(a[4]), 0.0])
        return R @ exp(tilt) @ exp(np.array([0.0, 0.0, a[5]]))

    best, wide = np.inf, 20.0
    low, high = [0.3, -9, -9, 0.0, -wide, -wide], [30.0, 9, 9, TILT, wide, wide]
    for _ in range(starts):
        turns = [rng.uniform(0.0, TILT), *rng.uniform(-3.0, 3.0, 2)]
        start = np.concatenate(([rng.uniform(1.5, 4.0), 0.0, 0.0], turns))
        fit = least_squares(
            lambda a: missed(px, leds, turned(a), a[:3]), start, bounds=(low, high), max_nfev=40
        )
        best = min(best, np.sqrt(2.0 * fit.cost / len(px)))
    return best


def test_the_smallest_margin_is_that_of_brute_force():
    rng, looks = np.random.default_rng(3), few()
    view = looks.angles[2]
    R = attitude(direction(view))
    px = seen(FOUR, R, Z, F)
    every = [brute_free(px, FOUR[list(n)], R, rng) for n in list(permutations(range(4)))[1:]]
    least, which = wrong(FOUR, looks, view, Z, 4, 0)
    assert least == pytest.approx(min(every), rel=1e-3)
    assert which == int(np.argmin(every))


def test_with_gravity_known_it_is_that_of_bounded_brute_force():
    rng, looks = np.random.default_rng(4), few()
    view = looks.angles[1]
    R = attitude(direction(view))
    px = seen(AMES, R, Z, F)
    least, which = wrong(AMES, looks, view, Z, 4, 1)
    spots, names = (table[which] for table in namings(5, 4))
    assert least == pytest.approx(brute_tilted(px[spots], AMES[names], R, rng), rel=0.02)


def test_giving_up_hopeless_fits_loses_nothing():
    from hardware.led_layout.fit_kernels import FREE
    from hardware.led_layout.margin_kernels import smallest_wrong

    looks = few()
    for view in looks.angles[:2]:
        R = attitude(direction(view))
        px = seen(AMES, R, Z, F)
        spots, names = namings(5, 4)
        each = [
            smallest_wrong(
                AMES, px, F, R, FREE, 0.0, spots[k : k + 1].copy(), names[k : k + 1].copy(), 1e3
            )[0]
            for k in range(len(spots))
        ]
        assert wrong(AMES, looks, view, Z, 4, 0)[0] == pytest.approx(min(each), rel=1e-3)


def test_more_knowledge_never_makes_a_margin_smaller():
    found = margins(AMES, few())
    assert (found.wrong[..., 1:] >= found.wrong[..., :1] - 1e-6).all()


def test_there_are_as_many_wrong_namings_as_there_should_be():
    assert len(namings(5, 4)[0]) == 5 * 120 - 5
    assert len(namings(5, 5)[0]) == 119


def test_the_worst_view_is_no_better_than_any_view_asked():
    looks = few(6)
    found = margins(AMES, looks)
    least = worst(AMES, looks, found, 0, 0, 1)
    assert least.margin_px <= found.wrong[:, 0, 0, 1].min() + 1e-6
    again, _ = wrong(AMES, looks, least.angles, Z, 4, 1)
    assert again == pytest.approx(least.margin_px, rel=1e-6)
    assert least.naming


def test_a_symmetric_layout_has_no_margin():
    square = 0.2 * np.array([[0.0, 1, 1], [0.0, -1, 1], [0.0, -1, -1], [0.0, 1, -1], [-0.5, 0, 0]])
    found = margins(square, few())
    assert found.wrong[:, 0, 1, 0].max() < 1e-3  # turned by 90° it is itself


def test_a_flat_layout_has_a_second_pose_and_is_thin():
    flat = AMES * np.array([0.0, 1.0, 1.0])
    assert thickness(flat)[0] < 1e-12 < 0.05 < thickness(AMES)[0]
    aside = Viewpoints(np.array([[0.4, 0.1]]), np.array([6.0]), F)
    assert margins(flat, aside).other[0, 0, 1] < 1.0
    assert margins(AMES, aside).other[0, 0, 1] > 3.0


def test_sigmas_are_the_scatter_of_poses():
    from pipeline.camera.lens import Camera
    from pipeline.identification.pnp import refine

    looks, rng = few(1), np.random.default_rng(0)
    R = attitude(looks.directions_in_b[0])
    px, p = seen(AMES, R, Z, F), np.array([Z, 0.0, 0.0])
    camera = Camera(1280, 720, np.diag([F, F, 1.0]), "plumb_bob", np.zeros(5))
    weights = np.tile(100.0 * np.eye(2), (5, 1, 1))
    fits = [
        refine(camera, AMES, (px + rng.normal(0.0, 0.1, px.shape)) / F, weights, p, R)
        for _ in range(300)
    ]
    depth = np.std([fit.p_bc_in_c[0] for fit in fits])
    bound = sigmas(AMES, looks, 0.1)
    assert depth == pytest.approx(bound.depth[0, 0], rel=0.15)
    assert (one_hidden(AMES, looks, 0.1).depth >= bound.depth).all()


def test_depth_uncertainty_grows_with_the_square_of_distance():
    bound = sigmas(AMES, few(3, (2.5, 5.0)), 0.1)
    assert bound.depth[:, 1] / bound.depth[:, 0] == pytest.approx(4.0, rel=0.15)


def test_what_can_not_be_judged_is_refused():
    with pytest.raises(LedLayoutError, match="from 4 to 8"):
        check(AMES[:3])
    with pytest.raises(LedLayoutError, match="LEDs 1 and 3 are in one place"):
        check(AMES[[0, 1, 0, 2]])
    with pytest.raises(LedLayoutError, match="behind the camera"):
        margins(AMES, few(1, (0.2,)))
