"""Make `virtual_phone.mcap`: the whole loop in virtual time, recorded as a server does."""

import argparse
from pathlib import Path

from hardware.camera_file import CAMERAS
from hardware.robot_file import ROBOTS, load_robot
from pipeline.config import TeleopConfig
from server.protocol.messages import Hello, encode_message
from server.protocol.wire import VERSION, encode
from server.protocol.wire_records import Ping
from server.recording.folder import RecordingFolder
from server.recording.writer import CAMERA_KEY, DEVICE_KEY, ROBOT_KEY, SETTINGS_KEY, Recorder
from server.simulation.virtual_time import SimulationOptions, VirtualTimeSimulation
from server.virtual_phone.phone_script import DEVICE

SCENE = SimulationOptions(hand="demo", seed=11, frame_rate_hz=20.0, bitrate_bps=450_000)
SECONDS = 5.5
STATUS_TICKS = 4


class RecordedFlight(VirtualTimeSimulation):
    """A flight whose records, wishes and statuses are kept."""

    def __init__(self, recorder, scene=SCENE):
        super().__init__(load_robot("ames"), TeleopConfig(), scene)
        self.recorder = recorder
        hello = Hello(VERSION, "operator", DEVICE, sensors="simulated", video="simulated")
        recorder.message("phone", encode_message(hello), self.t)
        self._ticks_recorded = 0
        see = self._script.operator.see

        def see_and_keep(mode, ready, t):
            wish = see(mode, ready, t)
            if wish is not None:
                recorder.message("phone", encode_message(wish), t)
            return wish

        self._script.operator.see = see_and_keep

    def advance(self):
        output = super().advance()
        self._ticks_recorded += 1
        if self._ticks_recorded % STATUS_TICKS == 0:
            epoch = self.follower.epoch
            status = self.controller.status(output, epoch, "virtual time", {}, 0.0, 0)
            self.recorder.status(status, self.t)
        return output

    def _send_later(self, record):
        if isinstance(record.body, Ping):
            self.recorder.record("server", encode(record), self.t)
        super()._send_later(record)

    def _take(self, record):
        self.recorder.record("phone", encode(record), self.t)
        super()._take(record)


def record_flight(directory, name="virtual_phone", scene=SCENE, seconds=SECONDS):
    """Fly, and give the path of the recording."""
    metadata = {
        DEVICE_KEY: DEVICE,
        ROBOT_KEY: (ROBOTS / "ames.toml").read_text(),
        CAMERA_KEY: (CAMERAS / "virtual_phone.yaml").read_text(),
        SETTINGS_KEY: repr(scene),
    }
    recorder = Recorder(RecordingFolder(directory), name, metadata)
    flight = RecordedFlight(recorder, scene)
    try:
        while flight.t < seconds:
            flight.advance()
    finally:
        recorder.close()
    return recorder.path


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("directory", type=Path, nargs="?", default=Path(__file__).parent)
    path = record_flight(parser.parse_args().directory)
    print(path, path.stat().st_size, "bytes")
