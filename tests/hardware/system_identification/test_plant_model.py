"""What a plant predicts is held against what differences of a rate say."""

from __future__ import annotations

from hardware.robot_file import load_robot
from hardware.sim.plant.plant import PlantOptions
from hardware.system_identification.flight_record import SampledFlight
from hardware.system_identification.plant_model import PlantModel, SpecificPlant
from tests.hardware.system_identification.exciting import LINK_S
from tests.hardware.system_identification.pulses import pulsed

KNOWN = load_robot("ames").plant
QUIET = PlantOptions(imu_noise=False, imu_bias=False, imu_steps=False)


def test_a_thruster_does_not_seem_to_lag_by_what_differences_smear():
    flight = SampledFlight(*pulsed(KNOWN, 0.3, QUIET, thrusters=(0, 1)))
    model, plant = PlantModel(KNOWN, flight), SpecificPlant.of(KNOWN, LINK_S)
    yaw = model.residuals(plant)[:, 5]  # which nothing but thrusters and the air moves
    assert yaw.std() < 0.0015 * model.measured[:, 5].std()
