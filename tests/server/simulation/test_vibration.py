"""A vibration beside the sample rate is named, and soon the loop is what it is without."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest

from hardware.robot_file import load_robot
from hardware.sim.plant.plant import PlantOptions
from hardware.sim.plant.vibration import Vibration
from pipeline.config import TeleopConfig
from pipeline.frames import log
from pipeline.signals import Mode
from server.protocol.messages import Command
from server.simulation.figures import rms, rows_of
from server.simulation.virtual_time import SimulationOptions, VirtualTimeSimulation
from server.virtual_phone.phone_script import VirtualOperator

AMES = load_robot("ames")
BEGINS_S, KNOWN_S, END_S = 5.0, 10.0, 14.0
SWAYS = "The robot's {} sways where pictures don't"


class Patient(VirtualOperator):
    """Arms no sooner than that."""

    def see(self, mode: str, ready: bool, t: float) -> Command | None:
        command = super().see(mode, ready, t)
        return command if t > END_S - 2.0 else None


def simulation(
    vibration: Vibration | None, seed: int, operator: VirtualOperator | None = None
) -> VirtualTimeSimulation:
    scene = SimulationOptions(hand="moving", seed=seed, led_noise_px=0.02)
    plant = PlantOptions(vibration=vibration)
    return VirtualTimeSimulation(AMES, TeleopConfig(), scene, operator, plant=plant)


@cache
def flown(vibration: Vibration | None, seed: int) -> tuple[float, float, tuple[str, ...]]:
    """RMS error [mm] and ANEES(6) once it is known, and what is doubted then."""
    flight = simulation(vibration, seed)
    estimator, nees = flight.controller.teleop.estimator, []
    while flight.t < END_S:
        output = flight.advance()
        assert not flight.trace.left
        if flight.t > KNOWN_S and output.relative is not None:
            (R_fc, p_cf), (R_fb, p_bf) = flight.truth()
            known = output.relative
            turn = log(known.R_cb.T @ R_fc.T @ R_fb)
            e = np.concatenate((R_fc.T @ (p_bf - p_cf) - known.p_bc_in_c, turn))
            nees.append(float(e @ np.linalg.solve(estimator.covariance, e)))
    late = np.array(flight.trace.t) > KNOWN_S
    distance = np.linalg.norm(rows_of(flight.trace.error_in_f)[late], axis=1)
    return 1e3 * rms(distance), float(np.mean(nees)), estimator.health.doubts


@pytest.mark.slow
@pytest.mark.parametrize(
    ("vibration", "sensor"),
    [
        (Vibration(203.0, force=1.0, start_s=BEGINS_S), "accelerometer"),
        (Vibration(397.0, force=1.0, start_s=BEGINS_S), "accelerometer"),
        (Vibration(206.0, rate=0.1, start_s=BEGINS_S), "gyroscope"),
    ],
)
def test_it_is_said_and_flown_through_as_if_it_were_not_there(
    vibration: Vibration, sensor: str
) -> None:
    clean_mm, _, none = flown(None, 1)
    shaken_mm, nees, doubts = flown(vibration, 1)
    assert none == ()
    assert any(words.startswith(SWAYS.format(sensor)) for words in doubts)
    assert shaken_mm < 1.25 * clean_mm
    assert nees < 7.4


@pytest.mark.slow
def test_at_rest_it_is_refused_in_words_that_say_what_to_do() -> None:
    always = Vibration(203.0, force=1.0, spins=False)
    flight, refused = simulation(always, 1, Patient()), set[str]()
    while flight.t < END_S:
        output = flight.advance()
        assert output.failsafe.mode == Mode.DISARMED
        if flight.t > END_S - 2.0:
            refused |= set(output.refusals)
    [words] = [one for one in refused if one.startswith(SWAYS.format("accelerometer"))]
    assert "Balance the propellers" in words
