"""A server that notes when what arrived: `python -m server.experiments.network.server HOST`.

All of the real one that a phone speaks to, behind the real guard; no robot, no control process.
Says where it is on a line of JSON; each SIGUSR1 makes it say what it heard since, on another.
"""

from __future__ import annotations

import asyncio
import signal
import sys
import tempfile
from pathlib import Path

import msgspec

from hardware.camera_file import CAMERAS
from hardware.robot_file import load_robot
from pipeline.signals import TouchState
from pipeline.vision.visual_front_end import warm_up
from server.common.clock import now
from server.common.settings import RtcSettings, VideoSettings
from server.control.ipc import control_end
from server.control.ipc_inputs import Input
from server.phone.phone_session import PhoneSession
from server.process.ports import listen
from server.protocol.wire import HEADER, MAGIC, Kind
from server.protocol.wire_records import Record
from server.recording.control import Recordings
from server.rtc.signalling_endpoint import SignallingEndpoint
from server.security.admission import Admission
from server.security.least_role import roles_of
from server.security.listener import listener
from server.security.request_guard import Guard
from server.security.security import Doors
from server.web.app import Api, make_app
from server.web.session_manager import SessionManager
from server.web.websocket import PageServer


class ServerAddress(msgspec.Struct, frozen=True):
    """Where it is, and what opens its door."""

    url: str
    token: str


class ArrivalLog(msgspec.Struct):
    """What came since the last time it was asked."""

    records: list[tuple[int, int, int, float]] = []
    """Kind, sequence, time [µs of the phone's clock], arrival [s]."""
    echoes: list[tuple[float, float]] = []
    """When a PING went out and its echo in a TOUCH came back [s]."""
    undecodable: int = 0
    """Pictures that came but could not be decoded."""
    video_path: str = ""
    """How the last pictures came, in words."""
    partings: int = 0
    """Phones that went."""


class NotingSessionManager(SessionManager):
    """Session manager that remembers arrivals."""

    heard = ArrivalLog()

    def record(self, data: str | bytes | Record, t: float) -> None:
        """Note it."""
        super().record(data, t)
        if isinstance(data, Record):
            self.heard.records.append((Kind.FRAME, data.sequence, data.t_us, t))
        elif isinstance(data, bytes) and data[0] == MAGIC:
            _, _, kind, _, sequence, t_us = HEADER.unpack_from(data)
            self.heard.records.append((kind, sequence, t_us, t))

    def to_control(self, message: Input) -> None:
        """Note what would tell control that the operator is there."""
        super().to_control(message)
        if isinstance(message, TouchState):
            self.heard.echoes.append((message.t, now()))

    def disconnect_phone(self, phone: PhoneSession) -> None:
        """Note how its pictures came."""
        self._look_back(phone)
        self.heard.partings += 1
        super().disconnect_phone(phone)

    def send_heard(self) -> None:
        """Send all that was noted, and begin anew."""
        if self.phone is not None:
            self._look_back(self.phone)
        sys.stdout.buffer.write(msgspec.json.encode(self.heard) + b"\n")
        sys.stdout.buffer.flush()
        self.heard = ArrivalLog()

    def _look_back(self, phone: PhoneSession) -> None:
        self.heard.video_path = phone.video_path
        if phone.vision is not None:
            self.heard.undecodable = phone.vision.undecodable


async def serve(host: str, folder: Path) -> None:
    """Serve until SIGTERM."""
    robot = load_robot("ames").robot
    doors = Doors()
    recordings = Recordings(folder / "recordings", {})
    manager = NotingSessionManager(folder, robot, [CAMERAS], recordings, doors=doors)
    control = control_end(folder)  # nobody's: what goes there is read and forgotten
    video = VideoSettings(width=640, height=480, bitrate_bps=1_500_000)
    with listen(host, 0) as bound:
        url = f"http://{host}:{bound.getsockname()[1]}"
        signalling = SignallingEndpoint(manager, RtcSettings(), video.bitrate_bps)
        api = Api(manager, None)
        admission = Admission()
        inner = make_app(api, PageServer(manager, video), signalling.routes())
        app = Guard(inner, doors, [host], admission, roles=roles_of(inner.routes))
        stop, loop = asyncio.Event(), asyncio.get_running_loop()
        loop.add_reader(control.fileno(), control.inputs)
        loop.add_signal_handler(signal.SIGTERM, stop.set)
        loop.add_signal_handler(signal.SIGUSR1, manager.send_heard)
        server = listener(app, None, admission)
        tasks = [
            asyncio.create_task(server.serve(sockets=[bound])),
            asyncio.create_task(manager.run()),
        ]
        sys.stdout.buffer.write(
            msgspec.json.encode(ServerAddress(url, doors.operator_token)) + b"\n"
        )
        sys.stdout.buffer.flush()
        await stop.wait()
        await signalling.close()
        server.should_exit = server.force_exit = True
        tasks[1].cancel()
        await asyncio.gather(*tasks, return_exceptions=True)
        control.close()


def main() -> int:
    """Entry of the process."""
    warm_up()
    with tempfile.TemporaryDirectory() as folder:
        asyncio.run(serve(sys.argv[1], Path(folder)))
    return 0


if __name__ == "__main__":
    sys.exit(main())
