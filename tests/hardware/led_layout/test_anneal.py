"""A better layout is better, within reach and the same for the same seed."""

import numpy as np
import pytest

from hardware.led_layout.anneal import AnnealingOptions, apart_px, improve
from hardware.led_layout.crlb import sigmas
from hardware.led_layout.file import load_layout
from hardware.led_layout.margins import margins
from hardware.led_layout.reach import Ball, Box, Segment
from hardware.led_layout.viewpoints import attitude, direction, looks_about, seen
from hardware.robot_file import RobotFileError, load_robot
from pipeline.camera.lens import Camera
from pipeline.identification.pnp import refine

LEDS = load_robot("quadrotor").robot.leds_in_b
LOOKS = looks_about((0.0, 0.35), (0.6, 0.35), 5, np.array([2.5]), 914.0)
FEW_LOOKS = looks_about((0.0, 0.35), (0.6, 0.35), 3, np.array([2.5]), 914.0)
SEARCH = AnnealingOptions(turns=2, starts=2, seed=1)
REACHES = [
    Ball(np.array([0.1, -0.2, 0.3]), 0.05),
    Box(np.array([-0.1, -0.2, 0.0]), np.array([0.1, 0.0, 0.3])),
    Segment(np.array([0.0, 0.0, 0.0]), np.array([0.3, 0.3, 0.1])),
]
HEAD = """[[leds]]
position_in_body_m = [0.0, 0.0, 0.0]
{}
[[leds]]
position_in_body_m = [0.0, 0.2, 0.0]
[[leds]]
position_in_body_m = [0.0, 0.0, 0.2]
[[leds]]
position_in_body_m = [0.2, 0.1, 0.1]
"""


def smallest(leds):
    wrong = margins(leds, LOOKS).wrong[:, 0]
    return min(wrong[:, 0, 1:].min(), wrong[:, 1, 0].min())


def scatter(leds, angles):
    """Standard deviation [m] of the depth of poses solved from noisy spots of 0.1 px."""
    rng, R, f = np.random.default_rng(0), attitude(direction(angles)), LOOKS.focal_px
    px, p = seen(leds, R, 2.5, f), np.array([2.5, 0.0, 0.0])
    camera = Camera(1280, 720, np.diag([f, f, 1.0]), "plumb_bob", np.zeros(5))
    weights = np.tile(100.0 * np.eye(2), (len(leds), 1, 1))
    noisy = [(px + rng.normal(0.0, 0.1, px.shape)) / f for _ in range(300)]
    return np.std([refine(camera, leds, px, weights, p, R).p_bc_in_c[0] for px in noisy])


@pytest.mark.slow
def test_a_search_finds_more_margin_within_reach():
    reaches = [Ball(led, 0.05) for led in LEDS]
    better = improve(LEDS, reaches, LOOKS, AnnealingOptions(turns=60, starts=2))
    assert smallest(better) > 1.2 * smallest(LEDS)
    assert np.linalg.norm(better - LEDS, axis=1).max() < 0.05 + 1e-9
    before, after = sigmas(LEDS, LOOKS, 0.1), sigmas(better, LOOKS, 0.1)
    for part in ("lateral", "depth", "rotation"):
        assert getattr(after, part).max() < 1.1 * getattr(before, part).max()
    for k in range(len(LOOKS.angles)):
        assert scatter(better, LOOKS.angles[k]) == pytest.approx(after.depth[k, 0], rel=0.15)


@pytest.mark.slow
def test_a_search_repeats_itself_and_tells_how_far_it_is():
    reaches = [Ball(led, 0.03) for led in LEDS]
    ticks = []
    better = improve(LEDS, reaches, FEW_LOOKS, SEARCH, ticks.extend)
    assert len(ticks) == SEARCH.turns * SEARCH.starts
    assert np.array_equal(better, improve(LEDS, reaches, FEW_LOOKS, SEARCH))
    assert not np.array_equal(better, LEDS)


@pytest.mark.slow
def test_leds_that_can_not_move_stay():
    reaches = [Segment(led, led) for led in LEDS]
    still = improve(LEDS, reaches, FEW_LOOKS, AnnealingOptions(turns=1, starts=1))
    assert still == pytest.approx(LEDS, abs=1e-12)


@pytest.mark.parametrize("reach", REACHES)
def test_a_reach_holds_what_it_gives(reach):
    rng = np.random.default_rng(0)
    for _ in range(50):
        place = reach.anywhere(rng)
        assert reach.nearest(place) == pytest.approx(place, abs=1e-12)
        near = reach.nearest(place + rng.normal(0.0, 0.5, 3))
        assert reach.nearest(near) == pytest.approx(near, abs=1e-12)
    assert reach.size > 0.0


def test_spots_are_nearest_where_their_arm_points_at_the_camera():
    looks = looks_about((0.0, 0.0), (0.01, 0.01), 5, np.array([2.0]), 1000.0)
    in_line = np.array([[0.0, 0, 0], [-0.3, 0, 0], [0, 0.2, 0], [0, 0, 0.2]])
    assert apart_px(in_line, looks) < 2.0 < 50.0 < apart_px(in_line[[0, 2, 3]], looks)


@pytest.mark.parametrize(
    ("line", "kind"),
    [
        ("reach_m = 0.05", Ball),
        ("reach_box_m = [[-0.1, -0.1, -0.1], [0.1, 0.1, 0.1]]", Box),
        ("reach_segment_m = [[-0.1, 0.0, 0.0], [0.1, 0.0, 0.0]]", Segment),
    ],
)
def test_a_file_says_how_far_leds_may_move(tmp_path, line, kind):
    (tmp_path / "r.toml").write_text(HEAD.format(line))
    layout = load_layout(str(tmp_path / "r.toml"))
    assert isinstance(layout.reaches[0], kind)
    assert layout.reaches[1:] == (None, None, None)


@pytest.mark.parametrize(
    ("line", "told"),
    [
        ("reach_m = 0.05\nreach_box_m = [[0.0, 0.0, 0.0], [1.0, 1.0, 1.0]]", "at most one"),
        ("reach_box_m = [[0.1, 0.1, 0.1], [0.2, 0.2, 0.2]]", "outside its own reach"),
        ("reach_m = -1.0", "greater than 0"),
    ],
)
def test_a_reach_that_can_not_be_is_refused(tmp_path, line, told):
    (tmp_path / "r.toml").write_text(HEAD.format(line))
    with pytest.raises(RobotFileError, match=told):
        load_layout(str(tmp_path / "r.toml"))
