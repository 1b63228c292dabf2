"""RobotLink: the robot's samples on our clock, and its reasons in words."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from hardware.follower import (
    EXPLANATIONS,
    STOPPED,
    BlinkOrder,
    BodySample,
    EStop,
    FollowerState,
    Refusal,
    RobotHealth,
    ThrustCommand,
)
from hardware.link.robot_end import SILENCE
from hardware.link.silence import SilenceTimes
from hardware.robot_file import BatteryParameters
from pipeline.estimation.standing_camera import STANDS_S, StandingPose
from pipeline.signals import LedRays, PhoneImu, RelativePose, StampOffset, VisionMeasurement
from pipeline.vision.blink_code import SLOT_S, book
from server.control.ipc_inputs import BlinkInput, RequestInput
from server.control.robot_clock import (
    DEAF,
    LINGER_S,
    BodyClock,
    RobotLink,
)
from server.control.robot_health import PRESSED, RobotCondition

SILENCE_S, RAMP_AFTER_S = SILENCE.coasts_s, SILENCE.ramps_s
RAMP_BEGUN_S = SILENCE.back_s - SILENCE.ramps_s
PATIENT = SilenceTimes(coasts_s=0.2, ramps_s=0.5, back_s=0.55)
"""Of a link that is not ours."""


def sample(
    t_us: int,
    state: FollowerState = FollowerState.IDLE,
    refusal: Refusal = Refusal.NONE,
    boot_id: int = 1,
) -> BodySample:
    up = np.array([0.0, 0.0, 9.81])
    return BodySample(t_us, np.zeros(3), up, np.zeros(8), state, boot_id, refusal, None)


class Script:
    """A follower that gives what it was told to give."""

    thrusters = 8

    def __init__(self) -> None:
        self.next: list[BodySample] = []

    def receive(self) -> list[BodySample]:
        given_, self.next = self.next, []
        return given_

    def send(self, command: ThrustCommand) -> None: ...

    def stop(self) -> None: ...

    def close(self) -> None: ...


@given(
    st.lists(st.floats(0.0, 0.2), min_size=5, max_size=100), st.floats(-1e5, 1e5), st.floats(0, 1)
)
def test_samples_are_never_later_than_they_arrive_and_their_spacing_stays(
    delays: list[float], offset: float, start: float
) -> None:
    clock = BodyClock()
    dated = []
    for k, delay in enumerate([0.0, *delays]):
        taken = start + 0.005 * k
        t_us = round(1e6 * taken)
        imu = clock.imu(sample(t_us), offset + 1e-6 * t_us + delay)
        assert imu.t <= offset + 1e-6 * t_us + delay + 1e-9
        dated.append(imu.t)
    np.testing.assert_allclose(np.diff(dated), 0.005, atol=1e-6)
    assert dated[0] == pytest.approx(offset + start, abs=1e-5)


def test_a_path_that_grew_longer_is_believed_after_a_second() -> None:
    clock = BodyClock()
    for k in range(300):
        clock.imu(sample(5_000 * k), 0.005 * k + 0.001)
    for k in range(300, 501):
        imu = clock.imu(sample(5_000 * k), 0.005 * k + 0.011)
    assert imu.t == pytest.approx(2.5 + 0.011)


def test_a_robot_that_restarts_has_another_clock() -> None:
    follower = Script()
    link = RobotLink(follower)
    follower.next = [sample(50_000_000)]
    link.receive(100.0)
    follower.next = [sample(5_000, boot_id=2)]
    (imu,) = link.receive(101.0)
    assert imu.t == pytest.approx(101.0)


def test_a_robot_that_restarted_with_its_emergency_stop_pressed_says_that_of_both() -> None:
    follower = Script()
    link = RobotLink(follower)
    follower.next = [
        sample(50_000_000),
        sample(5_000, FollowerState.STOPPED_BY_WIRE, Refusal.WIRE, boot_id=2),
    ]
    link.receive(101.0)
    assert link.reason == EXPLANATIONS[Refusal.WIRE]


class Telling(Script):
    """... and tells of its battery."""

    health: tuple[RobotHealth, float] | None = RobotHealth(9.0), 100.0


def test_a_stop_by_wire_is_named_as_it_is_while_it_lasts_and_as_it_was_after() -> None:
    follower = Telling()
    link = RobotLink(follower)
    was = EXPLANATIONS[Refusal.WIRE]
    for t, e_stop, said in ((100.0, EStop.OPEN, PRESSED), (100.1, EStop.CLOSED, was)):
        follower.health = RobotHealth(None, e_stop), t
        follower.next = [sample(50_000_000, FollowerState.STOPPED_BY_WIRE, Refusal.WIRE)]
        link.receive(100.1)
        assert link.reason == said


def test_what_a_robot_tells_is_judged_by_its_file_once_it_has_sent_a_sample() -> None:
    follower = Telling()
    link = RobotLink(follower, battery=BatteryParameters(10.5, 9.9))
    link.receive(100.0)
    assert link.condition == RobotCondition()
    follower.next = [sample(50_000_000)]
    link.receive(100.005)
    assert link.condition == RobotCondition("empty", 9.0, is_empty=True)


def test_of_a_robot_whose_link_carries_nothing_of_it_nothing_is_known() -> None:
    follower = Script()
    link = RobotLink(follower)
    follower.next = [sample(50_000_000)]
    for k in range(1_000):
        link.receive(100.0 + 0.005 * k)
    assert link.condition == RobotCondition()


def test_samples_of_before_a_restart_that_come_with_those_after_it_do_not_date_them() -> None:
    follower = Script()
    link = RobotLink(follower)
    follower.next = [sample(50_000_000), sample(5_000, boot_id=2), sample(10_000, boot_id=2)]
    _, first, second = link.receive(101.0)
    assert second.t == pytest.approx(101.0)
    assert first.t == pytest.approx(second.t, abs=0.006)


def test_a_robot_that_restarted_says_so_until_it_is_ready_whatever_else_it_refuses() -> None:
    follower = Script()
    link = RobotLink(follower)
    reasons = []
    for state, refusal, boot_id in [
        (FollowerState.RUNNING, Refusal.NONE, 1),
        (FollowerState.REFUSING, Refusal.NONCE, 2),
        (FollowerState.REFUSING, Refusal.EPOCH, 2),
        (FollowerState.IDLE, Refusal.NONE, 2),
        (FollowerState.RAMP, Refusal.SILENT, 2),
    ]:
        follower.next = [sample(1_000, state, refusal, boot_id)]
        link.receive(1.0)
        reasons.append(link.reason)
    started = EXPLANATIONS[Refusal.STARTED]
    assert reasons == ["", started, started, "", ""]
    assert link.gap == DEAF


def test_a_robot_that_coasts_or_has_only_just_begun_to_ramp_has_nothing_against_flying_on() -> None:
    follower, told = Script(), []
    link = RobotLink(follower)
    silent = EXPLANATIONS[Refusal.SILENT]
    for state, at in [
        (FollowerState.COAST, 1.0),
        (FollowerState.RAMP, 1.2),
        (FollowerState.RAMP, 1.2 + 0.9 * RAMP_BEGUN_S),
        (FollowerState.RAMP, 1.2 + 1.1 * RAMP_BEGUN_S),
        (FollowerState.RUNNING, 2.0),
        (FollowerState.RAMP, 3.0),
    ]:
        refusal = Refusal.NONE if state == FollowerState.RUNNING else Refusal.SILENT
        follower.next = [sample(1_000, state, refusal)]
        link.receive(at)
        told.append((link.reason, link.gap))
    bears, ended, well = ("", DEAF), (silent, ""), ("", "")
    assert told == [bears, bears, bears, ended, well, bears]


def test_a_link_that_states_other_times_is_believed() -> None:
    follower = Script()
    link = RobotLink(follower, silence=PATIENT)
    follower.next = [sample(1_000, FollowerState.RUNNING)]
    link.receive(1.0)
    link.receive(1.19)
    assert link.left_s == np.inf
    link.receive(1.3)
    assert link.left_s == pytest.approx(0.2)
    follower.next = [sample(2_000, FollowerState.COAST)]
    link.receive(2.0)
    assert link.left_s == pytest.approx(0.3)
    gaps = []
    for t in (3.0, 3.04, 3.06):
        follower.next = [sample(3_000, FollowerState.RAMP, Refusal.SILENT)]
        link.receive(t)
        gaps.append(link.gap)
    assert gaps == [DEAF, DEAF, ""]


def test_what_it_has_against_flying_is_told_until_it_has_nothing() -> None:
    follower = Script()
    link = RobotLink(follower)
    assert link.receive(1.0) == []
    assert link.reason == "The robot has not answered yet."
    for refusal in Refusal:
        for state in FollowerState:
            follower.next = [sample(1_000, state, refusal)]
            link.receive(1.0)
            link.receive(1.0 + RAMP_BEGUN_S)
            follower.next = [sample(1_000, state, refusal)]
            link.receive(1.0 + RAMP_BEGUN_S)
            refuses = state in (FollowerState.RAMP, *STOPPED)
            assert link.reason == (EXPLANATIONS[refusal] if refuses else "")
    follower.next = []
    before = link.reason
    link.receive(2.0)
    assert link.reason == before


def test_it_says_when_the_robot_will_ramp_by_itself() -> None:
    script = Script()
    link = RobotLink(script)
    left = {}
    for k in range(200):
        t = 0.005 * k
        coasts = 0.3 <= t < 0.4 or t >= 0.7
        state = FollowerState.COAST if coasts else FollowerState.RUNNING
        state = FollowerState.RAMP if t >= 0.92 else state
        script.next = [] if 0.5 < t < 0.65 else [sample(5000 * k, state)]
        link.receive(t)
        left[round(t, 3)] = link.left_s
    assert left[0.2] == left[0.45] == left[0.55] == left[0.65] == np.inf
    assert left[0.3] == pytest.approx(RAMP_AFTER_S - SILENCE_S)
    assert left[0.395] == pytest.approx(RAMP_AFTER_S - SILENCE_S - 0.095)
    assert left[0.6] == pytest.approx(RAMP_AFTER_S - 0.1)
    assert left[0.8] == pytest.approx(RAMP_AFTER_S - SILENCE_S - 0.1)
    assert left[0.95] == 0.0


class BlinkingScript(Script):
    """One whose robot can blink."""

    def __init__(self) -> None:
        super().__init__()
        self.orders: list[BlinkOrder] = []

    def blink(self, order: BlinkOrder) -> None:
        self.orders.append(order)


def told(follower: BlinkingScript, leds: int, *wishes: BlinkInput, now: float = 100.2) -> None:
    """A link whose robot's clock is 90 s behind ours passes wishes on."""
    link = RobotLink(follower, leds)
    follower.next = [sample(10_000_000)]
    link.receive(100.0)
    link.pass_on([RequestInput("arm"), *wishes], now)


def test_the_newest_wish_reaches_the_robot_on_its_own_clock() -> None:
    follower = BlinkingScript()
    told(follower, 5, BlinkInput(2, 99.0), BlinkInput(7, 100.1))
    (order,) = follower.orders
    assert order.begin_us == pytest.approx(10_100_000, abs=1)
    assert order.lasts_ms == round(1e3 * (0.1 + LINGER_S))
    assert order.slot_ms == round(1e3 * SLOT_S)
    assert order.dark == tuple(book(5)[7])


def test_nobody_blinks_that_cannot_or_for_longer_than_is_allowed() -> None:
    silent = BlinkingScript()
    told(silent, 0, BlinkInput(2, 100.1))
    told(silent, 5)
    told(silent, 5, BlinkInput(2, 100.1), now=111.0)
    told(silent, 5, BlinkInput(2, 9.0))
    assert silent.orders == []
    RobotLink(silent, 5).pass_on([BlinkInput(2, 100.1)], 100.2)  # its clock is not known
    RobotLink(Script(), 5).pass_on([BlinkInput(2, 100.1)], 100.2)
    assert silent.orders == []


class SeeingScript(Script):
    """Whose robot wants to be told where it is seen."""

    def __init__(self, *, wants: bool = True) -> None:
        super().__init__()
        self.wants_vision = wants
        self.seen: list[StandingPose] = []

    def see(self, seen: StandingPose) -> None:
        self.seen.append(seen)


def filmed(follower: SeeingScript, turning: float = 0.0) -> list[float]:
    """By a phone that stands, or turns; each picture comes 100 ms late. Gives their times."""
    link, captured = RobotLink(follower), []
    for k in range(300):
        t = 100.0 + k / 60.0
        up, late = np.array([0.0, 0.0, 9.81]), t - 0.1
        pose = RelativePose(late, np.array([2.0, 0.0, 0.0]), np.eye(3), np.eye(6), 0.1, 5)
        rays = LedRays(np.zeros(0, np.intp), np.zeros(0), np.zeros((0, 2)), np.zeros((0, 2, 2)))
        offset = StampOffset(-0.005, 0.002)
        messages = [
            VisionMeasurement(late, rays, pose, offset=offset),
            VisionMeasurement(late, rays, None),
            VisionMeasurement(late, rays, pose, lie="It shows another room."),
            PhoneImu(t, np.array([0.0, 0.0, turning]), up),
        ]
        link.pass_on(messages, t)
        captured.append(late - 0.005)
    return captured


def test_a_robot_that_wants_it_is_told_where_a_standing_phone_saw_it_and_when() -> None:
    follower = SeeingScript()
    captured = filmed(follower)
    assert len(follower.seen) == pytest.approx(300 - 60 * (STANDS_S + 0.1), abs=3)
    times = [seen.t for seen in follower.seen]
    assert times == pytest.approx(captured[-len(times) :])
    assert follower.seen[-1].p_bs_in_s == pytest.approx([2.0, 0.0, 0.0])


@pytest.mark.parametrize(("wants", "turning"), [(True, 0.1), (False, 0.0)])
def test_nothing_is_told_of_a_phone_that_moves_or_to_who_does_not_want_it(
    wants: bool, turning: float
) -> None:
    follower = SeeingScript(wants=wants)
    filmed(follower, turning)
    assert follower.seen == []
