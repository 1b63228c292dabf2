"""What the person with the phone is told while filming."""

from __future__ import annotations

from dataclasses import replace

import pytest

from server.calibration.guide import PATIENCE_S, Guide
from tests.server.calibration.filming import BOARD, Motion, Phone, corner_film

SIZE = Phone().size


def shown(views):
    guide = Guide(BOARD, SIZE)
    for view in views:
        guide.add(view.t, view)
    return guide


def film(seconds=12.0, fps=15.0, **motion):
    return corner_film(Phone(), Motion(**motion), seconds, fps)


def test_a_good_film_is_soon_enough_and_never_loses_what_it_has():
    guide, last = Guide(BOARD, SIZE), 0.0
    for view in film(seed=1):
        guide.add(view.t, view)
        assert guide.progress.share >= last - 1e-9
        last = guide.progress.share
    assert guide.enough


def test_without_a_board_the_hint_is_to_point_at_it():
    guide = shown(film(1.0))
    assert len(guide.outline()) == 8
    t = guide.last.t
    for k in range(30):
        guide.add(t + k / 15.0, None)
    assert "Point the camera at the board" in guide.hint
    assert guide.outline() == []


def test_blur_is_told_before_all_else():
    views = film(2.0)
    blurred = [replace(view, blur_px=12.0) for view in views]
    assert "Blurred" in shown(views + blurred).hint
    assert shown(blurred).progress.covered == 0.0


@pytest.mark.parametrize(
    ("motion", "words"),
    [
        ({"tilt": 0.05}, "Look at the board from"),
        ({"reach": 0.1, "distance_m": (0.6, 0.62)}, "Turn the phone until the board is"),
        ({"speed": 0.15, "tremor": 0.0, "seed": 3}, "to and fro"),
    ],
)
def test_what_lacks_is_asked_for(motion, words):
    guide = shown(film(40.0, 5.0, **motion))
    assert words in guide.hint
    assert guide.progress.share < 1.0
    assert not guide.enough


def test_nobody_must_turn_faster_for_ever():
    views = film(40.0, 5.0, speed=0.15, tremor=0.0, seed=3)
    late = [replace(view, t=view.t + PATIENCE_S) for view in views]
    assert shown(views + late).enough


def test_every_side_can_be_asked_for():
    guide = shown(film(6.0, 5.0, tilt=0.05))
    asked = set()
    for side in range(4):
        guide._tilted = [9, 9, 9, 9]
        guide._tilted[side] = 0
        asked.add(guide.hint)
    assert len(asked) == 4
