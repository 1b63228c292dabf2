"""A camera's lies are named within 0.3 s, its honest pictures are left in peace."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from hardware.sim.world.world import LEDS_IN_B, World, WorldOptions
from pipeline.vision.camera_lies import BACK, SHIFTED
from pipeline.vision.picture_check import TRIAL_S, PictureCheck
from pipeline.vision.repeated_frames import STANDS
from tests.pipeline.faulty_camera import Faults, looks
from tests.pipeline.honest_camera import ADVERSITIES, USUAL, judged
from tests.pipeline.lying_camera import checked, lying, measured, seen_as

NAMED_S = 0.3
STEADIED_S = 2.6
ONSET_S = 2.5
UNTELLING_S = 0.75
"""In which too little moves, or too little is known of it, to show that a camera is right."""
MOVING = (0.03, float(np.deg2rad(1.0)))


@cache
def world(seed: int = 5, duration: float = 4.2, hand: tuple[float, float] = MOVING) -> World:
    return World(
        WorldOptions(
            seed=seed,
            duration=duration,
            hand_sigma=hand,
            time_offset=0.03,
            tremor_relaxation=0.15,
        )
    )


@pytest.mark.parametrize(
    ("lie", "words"),
    [
        ("zoom", "8 % larger"),
        ("lens", "smaller"),
        ("breathing", "% larger"),
        ("electronic", "does not move as the phone turns"),
        ("frozen", STANDS),
        ("late", "does not move as the phone turns"),
    ],
)
def test_a_lie_is_named_in_time_and_nothing_is_believed_from_then_on(lie, words) -> None:
    _, rows = checked(world(), lying(world(), lie, ONSET_S))
    named = next(t for t, *_, complaint in rows if complaint)
    said = next(complaint for *_, complaint in rows if complaint)
    assert ONSET_S < named < ONSET_S + NAMED_S
    assert words in said
    assert all(believed for t, believed, *_ in rows if t < ONSET_S)
    assert not any(believed for t, believed, *_ in rows if named <= t < named + TRIAL_S)


@pytest.mark.parametrize("lie", ["zoom", "electronic", "late", "frozen"])
def test_what_is_believed_before_is_not_far_off(lie) -> None:
    _, rows = checked(world(), lying(world(), lie, ONSET_S))
    believed = [error for t, believed, error, *_ in rows if t >= ONSET_S and believed]
    assert max(believed, default=0.0) < 0.015


def test_a_focus_that_breathes_is_doubted_before_it_is_named() -> None:
    _, rows = checked(world(), lying(world(), "breathing", ONSET_S))
    nees = [nees for t, believed, _, nees, _ in rows if t >= ONSET_S and believed]
    assert np.median(nees) < 20.0


@pytest.mark.parametrize("lie", ["optical", "electronic"])
def test_a_stabiliser_is_named_though_it_steadied_the_picture_from_the_beginning(lie) -> None:
    for seed in (6, 7):
        _, rows = checked(world(seed), lying(world(seed), lie, 0.0))
        named = next(t for t, *_, complaint in rows if complaint)
        assert named < STEADIED_S
        assert not any(believed for t, believed, *_ in rows if t >= named)


def test_who_is_named_says_so_with_each_picture_and_who_is_not_says_nothing() -> None:
    check, _ = checked(world(), lying(world(), "zoom", ONSET_S))
    *_, last = looks(world(), Faults())
    seen = check.believed(measured(replace(last, t=last.t + 0.01), None))
    assert (seen.lie, len(seen.rays)) == (check.complaint, 0)
    assert seen.lie
    honest, _ = checked(world(), looks(world(), Faults()))
    assert honest.believed(measured(replace(last, t=last.t + 0.01), None)).lie == ""


def test_a_busy_browser_is_no_stabiliser() -> None:
    pictures, refused, named = judged("a browser becomes busy", 30, 12.0)
    assert named == {}
    assert refused <= 0.02 * pictures


def test_a_scale_that_nobody_knows_is_no_reason_to_doubt() -> None:
    *_, last = looks(world(), Faults())

    def sigma_m(focal: float, sigma: float) -> float:
        check, _ = checked(world(), looks(world(), Faults()))
        check.measured(focal, sigma)
        pose = check.believed(measured(replace(last, t=last.t + 0.01), None)).pose
        assert pose is not None
        return float(np.sqrt(pose.covariance[0, 0]))

    assert sigma_m(0.06, 0.02) == sigma_m(0.0, 0.001)
    assert sigma_m(0.06, 0.01) > 0.1


def test_a_zoom_that_is_taken_back_is_forgiven_after_its_trial_and_no_other() -> None:
    long = world(duration=6.5)
    honest = looks(long, Faults())
    back = [1.08 if 2.5 <= one.t < 3.5 else 1.0 for one in honest]
    check, rows = checked(long, seen_as(honest, back))
    assert check.complaint == ""
    assert not any(believed for t, believed, *_ in rows if 2.5 <= t < 3.5 + TRIAL_S)
    assert all(believed for t, believed, *_ in rows if t > 3.5 + TRIAL_S + UNTELLING_S)
    said = {complaint for t, *_, complaint in rows if t > 3.5 + NAMED_S}
    assert said == {BACK, ""}, "nobody is told to take back what was taken back"
    check, rows = checked(long, lying(long, "zoom", 2.5))
    assert "8 % larger" in check.complaint
    check.measured(0.0, 0.001)
    assert not any(believed for t, believed, *_ in rows if t > 2.5)


def test_the_next_eyes_of_the_same_lens_know_of_its_zoom() -> None:
    zoomed, _ = checked(world(), lying(world(), "zoom", ONSET_S))
    long, eyes = world(duration=6.5), PictureCheck(LEDS_IN_B)
    eyes.go_on_from(zoomed)
    back = [1.08 if one.t < 2.5 else 1.0 for one in looks(long, Faults())]
    _, rows = checked(long, seen_as(looks(long, Faults()), back), check=eyes)
    assert {complaint for t, *_, complaint in rows if t < 2.5} == {zoomed.complaint}
    assert not any(believed for t, believed, *_ in rows if t < 2.5 + TRIAL_S)
    assert all(believed for t, believed, *_ in rows if t > 2.5 + 2.0 * TRIAL_S)


STILL = WorldOptions(duration=7.0, hand_sigma=(0.0, 0.0), tremor=0.0, robot_sigma=(0.0, 0.0))


@pytest.mark.parametrize("seed", [2, 3, 7])
def test_a_picture_that_stands_is_never_believed_again(seed: int) -> None:
    long = world(seed, 7.0)
    _, rows = checked(long, lying(long, "frozen", ONSET_S))
    named = next(t for t, *_, complaint in rows if complaint)
    assert not any(believed for t, believed, *_ in rows if t >= named)


def test_where_nothing_moves_time_acquits_nobody() -> None:
    unmoved = World(STILL)
    check, rows = checked(unmoved, lying(unmoved, "shifted", ONSET_S))
    assert check.complaint == SHIFTED
    assert not any(believed for t, believed, *_ in rows if t >= check.t_named)


def test_a_lens_that_was_switched_before_a_robot_at_rest_is_no_standing_picture() -> None:
    unmoved = World(STILL)
    check, _ = checked(unmoved, lying(unmoved, "lens", ONSET_S))
    assert "smaller" in check.complaint


def test_without_motion_samples_nothing_is_judged() -> None:
    check = PictureCheck(LEDS_IN_B)
    for look in lying(world(), "zoom", ONSET_S):
        assert check.judge(measured(look, None)).is_believed
    assert check.complaint == ""


@pytest.mark.slow
@pytest.mark.parametrize("adversity", list(ADVERSITIES))
def test_whatever_happens_to_a_phone_is_no_lie_of_its_camera(adversity: str) -> None:
    pictures, refused, named = judged(adversity, 30, 15.0)
    assert named == {}
    assert refused <= ADVERSITIES[adversity].refused * pictures


@pytest.mark.parametrize("hand", [MOVING, (0.05, float(np.deg2rad(3.0)))])
def test_an_honest_camera_with_usual_errors_is_left_in_peace(hand) -> None:
    long = world(1000, 20.0, hand)
    _, rows = checked(long, looks(long, USUAL), gyro=USUAL.gyro)
    assert not any(complaint for *_, complaint in rows)
    assert sum(not believed for _, believed, *_ in rows) <= 1
    exact = world(1001, 6.0, hand)
    _, rows = checked(exact, looks(exact, Faults()))
    assert 0.5 < np.mean([nees for *_, nees, _ in rows]) < 1.3
