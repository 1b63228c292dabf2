"""A recorded phone through ingest, vision and control in virtual time: the same bytes each time.

The robot does not follow: its recorded motion samples are used, and what is compared are the
estimates. The CSV has one row per picture:

| column | what |
|---|---|
| t_s | arrival of the picture, since the recording's first item |
| capture_s | its capture time, likewise |
| sequence | its number, as the phone counted |
| found, leds, reprojection_px | was the robot found, on how many LEDs, RMS residual |
| x_m, y_m, z_m, qw, qx, qy, qz, sigma_m | pose of the body in camera axes, measured in it |
| fused_x_m … fused_qz, fused_sigma_m | the filter's estimate at the next control period |
| mode | of the failsafe machine, with the recorded button and wishes |
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
from pipeline.frames import Array, wxyz_from_R
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
POSE = ("x_m", "y_m", "z_m", "qw", "qx", "qy", "qz", "sigma_m")
COLUMNS = (
    *("t_s", "capture_s", "sequence", "found", "leds", "reprojection_px"),
    *POSE,
    *(f"fused_{name}" for name in POSE),
    "mode",
)
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
                yield _row(frame, pose, output, recording.t_first)
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
                self._take(self._ingest.record(record, entry.t))
        except WireError:
            self.refused += 1

    def _take(self, signal: PhoneImu | Operator | EncodedFrame | None) -> None:
        match signal:
            case PhoneImu():
                self._sight.feel(signal)
                self._inbox.append(PhoneImuInput.of(signal))
            case Operator():
                self._inbox.append(OperatorInput.of(signal))
            case EncodedFrame():
                controller = self._controller
                sighting = self._sight.see([signal], controller.up_in_b, controller.omega_bf_in_b)
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


def _row(
    frame: EncodedFrame, pose: RelativePose | None, output: Output, t_first: float
) -> dict[str, str]:
    row = dict.fromkeys(COLUMNS, "")
    row["t_s"], row["capture_s"] = f"{frame.t_received - t_first:.6f}", f"{frame.t - t_first:.6f}"
    row["sequence"], row["found"] = str(frame.sequence), str(int(pose is not None))
    row["mode"] = output.failsafe.mode.name
    if pose is not None:
        row["leds"], row["reprojection_px"] = str(pose.leds), f"{pose.reprojection_px:.3f}"
        sigma = float(np.sqrt(np.diag(pose.covariance)[:3].max()))
        row |= _pose_cells("", pose.p_bc_in_c, pose.R_cb, sigma)
    relative = output.relative
    if relative is not None:
        row |= _pose_cells("fused_", relative.p_bc_in_c, relative.R_cb, relative.sigma_p)
    return row


def _pose_cells(prefix: str, p: Array, R: Array, sigma: float) -> dict[str, str]:
    values = (*p.tolist(), *wxyz_from_R(R), sigma)
    return {f"{prefix}{name}": f"{v:.6f}" for name, v in zip(POSE, values, strict=True)}


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
