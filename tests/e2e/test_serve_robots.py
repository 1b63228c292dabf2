"""`lightleash serve --robot …`: other robots behind real processes and sockets are followed."""

from __future__ import annotations

import pytest

from server.virtual_phone import live_loop

pytestmark = [pytest.mark.e2e, pytest.mark.flight]


@pytest.mark.parametrize(
    ("robot", "seconds", "bound_mm"), [("quadrotor", 14, 60), ("ground", 8, 40)]
)
def test_a_virtual_phone_leads_the_robot_the_server_names(
    robot: str, seconds: float, bound_mm: float
) -> None:
    with live_loop.server(robot, "phone") as environment:
        summary = live_loop.fly(environment, "demo", seconds, seed=1)
    assert float(summary["tracked_s"]) > 0.5 * seconds
    assert float(summary["rms_mm"]) < bound_mm
