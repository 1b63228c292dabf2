"""The real Betaflight firmware turns the motors of a simulated AMES."""

from collections.abc import Iterator

import numpy as np
import pytest

from hardware.contract import FollowerContract
from hardware.robot_file import load_robot
from tests.counterparts.betaflight import Firmware, FirmwareFollower, NoFirmwareError
from tests.counterparts.betaflight_flight import ratio_to_our_link

pytestmark = pytest.mark.counterpart
AMES = load_robot("ames")


@pytest.fixture(scope="module")
def firmware(tmp_path_factory) -> Iterator[Firmware]:
    try:
        running = Firmware(tmp_path_factory.mktemp("betaflight"))
    except NoFirmwareError as error:
        pytest.skip(str(error))
    yield running
    running.close()


class Rig:
    """Real time passes: what it waits for comes when it comes."""

    def __init__(self, firmware: Firmware) -> None:
        self.follower = FirmwareFollower(AMES, 0, firmware)
        self.f_max = AMES.robot.f_max
        for _ in range(400):  # until the firmware has said who it is
            self.follower.advance()
            if not self.follower.computer.flight_controller.unfit:
                return
        raise AssertionError(self.follower.computer.flight_controller.unfit)

    def advance(self, dt: float) -> None:
        self.follower.advance(dt)

    def cut_link(self) -> None:
        self.follower.connected = False


class TestContract(FollowerContract):
    @pytest.fixture
    def rig(self, firmware):
        rig = Rig(firmware)
        yield rig
        rig.follower.close()


def test_each_thruster_gives_what_it_is_told(firmware):
    follower = Rig(firmware).follower
    asked = np.linspace(0.3, 2.8, 8)
    computer = follower.computer.flight_controller
    for k in range(60):
        follower._line.write(computer.tick(asked, 5_000 * k))
        follower._firmware._rest(0.005)
    values = follower._firmware.motors()
    follower._line.write(computer.tick(np.zeros(8), 1_000_000))
    follower._firmware._rest(0.05)
    follower.close()
    assert AMES.robot.f_max * ((values[:8] - 1000.0) / 1000.0) ** 2 == pytest.approx(
        asked, abs=5e-3
    )


def test_it_follows_a_moving_hand_almost_as_well_as_by_our_own_link(firmware):
    assert ratio_to_our_link(firmware, seed=1000, seconds=12.0) < 1.5
