"""`examples/serial_radio`, as somebody else's package: found by its name, with either contract."""

import os
import select
import tomllib
from pathlib import Path

import pytest

from hardware.contract import FollowerContract, TwistFollowerContract
from hardware.follower import FollowerError
from hardware.link.registry import GROUP, connect
from hardware.link.robot_server import TICK_US
from hardware.robot_file import COMMANDS, load_robot
from hardware.sim.simulated import SimulatedRobot, seeded_nonces
from tests.hardware.rigs import KEY

FOLDER = Path(__file__).resolve().parents[2] / "examples" / "serial_radio"
AMES, TWISTER = load_robot("ames"), load_robot("twister", takes=COMMANDS)
PEER = ("radio", 0)


@pytest.fixture
def kind(tmp_path, monkeypatch):
    """As `pip install` would put it."""
    project = tomllib.loads((FOLDER / "pyproject.toml").read_text())["project"]
    info = tmp_path / "lightleash_serial_radio-1.0.dist-info"
    info.mkdir()
    (info / "METADATA").write_text(
        f"Metadata-Version: 2.1\nName: {project['name']}\nVersion: 1.0\n"
    )
    ((name, target),) = project["entry-points"][GROUP].items()
    (info / "entry_points.txt").write_text(f"[{GROUP}]\n{name} = {target}\n")
    monkeypatch.syspath_prepend(str(tmp_path))
    monkeypatch.syspath_prepend(str(FOLDER))
    return name


class SerialRig:
    """A simulated robot at the other end of a real pseudo-terminal, in virtual time."""

    def __init__(self, kind, robot_file=AMES) -> None:
        self.robot = SimulatedRobot(robot_file, 0, 7, seeded_nonces(0), KEY)
        self.radio, self.port = os.openpty()
        os.set_blocking(self.radio, False)
        self.follower = connect(robot_file.reached(os.ttyname(self.port), 1, kind), KEY, 1)
        self.now_us, self.connected, self.heard = 0, True, b""

    def advance(self, dt: float) -> None:
        for _ in range(round(1e6 * dt / TICK_US)):
            self.hear()
            self.now_us += TICK_US
            for data in self.robot.tick(self.now_us):
                if not self.connected or not self.robot.end.recipients(self.now_us):
                    continue
                escaped = data.replace(b"\xdb", b"\xdb\xdd").replace(b"\xc0", b"\xdb\xdc")
                if select.select([], [self.radio], [], 0)[1]:
                    os.write(self.radio, escaped + b"\xc0")

    def hear(self) -> None:
        while select.select([self.radio], [], [], 0)[0]:
            self.heard += os.read(self.radio, 4096)
        *frames, self.heard = self.heard.split(b"\xc0")
        for frame in frames if self.connected else ():
            data = frame.replace(b"\xdb\xdc", b"\xc0").replace(b"\xdb\xdd", b"\xdb")
            self.robot.receive(data, PEER, self.now_us)

    def cut_link(self) -> None:
        self.connected = False

    def close(self) -> None:
        self.follower.close()
        os.close(self.radio)
        os.close(self.port)


class TestContract(FollowerContract):
    @pytest.fixture
    def rig(self, kind):
        rig = SerialRig(kind)
        yield rig
        rig.close()


class TestContractOfTwists(TwistFollowerContract):
    @pytest.fixture
    def rig(self, kind):
        rig = SerialRig(kind, TWISTER)
        yield rig
        rig.close()


def test_noise_on_the_line_is_dropped_and_counted(kind):
    rig = SerialRig(kind)
    rig.follower.receive()
    os.write(rig.radio, b"\xc0\xdb\xdb\xc0noise\xc0" + bytes(3000) + b"\xc0")
    for _ in range(4):
        rig.follower.receive()
    assert rig.follower.dropped >= 3
    rig.close()


def test_a_port_that_is_not_there_is_named(kind):
    with pytest.raises(FollowerError, match="/dev/no-such-port"):
        connect(AMES.reached("/dev/no-such-port", 1, kind), KEY, 1)


def test_it_is_as_short_as_an_example_should_be():
    lines = (FOLDER / "lightleash_serial_radio.py").read_text().splitlines()
    assert sum(bool(line.strip()) for line in lines) < 50
