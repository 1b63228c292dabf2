"""Whatever flies was compiled before: a control process that compiles in flight does not answer."""

import subprocess
import sys

import pytest

FLOWN = """
import sys

from hardware.robot_file import load_robot
from pipeline.config import TeleopConfig
from server.control.process import teleop_config
from server.simulation.virtual_time import SimulationOptions, VirtualTimeSimulation


def compiled():
    return {
        f"{name}.{key}": len(kernel.signatures)
        for name, module in list(sys.modules.items())
        if name.startswith("pipeline.control")
        for key, kernel in vars(module).items()
        if hasattr(kernel, "signatures") and hasattr(kernel, "py_func")
    }


robot_file = load_robot("ames")
config = teleop_config(robot_file, "phone", TeleopConfig().virtual_camera, "relative")
scene = SimulationOptions(hand="moving", seed=1000, led_noise_px=0.02)
simulation = VirtualTimeSimulation(robot_file, config, scene)
before = compiled()
simulation.run(4.0)
assert simulation.trace.t, "it was not led"
simulation.follower.plant.thruster_health[3] = 0.0
simulation.run(6.0)
assert not simulation.trace.left, simulation.trace.left
assert simulation.advance().thrusters, "nobody named the thruster"
late = {name: n for name, n in compiled().items() if n != before.get(name)}
assert not late, late
"""


@pytest.mark.slow
def test_no_kernel_of_control_is_compiled_in_flight_nor_as_a_thruster_fails() -> None:
    done = subprocess.run(
        [sys.executable, "-c", FLOWN], capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
