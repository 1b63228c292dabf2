"""A thruster fails in flight: who is told, what still flies, and who may arm again."""

from __future__ import annotations

import numpy as np
import pytest

from hardware.robot_file import load_robot
from pipeline.config import TeleopConfig
from pipeline.signals import Mode
from pipeline.teleop import Output
from server.control.process import teleop_config
from server.simulation.virtual_time import SimulationOptions, VirtualTimeSimulation

pytestmark = pytest.mark.slow
RAYS = SimulationOptions(hand="moving", seed=1001, led_noise_px=0.02)
"""No picture is looked at: LEDs' rays come with this noise."""


def flying(name: str, seconds: float) -> VirtualTimeSimulation:
    robot_file = load_robot(name)
    config = teleop_config(robot_file, "phone", TeleopConfig().virtual_camera, "relative")
    loop = VirtualTimeSimulation(robot_file, config, RAYS)
    loop.run(seconds)
    assert not loop.trace.left
    return loop


def until(loop: VirtualTimeSimulation, mode: Mode, seconds: float) -> Output:
    end = loop.t + seconds
    while (output := loop.advance()).failsafe.mode != mode:
        assert loop.t < end, f"never {mode.name}"
    return output


def test_after_a_dead_thruster_arming_is_refused_until_somebody_resets() -> None:
    loop = flying("ames", 6.0)
    loop.follower.plant.thruster_health[1] = 0.0
    end = loop.t + 1.0
    while loop.t < end:
        output = loop.advance()
    assert output.failsafe.mode == Mode.TRACK
    assert output.thrusters == ("Thruster 2 gives no thrust.",)
    loop._script.operator.leaving = True
    loop.request("disarm")
    output = until(loop, Mode.DISARMED, 5.0)
    refusal = "Thruster 2 gives no thrust. Mend it, then press STOP and Reset."
    assert refusal in output.refusals
    loop.follower.plant.thruster_health[1] = 1.0
    loop.request("stop")
    assert refusal in until(loop, Mode.STOPPED, 0.1).refusals
    loop.request("reset")
    until(loop, Mode.DISARMED, 0.1)
    output = loop.advance()
    assert output.thrusters == ()
    assert refusal not in output.refusals


@pytest.mark.parametrize("thruster", range(4))
def test_a_quadrotor_without_a_thruster_comes_down_where_it_was_and_is_still(thruster: int) -> None:
    loop = flying("quadrotor", 8.0)
    plant, failed = loop.follower.plant, loop.t
    p_in_f, pushed = plant.p_bf_in_f.copy(), 0.0
    plant.thruster_health[thruster] = 0.0
    while loop.t < failed + 5.0:
        if loop.advance().thrusts.any():
            pushed = loop.t
    assert pushed < failed + 1.0
    assert np.linalg.norm(plant.p_bf_in_f[:2] - p_in_f[:2]) < 1.0


def test_a_quadrotor_with_a_weak_thruster_is_told_and_flies_on() -> None:
    loop = flying("quadrotor", 8.0)
    loop.follower.plant.thruster_health[1] = 0.6
    end = loop.t + 4.0
    while loop.t < end:
        output = loop.advance()
        assert output.failsafe.mode == Mode.TRACK
    (words,) = output.thrusters
    assert words.startswith("Thruster 2 gives ")
