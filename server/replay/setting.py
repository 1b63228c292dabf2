"""Which robot and which cameras a recording was made with."""

from __future__ import annotations

import json
import tempfile
from contextlib import suppress
from pathlib import Path

from hardware.camera_file import CAMERAS, CameraFileError
from hardware.robot_file import COMMANDS, RobotFile, RobotFileError, load_robot
from pipeline.camera.lens import Camera
from pipeline.signals import BodyImu
from server.control.ipc import body_imus
from server.media.image_format import ImageFormat
from server.protocol.wire import WireError, decode
from server.protocol.wire_records import Picture
from server.recording.reader import Recording, device_of
from server.recording.writer import CAMERA_KEY, ROBOT_KEY, STATUS, RecordingError


def recorded_robot(recording: Recording) -> RobotFile:
    """The robot: the recording's own file, else the AMES.

    Raises:
        RecordingError: the file can't be used.
    """
    text = recording.metadata.get(ROBOT_KEY)
    if not text:
        return load_robot("ames")
    try:
        with tempfile.TemporaryDirectory() as name:
            path = Path(name) / "robot.toml"
            path.write_text(text)
            return load_robot(path, takes=COMMANDS)
    except RobotFileError as error:
        raise _unusable(recording, error) from error


def recorded_camera(recording: Recording, shape: ImageFormat) -> Camera:
    """The camera of its pictures of one shape: by its own file, else one we know.

    Raises:
        RecordingError: the file can't be used, or there is none.
    """
    try:
        with tempfile.TemporaryDirectory() as name:
            folder = Path(name)
            (folder / "camera.yaml").write_text(recording.metadata.get(CAMERA_KEY) or "")
            folders = (folder, CAMERAS) if recording.metadata.get(CAMERA_KEY) else (CAMERAS,)
            return shape.camera(device_of(recording), folders)[1]
    except CameraFileError as error:
        raise _unusable(recording, error) from error


def first_shape(recording: Recording) -> ImageFormat:
    """Format of its first image.

    Raises:
        RecordingError: it has none, or is damaged.
    """
    for _, data in recording.phone_records():
        with suppress(WireError):
            body = decode(data).body
            if isinstance(body, Picture):
                return ImageFormat.of(body)
    raise RecordingError(recording.path, "holds no picture", "name another recording")


def body_samples(recording: Recording) -> list[BodyImu]:
    """The robot's samples out of the recorded statuses, in the order of time.

    Raises:
        RecordingError: a status can't be read.
    """
    samples: list[BodyImu] = []
    for entry in recording.entries(STATUS):
        try:
            status = json.loads(entry.data)
            samples += body_imus(status["body_samples"], status.get("body_twists", []))
        except (ValueError, LookupError, TypeError) as error:
            what = f"holds a status that can't be read: {error}"
            raise RecordingError(recording.path, what, "record anew") from error
    return sorted(samples, key=lambda sample: sample.t)


def _unusable(recording: Recording, error: ValueError) -> RecordingError:
    return RecordingError(recording.path, str(error), "a recording with both files")
