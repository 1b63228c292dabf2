"""A battery by what the robot tells of it: level, words, refusal; unknown is never said as fine."""

from __future__ import annotations

import pytest

from hardware.follower import EStop, RobotHealth
from hardware.robot_file import BatteryParameters
from server.control.robot_health import (
    PRESSED,
    RECOVERED,
    SAG_S,
    STALE_S,
    UNKNOWN_STOP,
    BatteryLevel,
    HealthWatch,
    RobotCondition,
)

LIMITS = BatteryParameters(low_v=10.5, empty_v=9.9)
EVERY_S, TICK_S = 0.2, 0.005


class Robot:
    """Tells its voltage five times a second, while it has one to tell; control asks each tick."""

    def __init__(self, limits: BatteryParameters | None = LIMITS) -> None:
        self.watch, self.t = HealthWatch(limits), 0.0
        self.told: tuple[RobotHealth, float] | None = None

    def tells(
        self, volts: float | None, seconds: float, e_stop: EStop = EStop.NOT_WIRED
    ) -> RobotCondition:
        for _ in range(round(seconds / EVERY_S)):
            self.told = RobotHealth(volts, e_stop), self.t
            condition = self.silent(EVERY_S)
        return condition

    def silent(self, seconds: float) -> RobotCondition:
        for _ in range(round(seconds / TICK_S)):
            self.t += TICK_S
            condition = self.watch.hear(self.told, self.t)
        return condition


def test_of_a_robot_that_tells_nothing_and_whose_file_says_nothing_nothing_is_said():
    condition = Robot(limits=None).silent(10.0)
    assert condition == RobotCondition("untold", None)
    assert (condition.refusals, condition.fields(flies=True).words) == ((), [])


def test_a_voltage_without_limits_is_told_and_not_called_good():
    condition = Robot(limits=None).tells(3.0, 2.0)
    assert (condition.battery, condition.battery_v) == ("told", 3.0)
    assert (condition.refusals, condition.fields(flies=True).words) == ((), [])


LEVELS: list[tuple[float, BatteryLevel]] = [
    (12.6, "good"), (10.5, "good"), (10.49, "low"), (9.9, "low"), (9.89, "empty"), (0.0, "empty"),
]  # fmt: skip


@pytest.mark.parametrize(("volts", "level"), LEVELS)
def test_its_level_is_what_the_limits_say(volts: float, level: BatteryLevel):
    condition = Robot().tells(volts, 1.0)
    assert (condition.battery, condition.battery_v) == (level, pytest.approx(volts))
    assert bool(condition.refusals) == (level == "empty")


def test_words_give_the_voltage_and_what_to_do_in_flight_and_on_the_ground():
    low, empty = Robot().tells(10.2, 1.0), Robot().tells(9.7, 1.0)
    assert low.fields(flies=True).words == [
        "The robot's battery is low (10.2 V): bring it to rest soon."
    ]
    assert low.fields(flies=False).words == ["The robot's battery is low (10.2 V): charge it soon."]
    assert empty.fields(flies=True).words == [
        "The robot's battery is empty (9.7 V): bring it to rest now."
    ]
    assert empty.fields(flies=False).words == list(empty.refusals)
    assert empty.refusals == ("The robot's battery is empty (9.7 V): charge it before arming.",)


def test_a_voltage_that_sags_for_a_moment_is_not_empty_and_one_that_stays_down_is_soon():
    robot = Robot()
    robot.tells(11.4, 5.0)
    assert robot.tells(8.5, 1.0).battery != "empty"
    robot.tells(11.4, 5.0)
    assert robot.tells(8.5, 2.0 * SAG_S).battery == "empty"


def test_an_emptied_battery_that_recovers_at_rest_is_not_good_again_before_it_is_charged():
    robot = Robot()
    robot.tells(9.8, 1.0)
    assert robot.tells(10.5, 60.0).refusals
    assert robot.tells(10.5 * RECOVERED - 0.01, 60.0).battery == "empty"
    assert robot.tells(10.5 * RECOVERED + 0.01, 60.0).battery == "good"
    robot.tells(10.3, 10.0)
    assert robot.tells(10.5 * RECOVERED - 0.01, 60.0).battery == "low"


def test_what_is_told_no_more_is_unknown_and_not_what_it_was():
    robot = Robot()
    robot.tells(12.0, 1.0)
    assert robot.silent(STALE_S - EVERY_S - TICK_S).battery == "good"
    condition = robot.silent(3.0 * TICK_S)
    assert condition.battery == "unknown"
    assert condition.refusals == ()
    fields = condition.fields(flies=True)
    assert fields.battery_v is None
    assert fields.words == ["The robot does not tell how its battery is."]
    assert robot.tells(12.0, EVERY_S).battery == "good"


def test_a_robot_that_says_that_it_knows_no_more_is_unknown_too():
    robot = Robot(limits=None)
    robot.tells(12.0, 1.0)
    assert robot.tells(None, STALE_S).battery == "unknown"


def test_one_that_was_empty_stays_so_while_nobody_knows():
    robot = Robot()
    robot.tells(9.7, 1.0)
    condition = robot.silent(60.0)
    assert condition.battery == "unknown"
    said = "The robot's battery was empty when last told of (9.7 V): charge it before arming."
    assert (condition.refusals, condition.fields(flies=False).words) == ((said,), [said])


def test_a_robot_whose_file_has_limits_and_that_tells_nothing_is_said_so_soon():
    robot = Robot()
    assert robot.silent(STALE_S - 2.0 * TICK_S).battery == "untold"
    assert robot.silent(4.0 * TICK_S).battery == "unknown"


def test_a_robot_that_has_restarted_is_judged_anew():
    robot = Robot()
    robot.tells(9.7, 1.0)
    robot.told = None
    assert not robot.silent(TICK_S).refusals
    assert robot.tells(12.0, EVERY_S).battery == "good"


def test_an_emergency_stop_is_told_refuses_while_pressed_and_is_unknown_when_told_no_more():
    robot = Robot(limits=None)
    released = robot.tells(None, 1.0, EStop.CLOSED)
    assert (released.e_stop, released.refusals) == ("released", ())
    assert released.fields(flies=True).words == []
    pressed = robot.tells(None, EVERY_S, EStop.OPEN)
    assert (pressed.e_stop, pressed.refusals) == ("pressed", (PRESSED,))
    assert pressed.fields(flies=False).words == [PRESSED]
    unknown = robot.silent(STALE_S + TICK_S)
    assert (unknown.e_stop, unknown.refusals) == ("unknown", ())
    assert unknown.fields(flies=False).words == [UNKNOWN_STOP]


def test_the_emergency_stop_is_said_before_the_battery():
    condition = Robot().tells(9.7, 1.0, EStop.OPEN)
    assert condition.fields(flies=False).words == list(condition.refusals)
    assert [PRESSED in words for words in condition.refusals] == [True, False]


def test_a_robot_that_has_restarted_has_told_nothing_of_its_emergency_stop():
    robot = Robot(limits=None)
    robot.tells(None, 1.0, EStop.CLOSED)
    robot.told = None
    assert robot.silent(STALE_S + 1.0).e_stop == "untold"
