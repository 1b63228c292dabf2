"""Files from people: robots, LEDs, cameras, recordings of somebody else."""

import atexit
import io
import shutil
import tempfile
from itertools import pairwise
from pathlib import Path

import msgspec
import numpy as np
from mcap.writer import CompressionType, Writer

from hardware.camera_file import CAMERAS, CameraFileError, load_camera
from hardware.led_file import COUNTS, load_leds
from hardware.led_layout.file import load_layout
from hardware.robot_file import COMMANDS, ROBOTS, RobotFileError, load_robot
from server.export.decoded import DecodedRecording
from server.protocol.wire import VERSION, encode
from server.protocol.wire_records import Codec, Picture, Pong, Record, Touch
from server.recording.reader import device_of, read, recover
from server.recording.writer import CAMERA_KEY, DEVICE_KEY, ENCODINGS, ROBOT_KEY, RecordingError
from server.replay.dates import timed
from server.replay.setting import body_samples, first_shape, recorded_camera
from tests.fuzz.target import target

FOLDER = Path(tempfile.mkdtemp(prefix="lightleash-fuzz-"))
atexit.register(shutil.rmtree, FOLDER, ignore_errors=True)
KALIBR = """cam0:
  camera_model: pinhole
  distortion_coeffs: [0.1, -0.2, 0.001, 0.002]
  distortion_model: radtan
  intrinsics: [900.0, 901.0, 640.0, 360.0]
  resolution: [1280, 720]
  line_delay: 2.0e-05
"""
CAMERA_INFO = """image_width: 1280
image_height: 720
camera_name: a-phone
camera_matrix: {rows: 3, cols: 3, data: [900.0, 0.0, 640.0, 0.0, 900.0, 360.0, 0.0, 0.0, 1.0]}
distortion_model: plumb_bob
distortion_coefficients: {rows: 1, cols: 5, data: [0.1, 0.0, 0.0, 0.0, 0.0]}
rolling_shutter_readout_s: 0.02
screen_angle_deg: 90
camera_imu: {rotation: [1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0], time_offset_s: 0.01}
"""
LEDS = "name = 'five'\nleds = [\n" + "".join(
    f"{{position_in_body_m = [{x}, {y}, 0.0], reach_m = 0.05}},\n"
    for x, y in ((0.1, 0.0), (-0.1, 0.0), (0.0, 0.1), (0.0, -0.12), (0.05, 0.05))
)
LEDS += "]\n[start]\ndistance_m = 2.0\nabove_m = 0.5\n"


def file_of(name: str, data: bytes) -> Path:
    path = FOLDER / name
    path.write_bytes(data)
    return path


def robot_seeds():
    return [path.read_bytes() for path in sorted(ROBOTS.glob("*.toml"))]


@target("robot_file", robot_seeds, (RobotFileError,), max_bytes=16_384, mutants=300)
def robot_file(data: bytes) -> None:
    made = load_robot(file_of("robot.toml", data), takes=COMMANDS)
    assert np.isfinite(made.robot.A).all()
    assert made.robot.A.shape[0] == 6
    assert np.isfinite(made.robot.leds_in_b).all()
    assert 0.0 < made.robot.ramp_s < 60.0
    drive = made.robot.twist
    if drive is not None:
        assert made.robot.A.shape[1] == 0
        assert 0.0 < drive.stop_s <= 0.11 * (1.0 + 1e-9)
        assert drive.phase_margin(max(drive.position_gain, drive.attitude_gain)) > 0.5
        return
    assert 0.0 <= made.robot.f_min < made.robot.f_max
    assert made.gains


def led_seeds():
    return [
        LEDS.encode(),
        LEDS.replace(
            "reach_m = 0.05", "reach_box_m = [[-1.0, -1.0, -1.0], [1.0, 1.0, 1.0]]"
        ).encode(),
    ]


@target("led_file", led_seeds, (RobotFileError,), max_bytes=4096)
def led_file(data: bytes) -> None:
    path = file_of("leds.toml", data)
    _, leds = load_leds(path)
    assert COUNTS[0] <= len(leds) <= COUNTS[1]
    assert np.isfinite(leds).all()
    layout = load_layout(str(path))
    assert len(layout.reaches) == len(leds)


def camera_seeds():
    yield from (path.read_bytes() for path in sorted(CAMERAS.glob("*.yaml"))[:3])
    yield KALIBR.encode()
    yield CAMERA_INFO.encode()
    yield "".join(f"{a}: &{a} [*{b}, *{b}]\n" for a, b in pairwise("hgfedcb")).encode()
    yield CAMERA_INFO.replace("900.0, 0.0", "!!float 900, 0x0", 1).encode()
    yield CAMERA_INFO.replace("a-phone", "2001-12-14").encode()


@target("camera_file", camera_seeds, (CameraFileError,), max_bytes=4096, mutants=600)
def camera_file(data: bytes) -> None:
    _, camera = load_camera(file_of("camera.yaml", data))
    assert 16 <= camera.width <= 8192
    assert 16 <= camera.height <= 8192
    assert np.isfinite(camera.K).all()
    assert np.isfinite(camera.distortion).all()
    assert camera.K[0, 0] > 0.0


def recorded(compression: CompressionType) -> bytes:
    """A small recording in the layout of `server.recording.writer`."""
    stream = io.BytesIO()
    writer = Writer(stream, chunk_size=600, compression=compression)
    writer.start(profile="lightleash", library="lightleash")
    metadata = {
        DEVICE_KEY: "a phone",
        ROBOT_KEY: "",
        CAMERA_KEY: CAMERA_INFO,
        "protocol_version": str(VERSION),
    }
    writer.add_metadata("lightleash", metadata)
    channels = {t: writer.register_channel(t, e, schema_id=0) for t, e in ENCODINGS.items()}
    sample = [0.1 * k for k in range(7)]
    status = msgspec.json.encode({"t": 1.0, "mode": 2, "body_samples": [sample]})
    bodies = (
        Pong(1, 1_000_000),
        Touch(True, True, 1, 1),
        Picture(Codec.JPEG, True, 1280, 720, 90, b"\xff\xd8" + 300 * b"."),
        Pong(2, 1_200_000),
    )
    for k, body in enumerate(bodies):
        t = 1_000_000_000 + 10_000_000 * k
        data = encode(Record(k, 1_000_000 + 10_000 * k, body))
        writer.add_message(channels["phone/records"], t, data, t)
        writer.add_message(channels["server/messages"], t, b'{"type":"command","what":"arm"}', t)
        writer.add_message(channels["control/status"], t, status, t)
    writer.finish()
    return stream.getvalue()


def recording_seeds():
    return [
        recorded(kind) for kind in (CompressionType.NONE, CompressionType.ZSTD, CompressionType.LZ4)
    ]


@target("recording", recording_seeds, (RecordingError,), max_bytes=8192, mutants=300)
def recording(data: bytes) -> None:
    """Read as `lightleash replay` does."""
    opened = read(file_of("somebody.mcap", data))
    assert len(timed(opened)) <= len(data)
    assert sum(1 for _ in opened.entries()) <= len(data)
    device_of(opened)
    samples = body_samples(opened)
    assert all(a.t <= b.t for a, b in pairwise(samples))
    assert sum(1 for _ in DecodedRecording(opened).items()) <= len(data)
    recorded_camera(opened, first_shape(opened))


@target("recover", recording_seeds, (RecordingError,), max_bytes=8192, mutants=300)
def rescue(data: bytes) -> None:
    """What is rescued can be read, or has no phone in it."""
    part = file_of("crashed.mcap.part", data)
    whole = recover(part)
    assert not part.exists()
    with whole.open("rb") as stream:
        assert stream.read(8) == b"\x89MCAP0\r\n"
    assert sum(1 for _ in read(whole).entries()) <= len(data)
