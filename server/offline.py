"""A recorded phone through ingest, vision and control in virtual time: the same bytes each time.

The robot does not follow: its recorded motion samples are used, and what is compared are the
estimates, as rows of `offline_table`.
"""

from __future__ import annotations

import csv
import json
import tempfile
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from functools import partial
from pathlib import Path

import numpy as np

from hardware.camera_file import CAMERAS, CameraFileError, find_camera
from hardware.robot_file import RobotFile, RobotFileError, load_robot
from pipeline.camera.lens import Camera
from pipeline.config import TeleopConfig
from pipeline.signals import BodyImu, Operator, PhoneImu, RelativePose
from pipeline.teleop import Output
from server.control_link import (
    Input,
    OperatorInput,
    PhoneImuInput,
    ReadyInput,
    RequestInput,
)
from server.controller import Controller
from server.ingest import EncodedFrame, Ingest
from server.messages import Command, Hello, decode_message
from server.offline_table import COLUMNS, row_of
from server.recording import (
    CAMERA_KEY,
    PHONE_MESSAGES,
    PHONE_RECORDS,
    ROBOT_KEY,
    SERVER_RECORDS,
    STATUS,
    RecordingError,
)
from server.recording_files import Entry, Recording, device_of
from server.seen_input import SeenInput
from server.sight import Sight
from server.wire import Picture, Ping, WireError, decode

PERIOD_S = 0.005
READY_EVERY, EXPECT_EVERY = 20, 4
"""Ticks between words of the server to control, and of control to the server."""
Tap = Callable[[float, Sequence[Input], Sequence[BodyImu]], None]
"""Takes the time [s], what the server said, the robot's motion samples."""


class Offline:
    """One recording, played once."""

    def __init__(self, recording: Recording, tap: Tap = lambda *heard: None) -> None:
        """Read what it says of robot and camera; `tap` is told what control hears.

        Raises:
            RecordingError: damaged, or its robot or camera can't be used.
        """
        self._recording = recording
        robot_file, camera = _setting(recording)
        config = TeleopConfig()
        self.robot, self._tap = robot_file.robot, tap
        self._controller = Controller(robot_file.robot, config)
        self._new_sight = partial(Sight, camera, robot_file.robot, config.gates)
        self._nonces: deque[int] = deque()
        self._greet()
        self._body = deque(_body_samples(recording))
        self._inbox: list[Input] = []
        self._seen: list[tuple[EncodedFrame, RelativePose | None]] = []
        self.refused = 0
        """Records that ingest refused, as the server did then."""

    def _greet(self) -> None:
        """A phone has come: nothing is known of its clock and its pictures."""
        self._ingest, self._sight = Ingest(self._nonces.popleft), self._new_sight()
        self._ingest.mounting = self._sight.camera.mounting
        self._undated: list[EncodedFrame] = []

    def rows(self) -> Iterator[dict[str, str]]:
        """One row per picture.

        Raises:
            RecordingError: the file is damaged.
        """
        recording = self._recording
        entries = recording.entries(PHONE_RECORDS, SERVER_RECORDS, PHONE_MESSAGES)
        waiting = next(entries, None)
        ticks = int((recording.t_last - recording.t_first) / PERIOD_S) + 2
        for k in range(ticks):
            now = recording.t_first + k * PERIOD_S
            while waiting is not None and waiting.t <= now:
                self._hear(waiting)
                waiting = next(entries, None)
            if k % READY_EVERY == 0:
                self._inbox.append(ReadyInput([]))
            output = self._tick(now)
            if k % EXPECT_EVERY == 0:
                self._sight.expect(self._controller.expected(output))
            for frame, pose in self._seen:
                yield row_of(frame, pose, output, recording.t_first)
            self._seen.clear()

    def _tick(self, now: float) -> Output:
        body: list[BodyImu] = []
        while self._body and self._body[0].t <= now:
            body.append(self._body.popleft())
        self._sight.feel_body(body)
        inbox, self._inbox = self._inbox, []
        self._tap(now, inbox, body)
        _, output = self._controller.tick(now, inbox, body, "")
        return output

    def _hear(self, entry: Entry) -> None:
        """What the server did with it then, without sockets."""
        try:
            if entry.topic == PHONE_MESSAGES:
                message = decode_message(entry.data)
                if isinstance(message, Hello):
                    self._greet()
                elif isinstance(message, Command):
                    self._inbox.append(RequestInput(message.what))
                return
            record = decode(entry.data)
            if isinstance(record.body, Ping):
                self._nonces.append(record.body.nonce)
                self._ingest.ping(entry.t)
            elif entry.topic == PHONE_RECORDS:
                signal = self._ingest.record(record, entry.t)
                if signal is None and isinstance(record.body, Picture):
                    self._keep_undated(EncodedFrame(entry.t, entry.t, record.sequence, record.body))
                self._take(signal)
        except WireError:
            self.refused += 1

    def _keep_undated(self, frame: EncodedFrame) -> None:
        """From before the phone's clock is known: later pictures can't be decoded without it."""
        if frame.picture.key:
            self._undated.clear()
        self._undated.append(frame)

    def _take(self, signal: PhoneImu | Operator | EncodedFrame | None) -> None:
        match signal:
            case PhoneImu():
                self._sight.feel(signal)
                self._inbox.append(PhoneImuInput.of(signal))
            case Operator():
                self._inbox.append(OperatorInput.of(signal))
            case EncodedFrame():
                controller = self._controller
                frames, self._undated = [*self._undated, signal], []
                sighting = self._sight.see(frames, controller.up_in_b, controller.omega_bf_in_b)
                self._seen.append((signal, sighting.pose if sighting is not None else None))
                seen = sighting.seen(self._sight.camera) if sighting is not None else None
                if seen is not None:
                    self._inbox.append(SeenInput.of(seen))


def _body_samples(recording: Recording) -> list[BodyImu]:
    """The robot's motion samples out of the recorded statuses, in the order of time."""
    samples: list[BodyImu] = []
    for entry in recording.entries(STATUS):
        try:
            rows = np.array(json.loads(entry.data)["body_samples"], dtype=np.float64)
            rows = rows.reshape(-1, 7)
        except (ValueError, LookupError, TypeError) as error:
            what = f"holds a status that can't be read: {error}"
            raise RecordingError(recording.path, what, "record anew") from error
        samples += [BodyImu(float(row[0]), row[1:4], row[4:7]) for row in rows]
    return sorted(samples, key=lambda sample: sample.t)


def _setting(recording: Recording) -> tuple[RobotFile, Camera]:
    """Robot and camera of a recording: its own files, else what is known by their names."""
    metadata = recording.metadata
    try:
        with tempfile.TemporaryDirectory() as name:
            folder = Path(name)
            robot_file = load_robot("ames")
            if metadata.get(ROBOT_KEY):
                (folder / "robot.toml").write_text(metadata[ROBOT_KEY])
                robot_file = load_robot(folder / "robot.toml")
            if metadata.get(CAMERA_KEY):
                (folder / "camera.yaml").write_text(metadata[CAMERA_KEY])
            device, size = device_of(recording), _picture_size(recording)
            return robot_file, find_camera(device, *size, folders=(folder, CAMERAS))
    except (RobotFileError, CameraFileError) as error:
        raise RecordingError(recording.path, str(error), "a recording with both files") from error


def _picture_size(recording: Recording) -> tuple[int, int]:
    for _, data in recording.phone_records():
        with suppress(WireError):
            body = decode(data).body
            if isinstance(body, Picture):
                return body.width, body.height
    raise RecordingError(recording.path, "holds no picture", "name another recording")


def run_offline(recording: Recording, out: Path) -> str:
    """Write the CSV; gives a line about it.

    Raises:
        RecordingError: the recording can't be used.
        OSError: the CSV can't be written.
    """
    pictures = found = 0
    offline = Offline(recording)
    with out.open("w", newline="") as file:
        writer = csv.DictWriter(file, COLUMNS, lineterminator="\n")
        writer.writeheader()
        for row in offline.rows():
            writer.writerow(row)
            pictures += 1
            found += row["found"] == "1"
    return f"{pictures} pictures, the robot found in {found}, {offline.refused} records refused"
