"""Which bodies a robot may be: one grid that is assumed, else corners of intervals and a floor."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from hardware.dynamics import dynamics_of, restoring_in_f, uncertainty_of
from pipeline.config import TeleopConfig
from pipeline.control.margins import AxisMargins, Loop, Sensing, alike
from pipeline.control.robust_margins import bodies, worst_margins
from pipeline.control.uncertainty import ASSUMED, LAG_SINCE, MASS_SINCE
from tests.hardware.identified_robots import identified

LATE = Sensing("relative", latency=0.09)


def loop(name: str, share: float | None) -> Loop:
    """Of a robot as it comes (None), or identified within ± `share`."""
    robot_file, config = identified(name, share or 0.0), TeleopConfig()
    dynamics = dynamics_of(robot_file.robot, robot_file.plant)
    if share is None:
        dynamics = replace(dynamics, uncertainty=ASSUMED)
    gains = robot_file.gains["phone"]
    return Loop(dynamics, gains, config.margins, config.no_filter, config.feedforward)


def no_less(one: AxisMargins, other: AxisMargins) -> bool:
    return (
        one.phase >= other.phase
        and one.gain >= other.gain
        and one.delay >= other.delay
        and one.peak <= other.peak
    )


def test_of_what_nobody_identified_the_grid_is_assumed() -> None:
    told = loop("ames", None)
    found = [one.dynamics for one in bodies(told)]
    masses = np.array([one.inertia / told.dynamics.inertia for one in found])
    np.testing.assert_allclose(masses, masses[:, :1] * np.ones(6))
    lags = [one.lag / told.dynamics.lag for one in found]
    pairs = set(zip(masses[:, 0].round(9).tolist(), np.round(lags, 9).tolist(), strict=True))
    assert pairs == {(mass, lag) for mass in (0.7, 1.0, 1.3) for lag in (0.7, 1.0, 1.5)}
    assert {one.delay for one in found} == {told.dynamics.delay}
    assert all((one.stiffness == told.dynamics.stiffness).all() for one in found)
    assert all((one.damping == told.dynamics.damping).all() for one in found)


@pytest.mark.parametrize("name", ["ames", "quadrotor", "ground"])
def test_narrow_intervals_leave_more_than_what_is_assumed_and_wide_ones_less(name: str) -> None:
    robot = identified(name, 0.0).robot
    for axis in np.flatnonzero(robot.axes | robot.wrench_axes).tolist():
        assumed, narrow, wide = (
            worst_margins(loop(name, share), axis, LATE) for share in (None, 0.05, 0.29)
        )
        assert no_less(narrow, assumed)
        assert no_less(assumed, wide)
        assert narrow != assumed != wide


def test_an_interval_of_nothing_leaves_what_may_have_become_of_the_robot_since() -> None:
    told = loop("ames", 0.0)
    found = [one.dynamics for one in bodies(told)]
    masses = sorted({float(one.inertia[0] / told.dynamics.inertia[0]) for one in found})
    assert masses == pytest.approx([0.85, 1.0, 1.15])
    lags = [one.lag / told.dynamics.lag for one in found]
    assert (min(lags), max(lags)) == pytest.approx((0.8, 1.25))


def test_every_corner_of_the_intervals_is_a_body() -> None:
    told, share = loop("ames", 0.1), 0.1
    found = [one.dynamics for one in bodies(told)]
    d = told.dynamics
    for mass, lag, delay, stiffness in np.ndindex(2, 2, 2, 2):
        factor = (MASS_SINCE.least, MASS_SINCE.most)[mass] * (1.0 + share * (2 * mass - 1))
        slow = (LAG_SINCE.least, LAG_SINCE.most)[lag] * (1.0 + share * (2 * lag - 1))
        late, stiff = 1.0 + share * (2 * delay - 1), 1.0 + share * (2 * stiffness - 1)
        corner = [
            one
            for one in found
            if np.allclose(one.inertia, factor * d.inertia)
            and np.isclose(one.lag, slow * d.lag)
            and np.isclose(one.delay, late * d.delay)
            and np.isclose(one.stiffness[2], stiff * d.stiffness[2])
        ]
        assert len(corner) == 2  # felt rightly or not
        assert all((one.damping < d.damping).all() for one in corner)


def test_one_that_tilts_has_moments_out_of_step_with_its_mass_by_their_intervals_alone() -> None:
    told, share = loop("quadrotor", 0.1), 0.1
    ratios = {
        round(float(one.dynamics.inertia[3] / one.dynamics.inertia[0]), 9) for one in bodies(told)
    }
    nominal = told.dynamics.inertia[3] / told.dynamics.inertia[0]
    apart = (1.0 + share) / (1.0 - share)
    assert sorted(ratios) == pytest.approx([nominal / apart, nominal, nominal * apart])


def test_less_damping_is_the_worse() -> None:
    told = loop("ames", 0.29)
    doubt = told.dynamics.uncertainty
    more = replace(doubt, damping=tuple(-one for one in doubt.damping))
    damped = replace(told, dynamics=replace(told.dynamics, uncertainty=more))
    for axis in range(6):
        assert no_less(worst_margins(damped, axis, LATE), worst_margins(told, axis, LATE))


def test_lag_and_delay_are_believed_together_only() -> None:
    plant = identified("ames", 0.1).plant
    for lacking in ("lag", "delay"):
        halved = replace(plant, intervals=replace(plant.intervals, **{lacking: None}))
        doubt = uncertainty_of(halved)
        assert (doubt.lag, doubt.delay) == (ASSUMED.lag, 0.0)
        assert doubt.of_thrusters == "lag × 0.7-1.5 (assumed)"


def test_what_the_suspension_may_be_is_by_its_own_numbers() -> None:
    robot_file, share = identified("ames", 0.1), 0.1
    plant, cable = robot_file.plant, robot_file.plant.suspension
    assert cable is not None
    doubt, told = uncertainty_of(plant), dynamics_of(robot_file.robot, plant)
    stiffer = replace(
        plant,
        suspension=replace(
            cable,
            stiffness=(1.0 + share) * cable.stiffness,
            hook_above_com=(1.0 + share) * cable.hook_above_com,
        ),
    )
    found = dynamics_of(robot_file.robot, stiffer).stiffness - told.stiffness
    assert doubt.stiffness[2:] == pytest.approx(found[2:].tolist())
    assert doubt.stiffness[:2] == pytest.approx((share * told.stiffness[:2]).tolist())
    _, damping = restoring_in_f(plant)
    assert doubt.damping[:3] == pytest.approx((share * damping).tolist())


def test_axes_whose_intervals_differ_are_not_alike() -> None:
    told = loop("ames", 0.1)
    assert alike(told, 3) == alike(told, 4)
    doubt = told.dynamics.uncertainty
    roll, pitch, yaw = doubt.moments
    wider = replace(doubt, moments=(roll, replace(pitch, interval=0.2), yaw))
    other = replace(told, dynamics=replace(told.dynamics, uncertainty=wider))
    assert alike(other, 3) != alike(other, 4)


def test_what_is_identified_and_what_is_assumed_is_said() -> None:
    assert ASSUMED.words == "mass ± 30 %, lag × 0.7-1.5"
    assert uncertainty_of(identified("ground", 0.1).plant).words == (
        "mass × 0.77-1.26 (identified ± 10 %), lag × 0.72-1.38 (identified ± 10 %), delay ± 1 ms"
    )
    plant = identified("ames", 0.1).plant
    only = replace(plant.intervals, inertia=(0.004, None, None), length=None, stiffness=None)
    doubt = uncertainty_of(replace(plant, intervals=replace(only, hook_above_com=None, lag=None)))
    assert doubt.words == (
        "mass × 0.77-1.26 (identified ± 10 %), moments ± 30 % (assumed), lag × 0.7-1.5 (assumed)"
    )
