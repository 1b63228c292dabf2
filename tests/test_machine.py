"""The measure of a machine counts its processor's own work alone."""

from __future__ import annotations

import os
import time

import pytest

from tests import machine


def test_it_grows_with_the_work_that_is_asked_and_is_never_below_one(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(machine, "REFERENCE_S", 1e-5)
    once = machine.slowness()
    monkeypatch.setattr(machine, "STEPS", 4 * machine.STEPS)
    assert machine.slowness() > 1.5 * once > 1.5  # 4, but the processor's speed walks
    monkeypatch.setattr(machine, "REFERENCE_S", 1e3)
    assert machine.slowness() == 1.0


def test_who_waits_for_a_processor_is_not_slow(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(machine, "_work", lambda: time.sleep(0.02))
    assert machine.slowness() == 1.0


def test_what_is_spare_is_what_nobody_computes_in():
    idle = machine.Load()
    time.sleep(0.3)
    most = idle.spare
    busy, end = machine.Load(), time.monotonic() + 0.5
    while time.monotonic() < end:
        pass
    count = os.cpu_count()
    assert -0.1 <= busy.spare <= 1.1 - 1.0 / count, "one of the processors was taken"
    assert -0.1 <= most <= 1.1
