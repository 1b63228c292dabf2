"""A recorded phone through ingest, vision and control in virtual time: the same bytes each time.

The robot does not follow: its recorded motion samples are used, and what is compared are the
estimates, as rows of `table`.
"""

from __future__ import annotations

import csv
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TextIO

from pipeline.config import PERIOD_S, TeleopConfig
from pipeline.signals import BodyImu, PhoneImu, RelativePose, TouchState
from pipeline.teleop import Output
from pipeline.vision.detection import Detection
from server.control.controller import Controller
from server.control.ipc_inputs import Input, ReadyInput, RequestInput
from server.media.image_format import ImageFormat
from server.phone.frame_pipeline import FramePipeline
from server.phone.ingest import EncodedFrame, Ingest
from server.protocol.lead_messages import Lead
from server.protocol.messages import Command, Hello, decode_message
from server.protocol.wire import WireError, decode
from server.protocol.wire_records import Motion, Picture, Ping, Record
from server.recording.reader import Entry, Recording
from server.recording.writer import PHONE_MESSAGES, PHONE_RECORDS, SERVER_RECORDS, RecordingError
from server.replay.setting import body_samples, first_shape, recorded_camera, recorded_robot
from server.replay.table import COLUMNS, row_of

READY_EVERY, EXPECT_EVERY = 20, 4
"""Ticks between words of the server to control, and of control to the server."""
Tap = Callable[[float, Sequence[Input], Sequence[BodyImu]], None]
"""Takes the time [s], what the server said, the robot's motion samples."""


class Offline:
    """One recording, played once."""

    def __init__(self, recording: Recording, tap: Tap = lambda *_: None) -> None:
        """Read what it says of robot and camera; `tap` is told what control hears.

        Raises:
            RecordingError: damaged, or its robot or camera can't be used.
        """
        self._recording = recording
        self.robot, self._tap = recorded_robot(recording).robot, tap
        self._config = TeleopConfig()
        self._controller = Controller(self.robot, self._config)
        self._shape = first_shape(recording)
        self._nonces: deque[int] = deque()
        self._greet()
        self._body = deque(body_samples(recording))
        self._inbox: list[Input] = []
        self._seen: list[tuple[EncodedFrame, RelativePose | None]] = []
        self.refused = 0
        """Records that ingest refused, as the server did then."""

    def _greet(self) -> None:
        """A phone has come: nothing is known of its clock and its pictures."""
        self._ingest = Ingest(self._nonces.popleft)
        self._new_sight()

    def _new_sight(self) -> None:
        """Open eyes for pictures of the present shape.

        Raises:
            RecordingError: nobody knows a camera that takes such pictures.
        """
        camera = recorded_camera(self._recording, self._shape)
        self._frame_pipeline = FramePipeline(camera, self.robot, self._config.gates)
        self._ingest.extrinsics = camera.extrinsics
        self._is_blind = False

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
                self._receive(waiting)
                waiting = next(entries, None)
            if k % READY_EVERY == 0:
                self._inbox.append(ReadyInput([]))
            output = self._tick(now)
            if k % EXPECT_EVERY == 0:
                self._frame_pipeline.front_end.add_prediction(self._controller.expected(output))
            for frame, pose in self._seen:
                yield row_of(frame, pose, output, recording.t_first)
            self._seen.clear()

    def _tick(self, now: float) -> Output:
        body: list[BodyImu] = []
        while self._body and self._body[0].t <= now:
            body.append(self._body.popleft())
        self._frame_pipeline.front_end.add_imu(*body)
        inbox, self._inbox = self._inbox, []
        self._tap(now, inbox, body)
        _, output = self._controller.tick(now, inbox, body, "")
        return output

    def _receive(self, entry: Entry) -> None:
        """Do what the server did with it then, without sockets."""
        try:
            if entry.topic == PHONE_MESSAGES:
                message = decode_message(entry.data)
                if isinstance(message, Hello):
                    self._greet()
                elif isinstance(message, Lead):
                    self._inbox.append(message)
                elif isinstance(message, Command):
                    self._inbox.append(RequestInput(message.what))
                return
            record = decode(entry.data)
            if isinstance(record.body, Ping):
                self._nonces.append(record.body.nonce)
                self._ingest.ping(entry.t)
            elif entry.topic == PHONE_RECORDS:
                self._take(record, entry.t)
        except WireError:
            self.refused += 1

    def _take(self, record: Record, now: float) -> None:
        """A record of the phone."""
        match self._ingest.record(record, now):
            case PhoneImu() as sample if isinstance(record.body, Motion):
                self._frame_pipeline.front_end.add_imu(sample)
                self._inbox.append(sample)
                self._on_motion(sample, record.body, now)
            case TouchState() as operator:
                self._inbox.append(operator)
            case EncodedFrame() as frame:
                self._see(frame)
            case None if isinstance(record.body, Picture):  # those that follow lean on it
                self._fit(record.body)
                self._frame_pipeline.decoded(EncodedFrame(now, now, record.sequence, record.body))

    def _fit(self, picture: Picture) -> None:
        """Open other eyes for another size or angle, as the server did; none if it had none."""
        shape = ImageFormat.of(picture)
        if shape == self._shape:
            return
        self._shape, before = shape, self._frame_pipeline.front_end
        try:
            self._new_sight()
        except RecordingError:
            self._is_blind = True
        else:
            self._frame_pipeline.front_end.go_on_from(before)

    def _see(self, frame: EncodedFrame) -> None:
        self._fit(frame.picture)
        detection = None if self._is_blind else self._frame_pipeline.see([frame])
        self._on_detection(frame, detection)
        self._seen.append((frame, detection.pose if detection is not None else None))
        seen = detection.seen(self._frame_pipeline.camera) if detection is not None else None
        if seen is not None:
            self._inbox.append(seen)

    def _on_motion(self, sample: PhoneImu, motion: Motion, now: float) -> None:
        """What else is made of a motion sample: nothing."""

    def _on_detection(self, frame: EncodedFrame, detection: Detection | None) -> None:
        """What else is made of a picture: nothing."""


@dataclass(slots=True)
class ReplayCounts:
    """What was in a recording so far."""

    pictures: int = 0
    found: int = 0
    """In how many of them the robot was."""
    refused: int = 0
    """Records."""


def write_table(recording: Recording, file: TextIO, counts: ReplayCounts) -> None:
    """Write the CSV into `file`, and count as it goes.

    Raises:
        RecordingError: the recording can't be used.
        OSError: the CSV can't be written.
    """
    offline = Offline(recording)
    writer = csv.DictWriter(file, COLUMNS, lineterminator="\n")
    writer.writeheader()
    for row in offline.rows():
        writer.writerow(row)
        counts.pictures += 1
        counts.found += row["found"] == "1"
    counts.refused = offline.refused


def run_offline(recording: Recording, out: Path) -> str:
    """Write the CSV; gives a line about it.

    Raises:
        RecordingError: the recording can't be used.
        OSError: the CSV can't be written.
    """
    counts = ReplayCounts()
    with out.open("w", newline="") as file:
        write_table(recording, file, counts)
    found, refused = counts.found, counts.refused
    return f"{counts.pictures} pictures, the robot found in {found}, {refused} records refused"
