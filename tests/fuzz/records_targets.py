"""What a page sends over its sockets: records, messages, a viewpoint."""

from math import isfinite
from pathlib import Path

import msgspec

from server.common.runtime_parameters import Tune
from server.phone.ingest import EncodedFrame, Ingest
from server.protocol import messages, wire
from server.protocol.calibration_messages import Calibrate, Calibration
from server.protocol.lead_messages import Lead
from server.protocol.video_path_messages import PathChoice
from server.protocol.wire import MAX_MESSAGE_BYTES, MAX_PIXELS, MAX_RECORD_BYTES, WireError
from server.protocol.wire_records import (
    Codec,
    Credit,
    Motion,
    Picture,
    Ping,
    Pong,
    Record,
    Stamp,
    Thumbnail,
    Touch,
)
from server.recording.reader import read
from server.recording.writer import PHONE_MESSAGES, PHONE_RECORDS, SERVER_MESSAGES, SERVER_RECORDS
from server.view import viser_proxy
from tests.fuzz.sequence import pieces, together
from tests.fuzz.target import target

DATA = Path(__file__).parents[1] / "data"
JSON_FAULTS = (msgspec.MsgspecError, UnicodeDecodeError, RecursionError)


def recorded(*topics: str, most: int, longest: int = 2000) -> list[bytes]:
    """The first items of a recording that are not too long."""
    entries = read(DATA / "chromium.mcap").entries(*topics)
    found: list[bytes] = []
    for entry in entries:
        if len(entry.data) <= longest and entry.data[:4] not in {data[:4] for data in found[most:]}:
            found.append(entry.data)
        if len(found) >= 2 * most:
            break
    return found


def record_seeds():
    bodies = (
        Motion((0.1, -0.2, 0.3), (0.0, 9.8, 0.1), None, 0),
        Motion((70.0, -70.0, 0.0), (320.0, 0.0, -320.0), (0.5, -0.5, 0.5, 0.5), 270),
        Picture(Codec.JPEG, True, 1280, 720, 90, b"\xff\xd8 not really"),
        Picture(Codec.H264, False, 16, 16, 0, b"\0\0\1\x65", shrunk=2, by_arrival=True),
        Picture(Codec.VP8, True, 1680, 1250, 180, b"\x10\2\0\x9d\1\x2a"),
        Touch(True, True, 3, 2**63 + 5),
        Pong(7, -1),
        Stamp(90_000),
        Ping(2**64 - 1),
        Credit(12),
        Thumbnail(b"\xff\xd8\xff"),
    )
    records = [wire.encode(Record(k, 1000 * k, body)) for k, body in enumerate(bodies)]
    return records + recorded(PHONE_RECORDS, SERVER_RECORDS, most=6)


def check_ranges(record: Record) -> None:
    """No decoded value is outside of what PROTOCOL.md declares."""
    assert 0 <= record.sequence < 1 << 32
    assert 0 <= record.t_us < 1 << 60
    body = record.body
    if isinstance(body, Motion):
        assert all(abs(w) <= 70.0 for w in body.rotation_rate)
        assert all(abs(a) <= 320.0 for a in body.acceleration)
        assert body.screen_angle_deg in (0, 90, 180, 270)
        if body.orientation_wxyz is not None:
            assert 0.9 < sum(q * q for q in body.orientation_wxyz) < 1.1
    elif isinstance(body, Picture):
        assert min(body.width, body.height) >= 16
        assert body.width * body.height <= MAX_PIXELS
        assert body.shrunk in (0, 1, 2)
        assert 0 < len(body.data) <= MAX_RECORD_BYTES


@target("records", record_seeds, (WireError,), max_bytes=2048, mutants=6000)
def records(data: bytes) -> None:
    record = wire.decode(data)
    check_ranges(record)
    again = wire.encode(record)  # without what nobody reads: unknown flags, padding
    assert len(again) == len(data)
    assert wire.decode(again) == record
    assert wire.encode(wire.decode(again)) == again


def stream_seeds():
    pings = [Ingest(lambda: 5).ping(0.1 * k).body for k in range(1)]
    assert pings[0].nonce == 5
    said = [
        Record(1, 2_000_000, Pong(1, 0)),
        Record(1, 2_010_000, Pong(2, 0)),
        Record(1, 2_020_000, Pong(3, 0)),
        Record(2, 2_030_000, Motion((0.1, 0.2, 0.3), (0.0, 9.8, 0.1), None, 90)),
        Record(3, 2_031_000, Touch(True, True, 1, 2)),
        Record(4, 2_032_000, Picture(Codec.JPEG, True, 64, 48, 0, b"\xff\xd8..")),
    ]
    yield together([wire.encode(record) for record in said])
    yield together(recorded(PHONE_RECORDS, most=8))


@target("stream", stream_seeds, max_bytes=4096)
def stream(data: bytes) -> int:
    """A phone's records one after the other: what they become is finite, and in order."""
    nonces, said = iter(range(1, 1 << 16)), pieces(data)
    ingest = Ingest(lambda: next(nonces))
    t_motion = -float("inf")
    for k, piece in enumerate(said):
        now = 1.0 + 0.02 * k
        ingest.ping(now - 0.01)
        try:
            signal = ingest.record(wire.decode(piece), now)
        except WireError:
            continue
        if signal is not None:
            assert isfinite(signal.t)
            assert signal.t <= now + 0.05
        if hasattr(signal, "omega_m_cf_in_c"):
            assert signal.t > t_motion
            t_motion = signal.t
            assert abs(signal.omega_m_cf_in_c).max() <= 70.0 * 3
        if isinstance(signal, EncodedFrame):
            assert signal.t_received == now
    return len(said)


def message_seeds():
    said = (
        messages.Hello(2, "operator", "a phone", "s", "devicemotion", "H.264"),
        messages.Command("arm"),
        Tune(cutoff_hz=0.5, guard=True),
        Lead(0.5, "level"),
        messages.Log("a fault"),
        PathChoice("auto", "operator"),
        Calibrate("start"),
    )
    return [messages.encode_message(m).encode() for m in said] + recorded(PHONE_MESSAGES, most=6)


@target("messages", message_seeds, (WireError,), max_bytes=5000, mutants=6000)
def decode_message(data: bytes) -> None:
    message = messages.decode_message(data)
    assert len(data) <= MAX_MESSAGE_BYTES
    text = messages.encode_message(message)
    if len(text) <= MAX_MESSAGE_BYTES:  # what was left out is written
        assert messages.decode_message(text) == message


def from_server_seeds():
    said = (
        messages.Welcome("session", 2, "ames", 1280, 720, 30, 3_000_000),
        messages.Refused("value", "motion", "finite"),
        messages.Command("key_frame"),
        PathChoice("WebRTC", "supervisor"),
        Calibration("filming", progress=0.5, tasks={"tilt": 0.2}, cells=[1, 2, 3]),
    )
    seeds = [messages.encode_message(m).encode() for m in said]
    return seeds + recorded(SERVER_MESSAGES, most=3, longest=6000)


@target("from_server", from_server_seeds, JSON_FAULTS, max_bytes=8192)
def decode_from_server(data: bytes) -> None:
    message = messages.decode_from_server(data)
    assert messages.decode_from_server(messages.encode_message(message)) == message


def viewpoint_seeds():
    camera = viser_proxy.ViewerCamera(
        (1.0, 0.0, 0.0, 0.0), (1.0, 2.0, 3.0), 0.8, 0.01, 1000.0, 600, 800,
        (0.0, 0.0, 0.0), (0.0, 0.0, 1.0),
    )  # fmt: skip
    yield msgspec.msgpack.encode(camera)
    yield msgspec.msgpack.encode({"type": "ShareUrlRequest"})


@target("viewpoint", viewpoint_seeds, max_bytes=2200, mutants=4000)
def camera_only(data: bytes) -> None:
    """Nothing but a viewpoint goes on to viser, of finite numbers and in our own bytes."""
    onward = viser_proxy.camera_only(data)
    if onward is None:
        return
    said = msgspec.msgpack.decode(onward)
    assert said.pop("type") == "ViewerCameraMessage"
    assert set(said) == set(viser_proxy.ViewerCamera.__struct_fields__)
    assert all(
        isfinite(number)
        for value in said.values()
        for number in (value if isinstance(value, list) else [value])
    )
    assert viser_proxy.camera_only(onward) == onward
