"""Where a robot stays in a gap, and what it gives when nobody can tell where it should be."""

from __future__ import annotations

import numpy as np
import pytest

from hardware.robot_file import load_robot
from pipeline.config import TeleopConfig
from pipeline.control.acting import Moment
from pipeline.control.leading import PLAIN
from pipeline.control.leash import Leashed
from pipeline.control.pid import PoseError, Reference
from pipeline.control.place import SETTLED_S
from pipeline.control.thrust_acting import ThrustActing
from pipeline.control.tracking import Situation
from pipeline.frames import GRAVITY
from pipeline.signals import BodyImu, Mode, RelativeState, VirtualView

H, STILL, AHEAD = 0.005, np.zeros(3), np.array([1.5, 0.0, 0.0])
BODY = BodyImu(0.0, STILL, np.array([0.0, 0.0, GRAVITY]))
KNOWN = Situation(
    RelativeState(
        0.0, AHEAD, np.eye(3), STILL, STILL, STILL, np.eye(3), 0.0, 0.0, 0.0, STILL,
        np.array([0.0, 0.0, GRAVITY]),
    ),
    np.eye(3),
    VirtualView(np.eye(3), STILL, AHEAD, np.eye(3), STILL, STILL),
)  # fmt: skip
OFF = np.array([0.1, -0.05, 0.02])
ERROR = Leashed(PoseError(OFF, STILL, STILL, STILL))


def moment(mode: Mode) -> Moment:
    return Moment(mode, Reference(AHEAD, np.eye(3)), PLAIN, BODY, False, H, 0.0)


def coasting(robot: str, known_for_s: float, leashed: Leashed | None) -> ThrustActing:
    """One at rest that has felt itself for so long, and tracked with an error of `OFF`."""
    acting = ThrustActing(load_robot(robot).robot, TeleopConfig())
    for _ in range(round(known_for_s / H)):
        acting.observe(KNOWN, moment(Mode.ARMED))
    acting.start(KNOWN, True)
    acting.act(KNOWN, ERROR, moment(Mode.TRACK), 1.0)
    acting.change_mode(Mode.TRACK, Mode.COAST, KNOWN, leashed)
    return acting


def wanted_in_v(acting: ThrustActing) -> np.ndarray:
    error = acting.coast_error(KNOWN.view)
    assert error is not None
    return error.e_p_in_v


@pytest.mark.parametrize("robot", ["ames", "quadrotor"])
def test_in_a_gap_it_stays_where_it_should_be_and_in_doubt_of_that_where_it_is(robot: str) -> None:
    known_s = SETTLED_S + 1.0
    assert wanted_in_v(coasting(robot, known_s, ERROR)) == pytest.approx(OFF)
    assert wanted_in_v(coasting(robot, known_s, None)) == pytest.approx(STILL)


def test_one_that_hangs_and_does_not_know_its_place_gives_less_and_less_in_doubt() -> None:
    acting = coasting("ames", 1.0, None)
    assert acting.coast_error(KNOWN.view) is None
    given = [acting.act(KNOWN, None, moment(Mode.COAST), 1.0).thrusts.max() for _ in range(1000)]
    assert given[0] > 0.5
    assert given[-1] < 0.15 * given[0]


def test_one_that_hangs_stays_through_a_gap_though_it_does_not_know_its_place() -> None:
    assert wanted_in_v(coasting("ames", 1.0, ERROR)) == pytest.approx(OFF)


def test_one_that_flies_has_no_place_and_stays_in_doubt_all_the_same() -> None:
    assert wanted_in_v(coasting("quadrotor", 1.0, None)) == pytest.approx(STILL)
