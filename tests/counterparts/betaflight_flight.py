"""What the real firmware costs a flight: `python -m tests.counterparts.betaflight_flight`."""

from __future__ import annotations

import tempfile
from pathlib import Path

import numpy as np

from hardware.robot_file import load_robot
from hardware.sim.virtual_time_follower import VirtualTimeFollower
from pipeline.estimation.estimators import warm_up
from server.common.runtime_parameters import DEFAULT_KNOBS
from server.control.process import teleop_config
from server.simulation.virtual_time import SimulationOptions, VirtualTimeSimulation
from tests.counterparts.betaflight import Firmware, FirmwareFollower

AMES = load_robot("ames")
SETTLED_S = 3.0
"""Of tracking; what comes before is not judged."""


def rms_mm(seed: int, seconds: float, follower: VirtualTimeFollower | None) -> float:
    """Tracking error of a moving hand, as LEDs' rays of 0.1 px see it [mm]; inf if it ended."""
    config = teleop_config(AMES, "phone", DEFAULT_KNOBS.config())
    scene = SimulationOptions(hand="moving", seed=seed, led_noise_px=0.1, knows_clock=True)
    trace = VirtualTimeSimulation(AMES, config, scene, follower=follower).run(seconds)
    if trace.left:
        print(f"seed {seed} ended: {trace.left}")
        return float("inf")
    errors = np.array(trace.error_in_f)[round(SETTLED_S / 0.005) :]
    return 1e3 * float(np.sqrt((errors**2).sum(axis=1).mean()))


def ratio_to_our_link(firmware: Firmware, seed: int, seconds: float) -> float:
    """RMS by the firmware over RMS by our own link, the same hand and noise."""
    warm_up()
    own = rms_mm(seed, seconds, None)
    follower = FirmwareFollower(AMES, seed, firmware)
    try:
        flown = rms_mm(seed, seconds, follower)
    finally:
        follower.close()
    late_ms = 1e3 * follower.late_s
    print(f"seed {seed}: {flown:.2f} mm, our link {own:.2f} mm, latest tick {late_ms:.1f} ms late")
    return flown / own


def main() -> None:
    with tempfile.TemporaryDirectory() as folder:
        firmware = Firmware(Path(folder))
        ratios = [ratio_to_our_link(firmware, seed, 30.0) for seed in range(1000, 1005)]
        firmware.close()
    print(f"Betaflight over our link: {np.median(ratios):.2f} x, worst {max(ratios):.2f} x")


if __name__ == "__main__":
    main()
