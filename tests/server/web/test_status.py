"""Status: the truth about the robot in words, and nothing that is not known."""

from __future__ import annotations

from math import cos, inf, nan, radians, sin
from types import SimpleNamespace

import msgspec
import pytest

from hardware.robot_file import COMMANDS, load_robot
from pipeline.control.failsafe import ROBOT_LOST
from pipeline.signals import Mode
from pipeline.vision.robot_identity import TWO
from server.common.clock import now
from server.common.runtime_parameters import RuntimeParameters
from server.control.gap_log import MANY, SIDES, GapStatistics
from server.control.robot_health import HealthFields
from server.diagnostics.blame import TOO_BUSY
from server.diagnostics.meter import Meter
from server.protocol.messages import encode_message
from server.web import status
from server.web.status import LOST_S
from tests.server.house import control_status, estimate_fields, house_in


@pytest.fixture
def manager(tmp_path):
    with house_in(tmp_path) as house:
        yield house.manager


def tell(manager, **changes):
    manager.status = control_status(**changes)
    manager.control_meter.tick(manager.status.t, manager.status.t)


def test_before_control_has_spoken_it_is_lost_and_nothing_is_ready(manager):
    shown = status.build(manager)
    assert (shown.mode, shown.ready) == ("LOST", False)
    assert "watchdog" in shown.reason
    assert shown.refusals == ["The control process is starting: some seconds."]
    assert shown.position_mm is None


def test_control_that_falls_silent_is_lost_whatever_it_said_last(manager):
    said = {"mode": 2, "reason": "Following the phone.", "refusals": [], "twist_in_b": (0.3,) * 6}
    tell(manager, t=now() - LOST_S - 0.05, **said)
    shown = status.build(manager)
    assert (shown.mode, shown.ready) == ("LOST", False)
    assert (shown.told_mm_s, shown.told_deg_s) == (None, None)
    assert "Following" not in shown.reason


@pytest.mark.parametrize(
    ("health", "silent_s", "battery"),
    [
        (None, 0.0, ("untold", None)),
        (None, LOST_S + 0.05, ("untold", None)),
        (HealthFields("good", 11.0), 0.0, ("good", 11.0)),
        (HealthFields("good", 11.0), LOST_S + 0.05, ("unknown", None)),
    ],
)
def test_while_control_is_silent_a_battery_is_not_known_any_more(
    manager, health, silent_s, battery
):
    tell(manager, t=now() - silent_s, health=health)
    shown = status.build(manager)
    assert (shown.battery, shown.battery_v) == battery


@pytest.mark.parametrize(
    ("e_stop", "silent_s", "shown"),
    [
        ("untold", LOST_S + 0.05, "untold"),
        ("pressed", 0.0, "pressed"),
        ("released", LOST_S + 0.05, "unknown"),
    ],
)
def test_while_control_is_silent_an_emergency_stop_is_not_known_any_more(
    manager, e_stop, silent_s, shown
):
    tell(manager, t=now() - silent_s, health=HealthFields(e_stop=e_stop))
    assert status.build(manager).e_stop == shown


def test_what_control_says_is_shown_in_the_units_of_screens(manager):
    tell(
        manager,
        mode=2,
        reason="Following the phone.",
        refusals=[],
        p_bc_in_c=(2.5, -0.1234, 0.0),
        error_m=0.01234,
        error_rad=radians(2.0),
        sigma_p=0.002,
        saturated=True,
    )
    shown = status.build(manager)
    assert (shown.mode, shown.reason, shown.ready) == ("TRACK", "Following the phone.", True)
    assert shown.position_mm == [2500.0, -123.4, 0.0]
    assert (shown.error_mm, shown.error_deg, shown.sigma_mm) == (12.3, 2.0, 2.0)
    assert shown.saturated
    assert shown.realtime == "SCHED_FIFO 50"
    assert shown.control["missed"] == 3.0
    assert shown.control["p99_ms"] == 0.2
    assert shown.streams["body_imu"].rate_hz == 200.0


@pytest.mark.parametrize(
    ("reason", "seen", "shown"),
    [
        (ROBOT_LOST, TWO, f"{ROBOT_LOST} {TWO}"),
        (ROBOT_LOST, "", ROBOT_LOST),
        ("Following the phone.", TWO, "Following the phone."),
    ],
)
def test_why_the_camera_has_lost_the_robot_is_told(manager, monkeypatch, reason, seen, shown):
    eyes = SimpleNamespace(reason=seen)
    phone = SimpleNamespace(detection=eyes, meters={"video": Meter()}, device="a phone")
    monkeypatch.setattr(manager, "phone", phone)
    assert status._reason(manager, control_status(mode=Mode.HOLD, reason=reason), now()) == shown


def test_a_busy_computer_is_told_in_the_reason_in_what_refuses_and_in_warnings(manager):
    said, waits = "No word from the phone.", "Let go of the button before arming."
    gaps = {side: GapStatistics(MANY * (side == "server"), 0.3) for side in SIDES}
    tell(manager, mode=Mode.RAMP, reason=said, refusals=[said, waits], gaps=gaps)
    manager.load.is_busy, manager.load.advice = True, "Close chromium."
    manager.blame.stalled(now(), 0.5)
    shown = status.build(manager)
    assert shown.reason == f"{TOO_BUSY} Close chromium."
    assert shown.refusals == ["The server's computer is too busy. Close chromium.", waits]
    (warning,) = shown.warnings
    assert "Close chromium." in warning
    manager.load.is_busy = False
    assert status.build(manager).refusals == [said, waits]


def test_a_robot_that_takes_a_twist_has_its_speeds_told(manager):
    tell(manager)
    assert (status.build(manager).takes, status.build(manager).told_mm_s) == ("thrusts", None)
    manager.robot = load_robot("twister", takes=COMMANDS).robot
    tell(manager, thrusts=[], twist_in_b=(0.03, 0.0, -0.04, 0.0, radians(12.0), 0.0))
    shown = status.build(manager)
    assert (shown.takes, shown.told_mm_s, shown.told_deg_s) == ("twist", 50.0, 12.0)


def test_why_arming_is_refused_is_told(manager):
    tell(manager, refusals=["Let go of the button before arming."])
    shown = status.build(manager)
    assert not shown.ready
    assert shown.refusals == ["Let go of the button before arming."]


@pytest.mark.parametrize("bad", [nan, inf])
def test_it_is_json_even_if_a_number_is_none(manager, bad):
    tell(manager, error_m=bad, body_imu_age=inf, sigma_p=bad)
    decoded = msgspec.json.decode(encode_message(status.build(manager)))
    assert decoded["error_mm"] is None
    assert decoded["streams"]["body_imu"]["age_ms"] is None


def test_the_knobs_are_shown_as_control_has_them_with_the_lag_they_cause(manager):
    knobs = RuntimeParameters(0.28, "selective", 0.0, 1.0, guard=True)
    turn = (cos(radians(5.0)), 0.0, 0.0, -sin(radians(5.0)))
    tell(manager, knobs=knobs, guarding=0.456, R_fc_wxyz=(-1.0, 0.0, 0.0, 0.0), R_fv_wxyz=turn)
    shown = status.build(manager).virtual_camera
    assert (shown.knobs, shown.lag_deg, shown.guarding) == (knobs, 10.0, 0.46)


def test_before_control_has_told_of_its_knobs_none_are_shown(manager):
    assert status.build(manager).virtual_camera is None
    tell(manager)
    assert status.build(manager).virtual_camera is None
    tell(manager, knobs=RuntimeParameters(0.28, "full", 0.0, 1.0, guard=True))
    assert status.build(manager).virtual_camera.lag_deg is None


def test_what_the_estimator_says_of_itself_is_shown_in_the_units_of_screens(manager):
    turning = (radians(0.5), 0.0, radians(-1.0))
    tell(
        manager,
        estimate=estimate_fields(complaint="Restart the camera.", bias_omega_b=turning),
        poses_fused=90,
        poses_dropped=4,
        time_offset=-0.0123,
        sigma_theta=radians(0.25),
    )
    shown = status.build(manager).estimate
    assert (shown.name, shown.complaint, shown.nis) == ("relative", "Restart the camera.", 1.25)
    assert (shown.fused, shown.dropped, shown.late, shown.leds_rejected) == (90, 4, 3, 7)
    assert (shown.age_ms, shown.time_offset_ms, shown.time_offset_sigma_ms) == (87.1, -12.3, 0.4)
    assert shown.sigma_deg == 0.25
    assert shown.bias_body_deg_s == [0.5, 0.0, -1.0]
    assert shown.bias_phone_m_s2 == [0.1, 0.0, -0.2]


def test_what_an_estimator_does_not_know_is_null(manager):
    unknown = dict.fromkeys(("nis", "age", "time_offset_sigma", "bias_a_b", "bias_omega_c"))
    tell(
        manager, estimate=estimate_fields(name="none", **unknown), sigma_theta=inf, time_offset=None
    )
    told = msgspec.json.decode(encode_message(status.build(manager)))["estimate"]
    names = ("nis", "age_ms", "time_offset_ms", "time_offset_sigma_ms", "sigma_deg")
    assert all(told[name] is None for name in (*names, "bias_body_m_s2", "bias_phone_deg_s"))
    assert told["bias_body_deg_s"] is not None


def test_before_control_has_told_of_its_estimator_nothing_is_shown(manager):
    tell(manager)
    assert status.build(manager).estimate is None
