"""Offset watch: a learnt time offset is believed only where nothing speaks against it."""

from __future__ import annotations

import pytest

from pipeline.signals import StampOffset
from pipeline.timing.offset_watch import (
    DRIFTING,
    STRAY_S,
    SURER,
    UNKNOWN,
    UNSURE,
    OffsetMonitor,
)


@pytest.mark.parametrize(
    ("value", "sigma", "complaint"),
    [
        (0.9 * STRAY_S, 1e-3, ""),
        (1.5 * STRAY_S, 1e-3, UNKNOWN),
        (-1.5 * STRAY_S, 1e-3, UNKNOWN),
        (1.5 * STRAY_S, STRAY_S, ""),  # not learnt yet: noise
        (1.1 * UNSURE * STRAY_S, STRAY_S, UNKNOWN),
    ],
)
def test_without_a_coarse_one_it_must_be_near_none_as_far_as_it_is_sure(
    value: float, sigma: float, complaint: str
) -> None:
    watch = OffsetMonitor()
    assert not watch.must_begin_again(value, sigma, 1.0)
    assert watch.complaint == complaint


def test_one_that_the_coarse_one_refutes_begins_again_and_soon_after_complains() -> None:
    watch = OffsetMonitor()
    watch.coarse = StampOffset(0.08, 0.002)
    assert not watch.must_begin_again(0.073, 1e-3, 1.0)
    watch.coarse = StampOffset(0.08, 0.002, since=1.1)
    assert watch.must_begin_again(0.0, 1.0, 2.0)  # however unsure of itself it is
    assert watch.complaint == ""
    assert watch.must_begin_again(0.0, 1e-3, 3.0)
    assert watch.complaint == DRIFTING
    assert not watch.must_begin_again(0.08, 1e-3, 4.0)
    assert watch.complaint == ""


@pytest.mark.parametrize(("value", "begins"), [(-0.0135, True), (-0.007, False), (0.01, False)])
def test_what_a_phone_at_rest_was_wrongly_sure_of_is_not_kept(value: float, begins: bool) -> None:
    """As found: learnt while hardly anything moved, and sure of to 0.3 ms."""
    watch = OffsetMonitor()
    watch.coarse = StampOffset(0.0012, 0.0023)
    assert watch.must_begin_again(value, 3e-4, 4.0) is begins


def test_a_coarse_one_by_older_pictures_says_nothing_of_dates_that_have_changed() -> None:
    watch = OffsetMonitor()
    for since in (0.0, 4.9):
        watch.coarse = StampOffset(0.03, 0.002, since)
        assert not watch.must_begin_again(0.03, 1e-4, 4.9)
        assert not watch.must_begin_again(0.015, 1e-4, 5.0)
        assert watch.complaint == ""
    watch.coarse = StampOffset(0.03, 0.002, since=5.0)
    assert watch.must_begin_again(0.015, 1e-4, 10.0)


def test_one_that_knows_nothing_yet_has_agreed_with_nobody() -> None:
    watch = OffsetMonitor()
    watch.coarse = StampOffset(0.005, 0.002)
    assert not watch.must_begin_again(0.0, 0.02, 1.0)
    assert watch.must_begin_again(0.02, 1e-3, 2.0)


@pytest.mark.parametrize(
    ("value", "sigma", "is_taken"),
    [
        (0.01, 0.02, True),
        (0.01 + 0.99 * UNSURE * 0.02, 0.02, True),
        (0.01 + 1.01 * UNSURE * 0.02, 0.02, False),  # that far off it is not: begin again
        (0.01, 0.99 * SURER * 0.001, False),
        (0.01, 1.01 * SURER * 0.001, True),
    ],
)
def test_a_coarse_one_is_taken_by_who_is_much_less_sure_and_may_be_as_far_off(
    value: float, sigma: float, is_taken: bool
) -> None:
    watch = OffsetMonitor()
    assert watch.surer(value, sigma) is None
    watch.coarse = StampOffset(0.01, 0.001)
    assert (watch.surer(value, sigma) is watch.coarse) is is_taken


def test_a_coarse_one_by_older_pictures_is_not_taken_after_they_agreed() -> None:
    watch = OffsetMonitor()
    watch.coarse = StampOffset(0.01, 0.001, since=1.0)
    assert not watch.must_begin_again(0.01, 1e-3, 2.0)
    assert watch.surer(0.01, 0.02) is None  # its dates are doubted by something
    watch.coarse = StampOffset(0.01, 0.001, since=2.1)
    assert watch.surer(0.01, 0.02) is watch.coarse
