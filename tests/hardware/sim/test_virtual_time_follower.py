"""The simulated robot in virtual time keeps the contract, and does the same each time."""

import numpy as np
import pytest

from hardware.contract import FollowerContract, exchange
from hardware.follower import FollowerState, ThrustCommand
from hardware.robot_file import load_robot
from hardware.sim.virtual_time_follower import VirtualTimeFollower
from tests.hardware.rigs import LockstepRig

AMES = load_robot("ames")


class TestContract(FollowerContract):
    @pytest.fixture
    def rig(self):
        return LockstepRig(AMES)


def flight(seed):
    follower = VirtualTimeFollower(AMES, seed)
    rows = []
    for k in range(400):
        thrust = 0.0 if k < 120 else 0.5 + 0.4 * np.sin(0.1 * k)
        samples = exchange(follower, ThrustCommand(np.full(8, thrust), armed=thrust > 0.0))
        rows += [np.concatenate((s.omega_in_b, s.a_in_b, s.thrusts)) for s in samples]
        follower.advance()
    return np.array(rows), follower


def test_flights_of_a_seed_are_equal_and_of_another_are_not():
    (first, _), (again, _), (other, _) = flight(1), flight(1), flight(2)
    np.testing.assert_array_equal(first, again)
    assert not np.array_equal(first, other)


def test_time_passes_only_when_advanced():
    follower = VirtualTimeFollower(AMES)
    for _ in range(10):
        exchange(follower, ThrustCommand.zero(8))
    assert follower.t == follower.plant.t == 0.0
    follower.advance(0.1)
    assert follower.t == pytest.approx(0.1)
    assert follower.plant.t == pytest.approx(0.1)


def test_one_sample_per_tick_with_equal_clocks_and_a_round_trip_of_a_tick():
    follower = VirtualTimeFollower(AMES)
    follower.send(ThrustCommand.zero(8))
    for _ in range(150):
        follower.advance()
        (sample,) = exchange(follower, ThrustCommand.zero(8))
        assert sample.t_us == round(1e6 * follower.t)
    assert sample.round_trip_s == pytest.approx(0.005)


def test_a_new_epoch_begins_by_itself_only_when_nothing_is_meant():
    _, follower = flight(1)
    assert follower.epoch == 1
    follower.advance(3.0)
    for armed in (True, False):
        for _ in range(20):
            exchange(follower, ThrustCommand(np.zeros(8), armed))
            follower.advance()
        assert follower.epoch == (1 if armed else 2)


def test_a_link_that_comes_back_during_the_ramp_does_not_stop_it():
    _, follower = flight(1)
    follower.connected = False
    follower.advance(0.5)
    follower.connected = True
    exchange(follower, ThrustCommand(np.full(8, 0.9), armed=True))
    states, largest = [], []
    for _ in range(500):
        for sample in exchange(follower, ThrustCommand(np.full(8, 0.9), armed=True)):
            states.append(sample.state)
            largest.append(sample.thrusts.max())
        follower.advance()
    assert states[0] == FollowerState.RAMP
    assert states[-1] == FollowerState.REFUSING
    assert (np.diff(largest) < 1e-6).all()
