"""The screen turns in flight as phones' screens do, and with it the picture and its axes."""

import numpy as np
import pytest

from hardware.robot_file import load_robot
from hardware.sim.hand import Hand, make_hand
from pipeline.config import TeleopConfig
from pipeline.frames import Array, rotation_about_x
from pipeline.signals import Mode
from pipeline.teleop import TURNED
from server.simulation.virtual_time import SimulationOptions, VirtualTimeSimulation

pytestmark = pytest.mark.slow
TURNS_S, ENDS_S = 5.0, 10.0
LED_NOISE_PX = 0.05
MOST_M = {"ames": 0.1, "quadrotor": 0.35}
"""While it is held: what flies drifts."""


class TurnedHand:
    """A hand whose phone's picture may have been turned by a quarter."""

    def __init__(self, hand: Hand) -> None:
        self._hand, self.R = hand, np.eye(3)

    def pose(self, t: float) -> tuple[Array, Array]:
        R_fc, p_cf_in_f = self._hand.pose(t)
        return R_fc @ self.R, p_cf_in_f

    def omega_in_c(self, t: float) -> Array:
        turned: Array = self.R.T @ self._hand.omega_in_c(t)
        return turned

    def specific_force_in_c(self, t: float) -> Array:
        turned: Array = self.R.T @ self._hand.specific_force_in_c(t)
        return turned


@pytest.mark.parametrize("seed", range(2))
@pytest.mark.parametrize("name", ["ames", "quadrotor"])
def test_the_robot_holds_and_follows_again_by_another_press(name: str, seed: int) -> None:
    robot_file = load_robot(name)
    hand = TurnedHand(make_hand("filming", seed=seed, start=robot_file.start))
    scene = SimulationOptions(hand="filming", seed=seed, led_noise_px=LED_NOISE_PX)
    flight = VirtualTimeSimulation(robot_file, TeleopConfig(), scene, hand=hand)
    flight.run(TURNS_S)
    assert flight.trace.left == ""
    flight.phone.turn_screen((flight.phone.options.screen_angle_deg + 90) % 360)
    hand.R = rotation_about_x(0.5 * np.pi)
    before = flight.follower.body.p_bf_in_f
    modes, far_m = [Mode.TRACK], 0.0
    while flight.t < ENDS_S:
        output = flight.advance()
        if output.failsafe.mode == Mode.HOLD:
            far_m = max(far_m, float(np.linalg.norm(flight.follower.body.p_bf_in_f - before)))
        if output.failsafe.mode != modes[-1]:
            modes.append(output.failsafe.mode)
            if len(modes) == 2:
                assert output.failsafe.reason == TURNED
    assert modes == [Mode.TRACK, Mode.HOLD, Mode.TRACK]
    assert far_m < MOST_M[name]
    assert output.relative is not None
    (R_fc, p_cf), (R_fb, p_bf) = flight.truth()
    assert np.linalg.norm(R_fc.T @ (p_bf - p_cf) - output.relative.p_bc_in_c) < 0.02
    assert output.relative.R_cb == pytest.approx(R_fc.T @ R_fb, abs=0.03)
