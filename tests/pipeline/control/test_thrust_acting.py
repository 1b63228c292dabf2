"""Where a robot stays in a gap, and what it gives when nobody can tell where it should be."""

from __future__ import annotations

from dataclasses import replace

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
from pipeline.frames import GRAVITY, Array, exp
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


def moment(mode: Mode, body: BodyImu = BODY) -> Moment:
    return Moment(mode, Reference(AHEAD, np.eye(3)), PLAIN, body, False, H, 0.0, True)


def coasting(robot: str, known_for_s: float, leashed: Leashed | None) -> ThrustActing:
    """One at rest that has felt itself for so long, and tracked with an error of `OFF`."""
    acting = ThrustActing(load_robot(robot).robot, TeleopConfig())
    for _ in range(round(known_for_s / H)):
        acting.observe(KNOWN, moment(Mode.ARMED))
    acting.start(KNOWN, True)
    for _ in range(200):
        acting.act(KNOWN, ERROR, moment(Mode.TRACK), 1.0)
    acting.change_mode(Mode.TRACK, Mode.COAST, KNOWN, leashed)
    return acting


def wanted_in_v(acting: ThrustActing) -> Array:
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


def test_biases_that_a_doubtful_estimate_takes_for_better_move_nobody_in_a_gap() -> None:
    relative = replace(KNOWN.relative, f_bf_in_b=np.array([0.0, 0.0, GRAVITY + 5.0]))
    wanted = []
    for known in (KNOWN, replace(KNOWN, relative=relative)):
        acting = coasting("ames", SETTLED_S + 1.0, None)
        for _ in range(round(1.0 / H)):
            acting.observe(known, moment(Mode.COAST))
        wanted.append(wanted_in_v(acting))
    np.testing.assert_array_equal(*wanted)


def test_a_place_that_is_lost_in_doubt_is_lost_until_it_follows_again() -> None:
    acting = coasting("ames", SETTLED_S + 1.0, None)
    turned = replace(BODY, a_m_bf_in_b=-BODY.a_m_bf_in_b)
    for body, seconds in ((turned, 0.2), (BODY, 6.0 * SETTLED_S)):
        for _ in range(round(seconds / H)):
            acting.observe(KNOWN, moment(Mode.COAST, body))
            acting.act(KNOWN, None, moment(Mode.COAST, body), 1.0)
        assert acting.coast_error(KNOWN.view) is None
    assert acting._place.is_known  # again, but where it went meanwhile is not
    acting.change_mode(Mode.TRACK, Mode.COAST, KNOWN, ERROR)
    assert acting.coast_error(KNOWN.view) is not None


def seen_by(R_fc: Array) -> Situation:
    """The same robot, by a phone whose f has other axes."""
    return Situation(KNOWN.relative, R_fc, replace(KNOWN.view, R_fv=R_fc))


@pytest.mark.parametrize("robot", ["ames", "quadrotor"])
@pytest.mark.parametrize("mode", [Mode.TRACK, Mode.HOLD])
def test_after_a_gap_that_another_phone_ends_it_goes_where_it_went(robot: str, mode: Mode) -> None:
    pushed = replace(BODY, a_m_bf_in_b=BODY.a_m_bf_in_b + np.array([0.4, 0.0, 0.0]))
    heading = seen_by(exp(np.array([0.0, 0.0, 2.5])))
    known, unknown = (_went_in_b(robot, mode, pushed, after) for after in (KNOWN, heading))
    np.testing.assert_allclose(unknown, known, atol=1e-9)
    assert np.linalg.norm(known[0]) > 0.02


def _went_in_b(robot: str, mode: Mode, pushed: BodyImu, after: Situation) -> Array:
    """Velocities and places (4, 3) after a gap, as the station and the suspension know them."""
    acting = coasting(robot, SETTLED_S + 1.0, ERROR)
    for _ in range(round(0.3 / H)):
        acting.observe(KNOWN, moment(Mode.COAST, pushed))
        acting.act(KNOWN, None, moment(Mode.COAST, pushed), 1.0)
    if mode == Mode.TRACK:
        acting.start_place()
        acting.start(after, False)
    else:
        acting.change_mode(Mode.COAST, mode, after, None)
    acting.observe(after, moment(mode))
    station, place = acting._station, acting._place
    kept_in_f = (station.v_in_f, place.v_in_f, place.from_rest_in_f, place.x_in_f)
    return np.array(kept_in_f) @ after.view.R_fv


def test_a_doubt_begins_with_what_was_given_of_late_and_not_with_the_last_lie() -> None:
    acting = ThrustActing(load_robot("ames").robot, TeleopConfig())
    acting.start(KNOWN, True)
    for _ in range(round(2.0 / H)):
        honest = acting.act(KNOWN, ERROR, moment(Mode.TRACK), 1.0).thrusts
    lie = Leashed(PoseError(-20.0 * OFF, STILL, STILL, STILL))
    for _ in range(4):
        lied = acting.act(KNOWN, lie, moment(Mode.TRACK), 1.0).thrusts
    acting.change_mode(Mode.TRACK, Mode.COAST, KNOWN, None)
    doubted = acting.act(KNOWN, None, moment(Mode.COAST), 1.0).thrusts
    assert np.linalg.norm(doubted - honest) < 0.25 * np.linalg.norm(lied - honest)
