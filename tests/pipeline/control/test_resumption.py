"""After a gap: back to where it was led, slowly, and not from far away."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from pipeline.config import ResumptionConfig
from pipeline.control.pid import Reference
from pipeline.control.resumption import is_near, is_settled, toward
from pipeline.frames import exp, log
from tests.pipeline.control.relative import relative_at

CONFIG = ResumptionConfig()
PLACE = np.array([2.5, 0.0, 0.0])
LED_TO = Reference(PLACE, np.eye(3))
AWAY = Reference(PLACE + np.array([0.05, -0.08, 0.1]), exp(np.array([0.1, 0.0, 0.2])))


@pytest.mark.parametrize("h", [0.005, 0.02, 0.06])
def test_no_step_is_faster_than_allowed_and_all_of_it_arrives(h: float) -> None:
    reference = AWAY
    for _ in range(round(3.0 / h)):
        before, reference = reference, toward(CONFIG, reference, LED_TO, h)
        step = np.linalg.norm(reference.p_rv_in_v - before.p_rv_in_v)
        turn = np.linalg.norm(log(before.R_vr.T @ reference.R_vr))
        assert step <= CONFIG.max_speed_m_s * h * (1.0 + 1e-9)
        assert turn <= CONFIG.max_rate_rad_s * h * (1.0 + 1e-9)
    np.testing.assert_allclose(reference.p_rv_in_v, PLACE, atol=1e-4)
    np.testing.assert_allclose(reference.R_vr, np.eye(3), atol=1e-4)


def test_from_where_it_is_led_to_it_does_not_move() -> None:
    still = toward(CONFIG, LED_TO, LED_TO, 0.005)
    np.testing.assert_array_equal(still.p_rv_in_v, PLACE)


def test_it_goes_straight() -> None:
    way = toward(CONFIG, AWAY, LED_TO, 0.02).p_rv_in_v - AWAY.p_rv_in_v
    wanted = LED_TO.p_rv_in_v - AWAY.p_rv_in_v
    assert float(way @ wanted) == pytest.approx(np.linalg.norm(way) * np.linalg.norm(wanted))


@pytest.mark.parametrize(("factor", "near"), [(0.99, True), (1.01, False)])
def test_too_far_or_turned_too_far_it_is_not_near(factor: float, near: bool) -> None:
    aside = np.array([0.0, factor * CONFIG.max_offset_m, 0.0])
    turn = exp(np.array([0.0, 0.0, factor * CONFIG.max_offset_rad]))
    here = relative_at(PLACE, np.eye(3))
    assert is_near(CONFIG, LED_TO, replace(here, p_bc_in_c=PLACE + aside)) == near
    assert is_near(CONFIG, LED_TO, replace(here, R_cb=turn)) == near


@pytest.mark.parametrize(
    ("sigma_p", "picture_s", "settled"),
    [(0.002, 0.5, True), (0.02, 0.5, False), (0.02, 0.2, True)],
    ids=["sure", "unsure", "seen since"],
)
def test_settled_is_what_is_sure_or_was_seen_since(
    sigma_p: float, picture_s: float, settled: bool
) -> None:
    assert is_settled(CONFIG, sigma_p, picture_s, gap_s=0.3) == settled


def test_what_may_be_mended_at_once_is_no_more_than_a_release_moves_from_picture_to_picture() -> (
    None
):
    assert CONFIG.settled_m <= CONFIG.max_speed_m_s / 30.0
