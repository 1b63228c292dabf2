"""The hazard table: what may go wrong, who notices, what happens, by when, and what shows it.

`python -m server.experiments.faults.hazards > docs/hazards.md` writes it; a test compares.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Final

from server.experiments.faults.catalogue import FAULTS
from server.experiments.faults.fault import Event, Fault

HEAD: Final = """\
# Hazards

What may go wrong, who notices, what happens and by when.
Written by `python -m server.experiments.faults.hazards`; do not edit.

*Faults* are flown by `lightleash experiments faults` in virtual time, with the bounds in brackets,
in seconds after the fault: COAST, HOLD, RAMP and STOPPED are modes of control, *robot* is what the
robot does by itself, *zero* is no thrust. Every fault that ends a flight is asked for no sample
with thrust after zero; every one for no more than 150 mm beyond where the flight led, and 30° of
tilt.

| # | hazard | noticed by | what happens | faults and tests |
|---|---|---|---|---|
"""
EVENTS: Final[tuple[Event, ...]] = ("COAST", "HOLD", "RAMP", "STOPPED", "TRACK", "robot", "zero")


@dataclass(frozen=True, slots=True)
class Hazard:
    """A row; its faults are those of the catalogue with its number."""

    number: str
    what: str
    noticed_by: str
    then: str
    tests: tuple[str, ...] = ()
    """Beside faults: file::name, from `tests/`."""


HAZARDS: Final = (
    Hazard(
        "1",
        "Pictures are lost",
        "their age; the estimate's own uncertainty",
        "both motion sensors bridge two seconds; HOLD; RAMP",
        ("scenarios/test_faults.py::test_leds_hidden_for_a_second_are_flown_through",),
    ),
    Hazard(
        "2",
        "Pictures come late or wrongly dated",
        "the time of capture in each picture; the filter's time offset",
        "fused at the moment they were taken; unbelievable: HOLD; too old: no arming",
        ("pipeline/control/test_latency_guard.py",),
    ),
    Hazard(
        "3",
        "The same picture again and again",
        "it is the one before to the last bit, though phone or robot turn",
        "looked at and fused once; for long: named on the pages, no arming, as 1",
        (
            "pipeline/vision/test_repeats_seen.py::"
            "test_frames_that_come_again_change_nothing_to_the_last_bit",
            "pipeline/vision/test_repeated_frames.py",
        ),
    ),
    Hazard(
        "4",
        "Picture mirrored, turned or cut",
        "size and angle with each picture; gravity; reprojection",
        "not believed; another size is looked up anew",
        (
            "server/phone/test_phone_session.py::"
            "test_pictures_of_a_size_nobody_calibrated_are_refused_until_the_size_is_right_again",
        ),
    ),
    Hazard(
        "5",
        "Another lens, zoom, stabilisation, a focus that breathes",
        "each picture against what both motion sensors predict; LEDs against both gyroscopes",
        "a little beside: believed less; far beside: not believed, named within 0.3 s, no arming, "
        "as 1, until it was right for 1.5 s of motion that would have shown it wrong; steadied: "
        "named within 2.6 s of tremor, however little beside; too little to notice: within bounds",
        (
            "pipeline/vision/test_picture_check.py::"
            "test_a_stabiliser_is_named_though_it_steadied_the_picture_from_the_beginning",
            "pipeline/vision/test_picture_check.py::"
            "test_a_lie_is_named_in_time_and_nothing_is_believed_from_then_on",
            "pipeline/vision/test_picture_check.py::test_where_nothing_moves_time_acquits_nobody",
            "server/phone/test_phone_session.py::test_a_camera_that_is_not_the_calibrated_one_keeps_the_robot_disarmed",
        ),
    ),
    Hazard(
        "6",
        "LEDs hidden",
        "how many are named",
        "fewer are used as they are; none: as 1",
        ("scenarios/test_faults.py::test_one_led_is_enough_to_fly_on_for_two_seconds",),
    ),
    Hazard(
        "7",
        "LEDs mixed up, lamps, reflections",
        "reprojection, gravity, each LED's innovation",
        "not believed; as 1",
        ("pipeline/vision/test_gating.py",),
    ),
    Hazard(
        "9",
        "The phone's motion sensors are silent, or say the same again and again",
        "their age; a gyroscope in a hand never says the same twice",
        "a repetition is no sample; COAST; RAMP after 1 s",
        ("pipeline/estimation/test_held_gyroscope.py",),
    ),
    Hazard(
        "10",
        "The phone's motion sensors lie",
        "gravity test at the start; in flight gravity that jumps; pictures against gyroscope",
        "no arming; in flight COAST, then HOLD, named, if gravity jumps, and if the phone falls; "
        "else the filter trusts them less, or HOLD",
        (
            "server/phone/test_sensor_check.py::test_the_sign_of_ios_is_refused_and_named",
            "pipeline/estimation/test_accelerometer_check.py",
        ),
    ),
    Hazard(
        "11",
        "The phone's compass jumps",
        "nobody needs to",
        "nothing: the browser's attitude is not used",
        ("server/phone/test_sensor_check.py::test_a_jump_of_the_magnetometer_moves_nothing",),
    ),
    Hazard(
        "12",
        "The phone's clock is wrong or jumps",
        "ours alone counts; a time in the future is refused",
        "COAST, until its offset is known again",
        (
            "server/phone/test_ingest.py::test_after_a_jump_of_the_clock_dates_are_right_within_a_second",
        ),
    ),
    Hazard(
        "15",
        "The finger leaves the button, a touch that is none",
        "the count of presses in each sign of life",
        "HOLD, also after a gap; RAMP after 3 s; only a new press follows again",
        (
            "pipeline/control/test_failsafe.py::"
            "test_a_finger_that_left_during_a_gap_holds_with_the_first_word",
            "server/phone/test_phone_session.py::test_a_hidden_page_holds_no_button",
        ),
    ),
    Hazard(
        "16",
        "The phone vanishes: battery, lock screen, call, browser killed",
        "the age of its sign of life, and of its motion samples",
        "COAST at once, RAMP after 1 s",
    ),
    Hazard(
        "17",
        "The page hangs while its connections live",
        "the sign of life is made by the page's main thread and echoes our number",
        "as 16; what comes late is too old",
    ),
    Hazard(
        "18",
        "A gap in the phone's link: roaming, scan, loss",
        "as 16",
        "COAST, and follows again by itself on the same press; as 16 after 1 s",
        (
            "server/experiments/test_gaps.py::test_it_flies_writes_and_draws",
            "scenarios/test_phone_returns.py::"
            "test_it_stays_in_a_gap_though_its_phone_was_away_before",
        ),
    ),
    Hazard(
        "19",
        "Two people, or an old page, lead",
        "one place, taken at hello",
        "the second is refused; who leads and leaves is told",
        (
            "server/web/test_websocket.py::"
            "test_a_second_operator_is_refused_while_the_first_lives_and_led_by_when_it_has_gone",
        ),
    ),
    Hazard(
        "20",
        "Forged, repeated or spoilt messages",
        "a keyed code, epoch, counter and a fresh number in each datagram; the phone's nonces",
        "refused; the flight goes on",
        (
            "hardware/link/test_robot_end.py::test_refuses_what_it_has_taken_before",
            "server/phone/test_ingest.py::test_invented_and_repeated_nonces_are_refused",
        ),
    ),
    Hazard(
        "21",
        "A foreign web page reaches the server",
        "origin, host, cookie",
        "refused",
        ("server/security/test_security.py::test_a_foreign_page_with_our_cookie_changes_nothing",),
    ),
    Hazard(
        "22",
        "The robot's motion sensors lie",
        "pictures against them; gravity that jumps",
        "COAST when the estimate doubts itself or gravity jumps, then HOLD; a lie that it bears is "
        "flown with",
        ("pipeline/estimation/test_accelerometer_check.py",),
    ),
    Hazard(
        "23",
        "The robot's link fails, in one direction or both",
        "the robot: 60 ms without a command taken; control: the age of samples",
        "the robot comes down by itself; control: COAST, RAMP after 1 s",
        ("scenarios/test_faults.py::test_a_lost_link_ramps_down_on_both_sides",),
    ),
    Hazard(
        "24",
        "The robot's computer restarts",
        "its boot number",
        "no thrust until a new control process began with zero; RAMP",
        ("server/control/test_robot_clock.py::test_a_robot_that_restarts_has_another_clock",),
    ),
    Hazard(
        "25",
        "Control dies, stands still, runs slowly",
        "the robot: silence; control: its own clock",
        "the robot comes down by itself; a fault of its own: RAMP",
        (
            "server/control/test_controller.py::"
            "test_control_that_runs_slowly_ends_a_flight_with_its_own_words",
            "e2e/test_serve.py::"
            "test_control_killed_in_flight_lets_the_robot_ramp_down_and_comes_back_disarmed",
        ),
    ),
    Hazard(
        "26",
        "The server dies or stands still",
        "control: as 16",
        "as 16 and 18",
        (
            "e2e/test_serve.py::"
            "test_the_server_killed_in_flight_leaves_control_to_ramp_down_and_comes_back_as_it_was",
        ),
    ),
    Hazard(
        "27",
        "Something is no number",
        "each boundary",
        "dropped: as if it had not come",
        (
            "server/control/test_controller.py::test_what_is_no_number_never_reaches_the_state_by_a_datagram",
        ),
    ),
    Hazard(
        "29",
        "A thruster is dead or weak",
        "what the body feels, against what its thrusters were told",
        "named on both pages, wrenches shared anew; arming is refused; who can't hover: RAMP, "
        "and no thrust once it leans by 60° in the air",
        ("pipeline/control/test_thruster_health.py::test_who_fails_is_named_soon_and_alone",),
    ),
    Hazard(
        "31",
        "Wind, a push, contact",
        "the error",
        "held against; beyond the limits RAMP",
        ("scenarios/test_faults.py::test_a_push_is_held_against",),
    ),
    Hazard(
        "33",
        "Tilt, error, rates beyond the envelope",
        "each tick",
        "RAMP",
        ("pipeline/test_teleop.py::test_a_robot_tilted_too_far_ends_the_flight",),
    ),
    Hazard(
        "35",
        "The robot's battery runs low or empty",
        "its voltage, as the robot tells it, against `[battery]` of its file",
        "low: told on both pages, felt, logged; empty: no arming, in flight told urgently, and no "
        "flight ended: where it comes to rest is for who leads; told no more: unknown, never good",
        (
            "server/control/test_robot_health.py::"
            "test_what_is_told_no_more_is_unknown_and_not_what_it_was",
            "server/control/test_controller.py::"
            "test_a_battery_that_runs_empty_in_flight_ends_no_flight_and_is_told_urgently",
            "e2e/test_robot_health.py::"
            "test_a_battery_drains_in_flight_is_told_everywhere_and_keeps_the_robot_from_the_next_one",
        ),
    ),
    Hazard(
        "35a",
        "The robot's tool opens or closes though nobody asks for it",
        "control, by the press; the robot, by orders that stay away",
        "orders count while the button is held, and for 100 ms; in every gap, ramp and stop it "
        "stays as it is, for what it grips must not fall",
        (
            "server/web/test_tool.py::test_what_was_asked_before_a_press_counts_for_nothing",
            "hardware/link/test_tool.py::test_it_stays_in_a_silence_though_orders_go_on",
            "hardware/link/test_tool.py::test_it_stays_when_the_robot_stops",
        ),
    ),
    Hazard(
        "36",
        "The disk is full or slow",
        "the recorder",
        "old recordings go if they may; else it ends and says so; the flight does not notice",
        (
            "server/recording/test_recording.py::test_a_full_disk_ends_the_recording_and_says_so",
            "server/recording/test_folder.py::test_with_a_budget_the_oldest_go_for_the_reserve_too",
        ),
    ),
    Hazard(
        "38",
        "STOP, or disarming, while anything else goes on",
        "control, in the same tick",
        "no thrust at once, in every mode; disarming ramps",
        (
            "server/control/test_controller.py::test_a_stop_wins_over_every_other_wish_of_the_same_tick",
        ),
    ),
    Hazard(
        "38a",
        "The emergency stop on the robot is pressed, or its wire breaks",
        "the robot, by its wire, before each set-point",
        "no thrust at once by the robot's own end, whoever says what; RAMP, named on both pages; "
        "no arming while it is pressed; released, nothing begins: it must be armed anew",
        (
            "hardware/link/test_robot_end_search.py::"
            "test_every_state_is_reached_by_the_documented_edges_and_no_others",
            "e2e/test_e_stop_process.py::"
            "test_pressed_in_flight_it_stops_and_released_it_needs_another_handshake",
            "e2e/test_robot_health.py::"
            "test_an_emergency_stop_pressed_in_flight_stops_it_is_named_and_must_be_released_and_armed",
        ),
    ),
    Hazard(
        "39",
        "Surprises at the start: a held button, wishes in flight",
        "edges",
        "nothing begins",
        (
            "pipeline/control/test_failsafe.py::test_a_button_held_since_before_arming_starts_nothing",
        ),
    ),
)


def document() -> str:
    """The table as markdown."""
    return HEAD + "\n".join(_rows()) + "\n"


def _rows() -> Iterator[str]:
    for hazard in HAZARDS:
        faults = [_described(fault) for fault in FAULTS if fault.hazard == hazard.number]
        shown = "; ".join([*faults, *(f"`tests/{test}`" for test in hazard.tests)])
        cells = hazard.number, hazard.what, hazard.noticed_by, hazard.then, shown
        yield f"| {' | '.join(cells)} |"


def _described(fault: Fault) -> str:
    times = [f"{event} {fault.by[event]:g}" for event in EVENTS if event in fault.by]
    if fault.end == "flies":
        times.append("follows")
    return f"{fault.name} ({', '.join(times)})" if times else fault.name


if __name__ == "__main__":
    print(document(), end="")
