"""Meter: rate, age and losses of a stream."""

from __future__ import annotations

import pytest

from server.diagnostics.meter import WINDOW_S, Meter


def test_a_meter_tells_rate_and_age_and_knows_nothing_before_the_first() -> None:
    meter = Meter()
    assert meter.stream(5.0).age_ms is None
    assert meter.age(5.0) == float("inf")
    for k in range(400):
        meter.tick(0.01 * k, 0.01 * k - 0.05)
    stream = meter.stream(4.0)
    assert stream.rate_hz == pytest.approx(100.0, rel=0.02)
    assert stream.age_ms == pytest.approx(60.0, abs=0.2)
    assert meter.stream(4.0 + 2.0 * WINDOW_S).rate_hz == 0.0


def test_an_old_item_makes_a_stream_no_younger() -> None:
    meter = Meter()
    meter.tick(10.0, 9.9)
    meter.tick(10.1, 3.0)
    assert meter.age(10.1) == pytest.approx(0.2)
