"""Controller: what the control process does in a tick, in virtual time."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from math import inf, nan

import msgspec
import numpy as np
import pytest

from hardware.follower import RobotCommand
from hardware.link.robot_end import SILENCE
from hardware.link.silence import SilenceTimes
from hardware.robot_file import COMMANDS, load_robot
from pipeline.config import PERIOD_S, TeleopConfig, VirtualCameraMode
from pipeline.frames import GRAVITY
from pipeline.signals import BodyImu, Mode, PhoneImu, TouchState, VisionMeasurement
from pipeline.teleop import Output
from server.common.runtime_parameters import Tune
from server.control.controller import (
    STOOD_STILL_S,
    UNTOLD,
    Controller,
    Mean,
    TooLate,
    never_too_late,
)
from server.control.gap_log import MANY, SIDES
from server.control.ipc import ControlStatus, control_end, expected_of, server_end
from server.control.ipc_inputs import Input, ReadyInput, RequestInput, ToolInput
from server.control.robot_health import PRESSED, HealthFields, RobotCondition
from server.control.tick_rate import OVER_S
from server.protocol.lead_messages import Lead
from tests.pipeline.seeing import quiver, seen_at

ROBOT = load_robot("ames").robot
UP, STILL = np.array((0.0, 0.0, GRAVITY)), np.zeros(3)
COVARIANCE = np.diag([1e-6] * 6)


def picture(t: float) -> VisionMeasurement:
    """Of a robot at rest, 2.5 m ahead."""
    place = np.array([2.5, 0.0, 0.0])
    return seen_at(t, place, np.eye(3), COVARIANCE, leds_in_b=ROBOT.leds_in_b)


class Rig:
    """A phone at rest that sees a robot at rest; time passes as `run` says."""

    def __init__(
        self, unfit: str = "", too_late: TooLate = never_too_late, gains_weak: str = ""
    ) -> None:
        self.controller = Controller(ROBOT, TeleopConfig(), unfit, too_late, gains_weak)
        self.k = 0
        self.held = False
        self.press = 0
        self.ready: list[str] | None = []
        self.condition = UNTOLD

    def said(self, t: float) -> list[Input]:
        said: list[Input] = []
        if self.k % 3 == 0:
            said.append(PhoneImu(t - 0.02, STILL, UP))
        if self.k % 6 == 0:
            said.append(picture(t - 0.05))
        if self.ready is not None:
            said.append(ReadyInput(self.ready))
        return [*said, TouchState(t - 0.01, self.held, self.press)]

    def run(
        self,
        seconds: float,
        extra: Sequence[Input] = (),
        robot_reason: str = "",
        robot_gap: str = "",
    ) -> list[tuple[RobotCommand, Output]]:
        """`extra` comes in the first tick."""
        out = []
        for step in range(round(seconds / 0.005)):
            self.k += 1
            t = 100.0 + 0.005 * self.k
            said = [*self.said(t), *(extra if step == 0 else ())]
            body = [BodyImu(t - 0.003, quiver(t), np.array(UP))]
            out.append(
                self.controller.tick(
                    t, said, body, robot_reason, robot_gap, condition=self.condition
                )
            )
        return out

    def track(self) -> None:
        """Arm and press."""
        self.run(1.0)
        self.run(0.1, [RequestInput("arm")])
        self.held, self.press = True, self.press + 1
        assert self.run(0.5)[-1][1].failsafe.mode == Mode.TRACK

    def at_rate(
        self, rate_hz: int, seconds: float, extra: Sequence[Input] = ()
    ) -> Iterator[tuple[float, Output]]:
        """Phone, pictures and robot as ever, control `rate_hz` times a second; (t, output)."""
        start, said, body = 100.0 + 0.005 * self.k, list(extra), list[BodyImu]()
        for n in range(1, round(seconds * rate_hz) + 1):
            t = start + n / rate_hz
            while 100.0 + 0.005 * (self.k + 1) <= t + 1e-9:
                self.k += 1
                heard = 100.0 + 0.005 * self.k
                said += self.said(heard)
                body.append(BodyImu(heard - 0.003, quiver(heard), np.array(UP)))
            yield t, self.controller.tick(t, said, body, "")[1]
            said, body = [], []

    def status(self, output: Output) -> ControlStatus:
        return self.controller.status(output, 1, "FIFO", {}, 0.5, 0)


def test_it_is_armed_by_request_follows_a_press_and_stops_at_once():
    rig = Rig()
    assert not rig.run(1.0)[-1][0].armed
    rig.track()
    command, output = rig.run(0.1)[-1]
    assert (command.armed, command.stop) == (True, False)
    command, output = rig.run(0.005, [RequestInput("stop")])[-1]
    assert output.failsafe.mode == Mode.STOPPED
    assert (command.armed, command.stop) == (False, True)
    assert not command.thrusts.any()


def test_a_stop_wins_over_every_other_wish_of_the_same_tick():
    rig = Rig()
    rig.track()
    wishes = [RequestInput(what) for what in ("arm", "stop", "reset", "disarm")]
    assert rig.run(0.05, wishes)[-1][1].failsafe.mode == Mode.STOPPED


def test_an_unknown_wish_is_no_wish():
    rig = Rig()
    rig.run(1.0)
    for what in ("", "fly", "__class__", "key_frame", "ARM"):
        assert rig.run(0.01, [RequestInput(what)])[-1][1].failsafe.mode == Mode.DISARMED


def test_before_the_server_has_spoken_and_when_it_falls_silent_arming_is_refused():
    rig = Rig()
    rig.ready = None
    output = rig.run(1.0)[-1][1]
    assert "The server is silent." in output.refusals
    rig.ready = []
    assert rig.run(0.01)[-1][1].refusals == ()
    rig.ready = None
    assert rig.run(0.5)[-1][1].refusals == ()
    assert rig.run(0.005)[-1][1].refusals == ("The server is silent.",)
    assert rig.run(0.05, [RequestInput("arm")])[-1][1].failsafe.mode == Mode.DISARMED


def test_what_server_and_robot_have_against_arming_is_all_told():
    rig = Rig()
    rig.ready = ["No pictures."]
    output = rig.run(1.0, robot_reason="The robot ramps.")[-1][1]
    assert output.refusals[:2] == ("No pictures.", "The robot ramps.")
    assert rig.run(0.05, [RequestInput("arm")])[-1][1].failsafe.mode == Mode.DISARMED


def test_a_process_that_is_unfit_never_arms_and_says_why():
    rig = Rig(unfit="No real-time priority.")
    assert rig.run(1.0)[-1][1].refusals == ("No real-time priority.",)
    assert rig.run(0.05, [RequestInput("arm")])[-1][1].failsafe.mode == Mode.DISARMED


EMPTY = RobotCondition("empty", 9.8, is_empty=True)
REFUSED = "The robot's battery is empty (9.8 V): charge it before arming."


def test_a_robot_with_an_empty_battery_is_not_armed_and_its_reason_is_told_once():
    rig = Rig()
    rig.condition = EMPTY
    output = rig.run(1.0)[-1][1]
    assert output.refusals == (REFUSED,)
    assert rig.status(output).health.words == [REFUSED]
    assert rig.run(0.05, [RequestInput("arm")])[-1][1].failsafe.mode == Mode.DISARMED


@pytest.mark.parametrize("press", [False, True])
def test_one_that_is_armed_and_waits_is_disarmed_by_it_even_as_somebody_presses(press):
    rig = Rig()
    rig.run(1.0)
    assert rig.run(0.6, [RequestInput("arm")])[-1][1].failsafe.mode == Mode.ARMED
    rig.condition, rig.held, rig.press = EMPTY, press, rig.press + press
    failsafe = rig.run(0.005)[-1][1].failsafe
    assert (failsafe.mode, failsafe.reason) == (Mode.DISARMED, REFUSED)


def test_a_battery_that_runs_empty_in_flight_ends_no_flight_and_is_told_urgently():
    rig = Rig()
    rig.track()
    rig.condition = EMPTY
    command, output = rig.run(3.0)[-1]
    assert (command.armed, output.failsafe.mode) == (True, Mode.TRACK)
    said = "The robot's battery is empty (9.8 V): bring it to rest now."
    assert rig.status(output).health == HealthFields("empty", 9.8, said)
    rig.held = False
    assert rig.run(0.5)[-1][1].failsafe.mode == Mode.HOLD
    rig.held, rig.press = True, rig.press + 1
    assert rig.run(1.0)[-1][1].failsafe.mode == Mode.TRACK


def test_while_the_emergency_stop_is_pressed_it_is_not_armed_and_the_reason_is_told_once():
    rig = Rig()
    rig.condition = RobotCondition(e_stop="pressed")
    output = rig.run(1.0, robot_reason=PRESSED)[-1][1]
    assert output.refusals == (PRESSED,)
    assert rig.status(output).health.words == [PRESSED]
    assert rig.run(0.05, [RequestInput("arm")], PRESSED)[-1][1].failsafe.mode == Mode.DISARMED
    rig.condition = RobotCondition(e_stop="released")
    assert rig.run(1.0)[-1][1].refusals == ()


def test_a_flight_that_the_emergency_stop_ends_must_be_armed_anew():
    rig = Rig()
    rig.track()
    rig.condition = RobotCondition(e_stop="pressed")
    failsafe = rig.run(0.005, robot_reason=PRESSED)[-1][1].failsafe
    assert (failsafe.mode, failsafe.reason) == (Mode.RAMP, PRESSED)
    rig.condition = RobotCondition(e_stop="released")
    assert rig.run(4.0)[-1][1].failsafe.mode == Mode.DISARMED


def test_what_gains_lack_is_told_and_refuses_nothing():
    rig = Rig(gains_weak="Gains 'mine' have little margin.")
    output = rig.run(1.0)[-1][1]
    assert rig.status(output).gains_weak == "Gains 'mine' have little margin."
    assert output.refusals == ()
    assert Rig().status(output).gains_weak == ""


def test_how_old_pictures_and_body_samples_are_lately_is_asked_before_arming():
    asked: list[tuple[float, float]] = []

    def too_late(picture_age: float, body_age: float) -> str:
        asked.append((picture_age, body_age))
        return "Too late." if body_age > 0.003 + 1e-6 else ""

    rig = Rig(too_late=too_late)
    assert rig.run(1.0)[-1][1].refusals == ()
    assert asked[0] == (0.0, 0.0)
    assert asked[-1] == pytest.approx((0.05, 0.003))
    t = 100.0 + 0.005 * (rig.k + 1)
    body = [BodyImu(t - age, np.zeros(3), np.array(UP)) for age in (0.004, 0.001, 0.0035)]
    rig.controller.tick(t, rig.said(t), body, "")
    output = rig.controller.tick(t + 0.005, rig.said(t), body[:0], "")[1]
    assert asked[-1][1] == pytest.approx(0.003 + 0.0005 / 50)
    assert output.refusals == ("Too late.",)


def test_a_mean_is_exact_of_the_first_values_and_forgets_them_within_some_dozens():
    values, mean = np.random.default_rng(0).normal(size=50), Mean()
    assert mean.value == 0.0
    for n, value in enumerate(values, 1):
        mean.add(value)
        assert mean.value == pytest.approx(values[:n].mean())
    for _ in range(50):
        before, _ = mean.value, mean.add(10.0)
        assert mean.value - before == pytest.approx((10.0 - before) / 50)


def test_whoever_knows_no_margins_finds_nothing_too_late():
    assert never_too_late(inf, inf) == ""


def test_what_is_refused_before_anything_was_armed_is_no_reason_of_a_flights_end():
    output = Rig().run(0.005, robot_reason="The robot ramps.")[0][1]
    assert (output.failsafe.mode, output.failsafe.reason) == (Mode.DISARMED, "Not armed.")


def test_what_the_robot_refuses_is_no_fault_before_the_first_arming():
    rig = Rig()
    rig.k = 5  # a tick with news of everything
    refusals = rig.run(0.005, robot_reason="The robot ramps.")[0][1].refusals
    assert refusals == ("The robot ramps.", "Just recovered: wait a moment.")


def test_what_the_robot_refuses_while_stopped_delays_no_arming_after_it():
    rig = Rig()
    rig.track()
    rig.held = False
    rig.run(0.005, [RequestInput("stop")])
    rig.run(1.0, robot_reason="The robot ramps.")
    assert rig.run(0.005, [RequestInput("reset")])[-1][1].refusals == ()


def turned_by(mode: VirtualCameraMode) -> float:
    """How far the view turns with a phone within 0.2 s [rad], by a knob turned in flight."""
    rig = Rig()
    rig.track()
    said = rig.said

    def turning(t: float) -> list[Input]:
        phone = PhoneImu(t - 0.02, np.array((0.0, 0.0, 0.5)), UP)
        return [
            *(one for one in said(t) if not isinstance(one, PhoneImu | VisionMeasurement)),
            phone,
        ]

    rig.said = turning
    rig.run(0.1, [Tune(mode=mode, cutoff_hz=0.1)])
    outputs = [output for _, output in rig.run(0.2)]
    knobs = rig.status(outputs[-1]).knobs
    assert (knobs.mode, knobs.cutoff_hz) == (mode, pytest.approx(0.1, rel=0.01))
    views = [output.view.R_fv for output in outputs if output.view is not None]
    return float(np.arccos((np.trace(views[0].T @ views[-1]) - 1.0) / 2.0))


def test_a_knob_that_is_turned_in_flight_is_told_and_turns_the_view():
    assert turned_by("off") > 3.0 * turned_by("full")


def test_a_silent_server_ends_a_flight_in_a_ramp():
    rig = Rig()
    rig.track()
    rig.said = lambda t: []
    limits = TeleopConfig().failsafe
    seconds = limits.gap + ROBOT.ramp_s + 0.2
    modes = [output.failsafe.mode for _, output in rig.run(seconds)]
    order = [mode for mode, before in zip(modes, [None, *modes], strict=False) if mode != before]
    assert order == [Mode.TRACK, Mode.COAST, Mode.RAMP, Mode.DISARMED]


def test_a_robot_that_refuses_ends_a_flight_with_its_own_reason():
    rig = Rig()
    rig.track()
    (_, output), *_ = rig.run(0.005, robot_reason="The robot ramps.")
    assert output.failsafe.mode == Mode.RAMP
    assert output.failsafe.reason == "The robot ramps."
    later = rig.run(ROBOT.ramp_s + 0.1)[-1][1].failsafe
    assert (later.mode, later.reason) == (Mode.DISARMED, "The robot ramps.")


def test_a_robot_that_refuses_disarms_what_is_armed_ramps_what_is_held_and_else_only_refuses():
    rig = Rig()
    rig.run(1.0)
    assert rig.run(0.1, [RequestInput("arm")])[-1][1].failsafe.mode == Mode.ARMED
    state = rig.run(0.005, robot_reason="The robot ramps.")[-1][1].failsafe
    assert (state.mode, state.reason) == (Mode.DISARMED, "The robot ramps.")
    output = rig.run(0.6, robot_reason="The robot ramps.")[-1][1]
    assert output.refusals == ("The robot ramps.",)
    assert rig.run(0.05)[-1][1].refusals == ()
    rig.track()
    rig.held = False
    assert rig.run(0.1)[-1][1].failsafe.mode == Mode.HOLD
    state = rig.run(0.1, robot_reason="The robot ramps.")[-1][1].failsafe
    assert (state.mode, state.reason) == (Mode.RAMP, "The robot ramps.")


def test_a_robot_that_refuses_after_a_gap_ends_the_flight():
    rig = Rig()
    rig.track()
    assert rig.run(0.1, robot_gap="The robot coasts.")[-1][1].failsafe.mode == Mode.COAST
    state = rig.run(0.005, robot_reason="The robot ramps.")[-1][1].failsafe
    assert (state.mode, state.reason) == (Mode.RAMP, "The robot ramps.")


def refusals_after(pause_s: float, silence: SilenceTimes = SILENCE) -> tuple[str, ...]:
    """Of a pause that began at 0, where times are exact."""
    controller = Controller(ROBOT, TeleopConfig(), silence=silence)
    for t in (0.0, pause_s):
        said: list[Input] = [PhoneImu(t, STILL, UP), picture(t), ReadyInput([])]
        said.append(TouchState(t, False, 0))
        _, output = controller.tick(t, said, [BodyImu(t, np.zeros(3), np.array(UP))], "")
    return output.refusals


def test_a_pause_that_the_robot_bears_is_no_standing_still():
    assert refusals_after(STOOD_STILL_S) == ("Just recovered: wait a moment.",)
    longer = refusals_after(np.nextafter(STOOD_STILL_S, 1.0))
    assert longer == ("The server's computer stood still for 0.06 s.",)


def test_a_link_that_bears_less_makes_a_pause_a_shorter_one_and_a_patient_link_none_longer():
    stood = ("The server's computer stood still for 0.04 s.",)
    assert refusals_after(0.04, SilenceTimes(0.03, 0.05, 0.05)) == stood
    longer = refusals_after(np.nextafter(STOOD_STILL_S, 1.0), SilenceTimes(0.5, 0.6, 0.7))
    assert longer == ("The server's computer stood still for 0.06 s.",)


def test_a_server_that_stood_still_for_as_long_as_a_gap_may_last_ends_no_flight():
    rig = Rig()
    rig.track()
    while (rig.k + 200) % 6:  # so that news of everything await it
        rig.run(0.005)
    rig.k += 199
    state = rig.run(0.005)[-1][1].failsafe
    assert (state.mode, "stood still for 1.00 s" in state.reason) == (Mode.COAST, True)


def test_a_stall_before_arming_is_a_refusal_that_passes():
    rig = Rig()
    rig.run(1.0)
    rig.k += 14
    (refused,) = rig.run(0.005)[-1][1].refusals
    assert "stood still" in refused
    assert rig.run(0.1)[-1][1].refusals == ("Just recovered: wait a moment.",)
    assert rig.run(0.5)[-1][1].refusals == ()


@pytest.mark.parametrize(
    ("ticks", "mode", "then"),
    [
        (11, Mode.TRACK, Mode.TRACK),
        (13, Mode.COAST, Mode.TRACK),
        (180, Mode.COAST, Mode.TRACK),
        (202, Mode.RAMP, Mode.RAMP),
    ],
)
def test_a_server_that_stood_still_is_borne_as_a_gap_or_ends_the_flight_and_says_so(
    ticks: int, mode: Mode, then: Mode
):
    rig = Rig()
    rig.track()
    rig.k += ticks - 1
    state = rig.run(0.005)[-1][1].failsafe
    assert (f"stood still for {0.005 * ticks:.2f} s" in state.reason) == (mode != Mode.TRACK)
    assert state.mode == mode
    fresh = TeleopConfig().failsafe.fresh
    assert rig.run(fresh - 0.01)[-1][1].failsafe.mode == mode
    assert rig.run(0.04)[-1][1].failsafe.mode == then


def test_a_robot_that_hears_nothing_for_a_moment_is_waited_for():
    rig = Rig()
    rig.track()
    output = rig.run(0.1, robot_gap="The robot coasts.")[-1][1]
    assert (output.failsafe.mode, output.failsafe.reason) == (Mode.COAST, "The robot coasts.")
    assert output.resumes
    assert rig.run(0.2)[-1][1].failsafe.mode == Mode.TRACK


def test_a_status_tells_how_long_it_waits_and_whose_gaps_there_were():
    rig = Rig()
    rig.track()
    hears = rig.said
    rig.said = lambda t: []
    status = rig.status(rig.run(0.4)[-1][1])
    assert status.mode == Mode.COAST
    assert status.resumes
    assert status.until_ramp_s == pytest.approx(TeleopConfig().failsafe.gap - 0.4, abs=0.03)
    rig.said = hears
    rig.run(0.1, robot_gap="The robot coasts.")
    rig.k += 40
    status = rig.status(rig.run(0.5)[-1][1])
    assert status.mode == Mode.TRACK
    assert status.until_ramp_s is None
    assert not status.resumes
    assert {side: gaps.count for side, gaps in status.gaps.items()} == dict.fromkeys(SIDES, 1)
    assert status.gaps["phone"].longest_s == pytest.approx(0.42, abs=0.03)
    assert status.gaps["server"].longest_s == pytest.approx(0.205)
    assert status.gaps["robot"].longest_s == pytest.approx(STOOD_STILL_S + 0.105)
    assert status.warnings == []
    assert msgspec.msgpack.decode(msgspec.msgpack.encode(status), type=ControlStatus) == status


def test_a_pause_that_the_robot_bears_ends_no_gap_of_the_phone():
    controller = Controller(ROBOT, TeleopConfig())
    said = [TouchState(-0.3, False, 0), PhoneImu(-0.3, STILL, UP)]
    for t in (0.0, STOOD_STILL_S, STOOD_STILL_S + PERIOD_S):
        _, output = controller.tick(t, said if t == 0.0 else [], [], "")
    gaps = controller.status(output, 1, "FIFO", {}, 0.5, 0).gaps
    assert (gaps["phone"].count, gaps["server"].count) == (1, 0)


@pytest.mark.parametrize("heard", [TouchState, PhoneImu])
def test_a_phone_of_which_only_half_is_heard_has_a_gap(heard: type):
    rig = Rig()
    rig.track()
    everything = rig.said
    rig.said = lambda t: [one for one in everything(t) if isinstance(one, heard)]
    rig.run(0.4)
    rig.said = everything
    gaps = rig.status(rig.run(0.1)[-1][1]).gaps
    assert gaps["phone"].longest_s == pytest.approx(0.42, abs=0.03)


def test_a_link_with_six_gaps_a_minute_warns_whoever_arms():
    rig = Rig()
    rig.run(1.0)
    for _ in range(MANY):
        rig.k += 20
        status = rig.status(rig.run(0.6)[-1][1])
    assert status.warnings == [
        "The server's computer stood still 6 times in a minute, the longest 0.10 s."
    ]
    assert status.refusals == []


def test_what_is_no_number_never_reaches_the_state_by_a_datagram(tmp_path):
    rig, server, control = Rig(), server_end(tmp_path), control_end(tmp_path)
    rig.track()
    heard: list[Input] = []
    for bad in (nan, inf, -inf, 1e300):
        server.send(PhoneImu(101.5, np.array((bad, 0.0, 0.0)), UP))
        server.send(PhoneImu(bad, STILL, UP))
        good = picture(101.5)
        pose, rays = good.pose, good.rays
        assert pose is not None
        server.send(replace(good, pose=replace(pose, p_bc_in_c=np.array((bad, 0.0, 0.0)))))
        server.send(replace(good, pose=replace(pose, covariance=np.full((6, 6), bad))))
        tangents = np.where(rays.tangents == rays.tangents[0, 1], bad, rays.tangents)
        server.send(replace(good, pose=None, rays=replace(rays, tangents=tangents)))
        server.send(TouchState(bad, True, 5))
        heard += control.inputs()
    server.close()
    control.close()
    output = rig.run(0.5, heard)[-1][1]
    assert heard == []
    assert control.dropped == 24
    assert output.failsafe.mode == Mode.TRACK
    assert output.relative is not None
    assert np.isfinite(output.relative.p_bc_in_c).all()
    assert np.isfinite(output.thrusts).all()


def test_a_status_tells_everything_once_and_survives_the_link():
    rig = Rig()
    first = rig.status(rig.run(0.005)[-1][1])
    assert first.p_bc_in_c is None
    assert (first.fuse_ms, first.guarding) == (0.0, 0.0)
    assert first.mode == Mode.DISARMED
    rig.track()
    rig.status(rig.run(0.1)[-1][1])
    status = rig.status(rig.run(0.02)[-1][1])
    assert len(status.body_samples) == 4
    assert status.body_imu_rate_hz == 200.0
    np.testing.assert_allclose(status.p_bc_in_c, (2.5, 0.0, 0.0), atol=1e-2)
    assert status.error_m is not None
    assert status.poses_fused > 0
    assert 40.0 < status.fuse_ms < 80.0
    assert msgspec.msgpack.decode(msgspec.msgpack.encode(status), type=ControlStatus) == status


def test_a_status_has_each_tick_s_command_once_with_the_digits_that_a_recording_keeps():
    rig = Rig()
    rig.track()
    rig.controller.teleop.push(np.full(6, 0.123456789))
    rig.status(rig.run(0.1)[-1][1])
    ticks = rig.run(0.02)
    status = rig.status(ticks[-1][1])
    assert [row[0] for row in status.commands] == [round(output.t, 6) for _, output in ticks]
    for (_, *thrusts), (command, _) in zip(status.commands, ticks, strict=True):
        np.testing.assert_array_equal(thrusts, np.round(command.thrusts, 4))
        assert max(thrusts) > 0.0
    assert rig.status(ticks[-1][1]).commands == []
    command, output = rig.controller.tick(200.1234567, [], [], "")
    assert [row[0] for row in rig.status(output).commands] == [200.123457]


def test_how_it_is_led_is_told_and_holds_from_the_next_press_on():
    rig = Rig()
    rig.track()
    status = rig.status(rig.run(0.1, [Lead(2.0, "shift")])[-1][1])
    assert (status.lead, status.next_lead) == (Lead(1.0, "all"), Lead(2.0, "shift"))
    rig.held = False
    rig.run(0.1)
    rig.held, rig.press = True, rig.press + 1
    assert rig.status(rig.run(0.5)[-1][1]).lead == Lead(2.0, "shift")


def test_what_a_hand_asks_of_the_tool_is_told_while_it_leads_and_never_before_or_after():
    rig = Rig()
    rig.run(0.1, [ToolInput(0.9)])
    rig.track()
    assert rig.status(rig.run(0.005)[-1][1]).tool_opening is None
    assert rig.status(rig.run(0.005, [ToolInput(0.3)])[-1][1]).tool_opening == 0.3
    assert rig.status(rig.run(0.1)[-1][1]).tool_opening == 0.3
    rig.held = False
    assert rig.status(rig.run(0.1)[-1][1]).tool_opening is None
    rig.held, rig.press = True, rig.press + 1
    output = rig.run(0.5)[-1][1]
    assert output.failsafe.mode == Mode.TRACK
    assert rig.status(output).tool_opening is None


def test_a_status_of_a_robot_that_takes_a_twist_has_what_it_is_told_and_what_it_measures():
    controller = Controller(load_robot("twister", takes=COMMANDS).robot, TeleopConfig())
    measured = (0.1, 0.0, 0.0, 0.0, 0.0, -0.2)
    body = [BodyImu(0.005 * k, STILL, UP, np.array(measured)) for k in range(4)]
    _, output = controller.tick(0.02, [], body, "")
    status = controller.status(output, 1, "", {}, 0.0, 0)
    assert (status.thrusts, status.twist_in_b) == ([], (0.0,) * 6)
    assert status.body_twists == [(0.005 * k, *measured) for k in range(4)]
    told = replace(output, twist_in_b=np.arange(1.0, 7.0))
    again = controller.status(told, 1, "", {}, 0.0, 0)
    assert (again.twist_in_b, again.body_twists) == ((1.0, 2.0, 3.0, 4.0, 5.0, 6.0), [])
    assert msgspec.msgpack.decode(msgspec.msgpack.encode(status), type=ControlStatus) == status


def test_what_the_filter_expects_is_the_same_by_status_and_in_process():
    rig = Rig()
    output = rig.run(0.005)[-1][1]
    assert rig.controller.expected(output) is None
    assert expected_of(rig.status(output)) is None
    output = rig.run(0.5)[-1][1]
    here, there = rig.controller.expected(output), expected_of(rig.status(output))
    assert here is not None
    assert there is not None
    np.testing.assert_allclose(here.p_bc_in_c, (2.5, 0.0, 0.0), atol=1e-2)
    for name in ("t", "p_bc_in_c", "u_bf_in_c", "sigma_p", "sigma_theta", "time_offset"):
        np.testing.assert_array_equal(getattr(here, name), getattr(there, name))
    np.testing.assert_allclose(here.R_cb, there.R_cb, atol=1e-12)


@pytest.mark.parametrize("rate_hz", [50, 25, 18])
def test_control_that_runs_slowly_ends_a_flight_with_its_own_words(rate_hz: int):
    rig = Rig()
    rig.track()
    start = 100.0 + 0.005 * rig.k
    states = [(t, output.failsafe) for t, output in rig.at_rate(rate_hz, 1.0)]
    t, state = next((t, state) for t, state in states if state.mode != Mode.TRACK)
    assert t - start < OVER_S + 1.0 / rate_hz + 0.001
    assert state.mode == Mode.RAMP
    assert state.reason.startswith("Control runs slowly: ")


@pytest.mark.parametrize("rate_hz", [200, 50, 25, 18])
def test_the_ramps_thrust_falls_with_the_measured_time(rate_hz: int):
    rig = Rig()
    rig.track()
    entered, shares = None, []
    for t, output in rig.at_rate(rate_hz, ROBOT.ramp_s, [RequestInput("disarm")]):
        state = output.failsafe
        if state.mode == Mode.RAMP:
            entered = t if entered is None else entered
            shares.append((t - entered, 1e-3 * state.mode_ms))
    assert len(shares) > 0.9 * rate_hz * ROBOT.ramp_s
    assert all(abs(told - true) <= 0.001 for true, told in shares)
