"""Flights are what follows without a gap while the robot flew, with all commands in it."""

from __future__ import annotations

import numpy as np
import pytest

from pipeline.signals import Mode
from server.tools.identify.recorded_flights import flights_of
from tests.server.house import control_status

STILL = (1.0, 0.0, 0.0, 0.0)


def statuses(count, t_begin=10.0, every=0.02, commands=True, **changes):
    """One after the other, as control sends them: four ticks each."""
    for k in range(count):
        ticks = t_begin + every * k + 0.005 * np.arange(4)
        yield control_status(
            t=float(ticks[-1]),
            **{
                "mode": int(Mode.TRACK),
                "R_cb_wxyz": STILL,
                "R_fc_wxyz": STILL,
                "thrusts": [0.1 * k] * 8,
                "body_samples": [(float(t), 0.0, 0.0, 0.0, 0.0, 0.0, 9.81) for t in ticks - 0.001],
                "commands": [(float(t), *[0.1 * k] * 8) for t in ticks] if commands else [],
                **changes,
            },
        )


def test_a_flight_has_each_command_and_each_sample():
    (flight,) = flights_of(statuses(100))
    assert len(flight.t_command) == len(flight.t_imu) == 400
    assert flight.commands[-1] == pytest.approx(np.full(8, 9.9))
    assert flight.seconds == pytest.approx(1.98, abs=0.03)


def test_older_recordings_have_a_command_for_each_status():
    (flight,) = flights_of(statuses(100, commands=False))
    assert len(flight.t_command) == 100
    assert flight.commands[7] == pytest.approx(np.full(8, 0.7))


def test_on_the_ground_and_without_an_attitude_nothing_is_a_flight():
    assert not list(flights_of(statuses(100, mode=int(Mode.ARMED))))
    assert not list(flights_of(statuses(100, mode=int(Mode.RAMP))))
    assert not list(flights_of(statuses(100, R_cb_wxyz=None)))


@pytest.mark.parametrize("between", [[], list(statuses(3, 12.0, mode=int(Mode.DISARMED)))])
def test_a_gap_parts_two_flights(between):
    states = [*statuses(100), *between, *statuses(80, 12.5)]
    first, second = flights_of(states)
    assert (len(first.t_attitude), len(second.t_attitude)) == (100, 80)


def test_samples_that_are_missing_part_them_too():
    states = list(statuses(200))
    states[100:105] = [control_status(**_without_samples(state)) for state in states[100:105]]
    assert [len(flight.t_attitude) for flight in flights_of(states)] == [100, 95]


def _without_samples(state):
    names = ("t", "mode", "R_cb_wxyz", "R_fc_wxyz", "thrusts", "commands")
    return {name: getattr(state, name) for name in names} | {"body_samples": []}


def test_what_is_too_short_is_not_looked_at():
    assert not list(flights_of(statuses(40)))


def test_a_robot_with_other_thrusters_is_another_flight():
    quadrotor = statuses(80, 12.0, thrusts=[0.5] * 4, commands=False)
    eight, four = flights_of([*statuses(100), *quadrotor])
    assert (eight.commands.shape[1], four.commands.shape[1]) == (8, 4)
