"""The simulated AMES behind RPIt's client follows a virtual phone as well as by our own link."""

from __future__ import annotations

import numpy as np
import pytest

from hardware.robot_file import load_robot
from pipeline.estimation.estimators import warm_up
from tests.counterparts.betaflight_flight import rms_mm
from tests.hardware.link.rpit.rpit_rig import RpitFlight, bad_line

AMES = load_robot("ames")
SEED, SECONDS = 1000, 9.0


@pytest.mark.slow
def test_it_follows_a_moving_hand_almost_as_well_as_by_our_own_link_by_a_bad_line_too():
    warm_up()
    own, flown = rms_mm(SEED, SECONDS, None), []
    for is_bad in (False, True):
        flight = RpitFlight(AMES, SEED)
        if is_bad:
            rng, block = np.random.default_rng(SEED), flight.robot.block
            block.to_ground, block.to_robot = bad_line(rng), bad_line(rng)
        flown.append(rms_mm(SEED, SECONDS, flight))
        flight.close()
    print(f"RPIt {flown[0]:.2f} mm, by a bad line {flown[1]:.2f} mm, our link {own:.2f} mm")
    assert max(flown) < 1.5 * own
