"""The page's bytes are the server's: `protocol.js` against `server.protocol.wire`, both ways."""

from __future__ import annotations

import json
import random
import shutil
import struct
import subprocess
from pathlib import Path
from typing import Any

import pytest

from server.protocol import wire, wire_records
from server.protocol.messages import Command, Hello, Log, Welcome, decode_message, encode_message
from server.protocol.wire_records import Record

NODE = shutil.which("node")
pytestmark = pytest.mark.skipif(
    NODE is None, reason="!!! no node: the page's bytes are NOT checked"
)

SOURCES = Path(__file__).resolve().parents[2] / "web_client" / "src"
DRIVER = """
import * as p from %s;
let text = '';
for await (const part of process.stdin) text += part;
const unhex = (hex) => new Uint8Array(Buffer.from(hex, 'hex'));
const { encode, decode } = JSON.parse(text);
const encoders = {
  motion: ({ sequence, t_us, ...motion }) => p.encodeMotion(sequence, t_us, motion),
  frame: ({ sequence, t_us, data, ...picture }) =>
    p.encodeFrame(sequence, t_us, { ...picture, data: unhex(data) }),
  touch: ({ sequence, t_us, ...touch }) =>
    p.encodeTouch(sequence, t_us, { ...touch, nonce: BigInt(touch.nonce) }),
  pong: ({ sequence, t_us, ...ping }) =>
    p.encodePong(sequence, t_us, { nonce: BigInt(ping.nonce), tUs: ping.server_time_us }),
};
const plain = (key, value) => typeof value === 'bigint' ? String(value)
  : value instanceof Uint8Array ? Buffer.from(value).toString('hex') : value;
console.log(JSON.stringify({
  encoded: encode.map(([kind, record]) => Buffer.from(encoders[kind](record)).toString('hex')),
  decoded: decode.map((hex) => p.decodeRecord(unhex(hex).buffer)),
  constants: { version: p.VERSION, kinds: p.Kind, codecs: p.Codec, bytes: p.MAX_RECORD_BYTES },
}, plain));
"""


def in_node(encode: list[Any] | None = None, decode: list[str] | None = None) -> dict[str, Any]:
    script = DRIVER % json.dumps((SOURCES / "wire" / "protocol.js").as_uri())
    done = subprocess.run(
        [str(NODE), "--input-type=module", "--eval", script],
        input=json.dumps({"encode": encode or [], "decode": decode or []}),
        capture_output=True,
        text=True,
        timeout=60,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    answer: dict[str, Any] = json.loads(done.stdout)
    return answer


def single(value: float) -> float:
    """The nearest number a float32 can hold."""
    nearest: float = struct.unpack("<f", struct.pack("<f", value))[0]
    return nearest


def random_records(rng: random.Random, count: int) -> list[Record]:
    def singles(limit: float, n: int) -> tuple[float, ...]:
        return tuple(single(rng.uniform(-limit, limit)) for _ in range(n))

    def body() -> wire_records.Body:
        angle = rng.choice([0, 90, 180, 270])
        match rng.randrange(4):
            case 0:
                quaternion = rng.choice([None, (0.5, -0.5, 0.5, -0.5), (0.0, 0.0, 0.0, 1.0)])
                return wire_records.Motion(singles(70, 3), singles(320, 3), quaternion, angle)
            case 1:
                codec = rng.choice(list(wire_records.Codec))
                data = b"\xff\xd8" + rng.randbytes(rng.randrange(1, 300))
                return wire_records.Picture(codec, rng.random() < 0.5, 1280, 720, angle, data)
            case 2:
                flags = rng.random() < 0.5, rng.random() < 0.5
                return wire_records.Touch(*flags, rng.getrandbits(32), rng.getrandbits(64))
            case _:
                return wire_records.Pong(rng.getrandbits(64), rng.getrandbits(53))

    return [Record(rng.getrandbits(32), rng.getrandbits(50), body()) for _ in range(count)]


def for_the_page(record: Record) -> tuple[str, dict[str, Any]]:
    body = record.body
    head = {"sequence": record.sequence, "t_us": record.t_us}
    fields = {name: getattr(body, name) for name in body.__slots__}
    match body:
        case wire_records.Motion():
            return "motion", head | fields
        case wire_records.Picture():
            return "frame", head | fields | {"codec": int(body.codec), "data": body.data.hex()}
        case wire_records.Touch():
            return "touch", head | fields | {"nonce": str(body.nonce)}
        case wire_records.Pong():
            return "pong", head | fields | {"nonce": str(body.nonce)}
    raise AssertionError(body)


def test_what_the_page_encodes_the_server_decodes_bit_for_bit() -> None:
    records = random_records(random.Random(7), 400)
    encoded = in_node(encode=[for_the_page(record) for record in records])["encoded"]
    for record, text in zip(records, encoded, strict=True):
        assert bytes.fromhex(text) == wire.encode(record)
        assert wire.decode(bytes.fromhex(text)) == record


def test_what_the_server_encodes_the_page_decodes() -> None:
    rng = random.Random(8)
    for_pages = [
        Record(rng.getrandbits(32), rng.getrandbits(50), body)
        for _ in range(50)
        for body in (
            wire_records.Ping(rng.getrandbits(64)),
            wire_records.Credit(rng.getrandbits(32)),
            wire_records.Thumbnail(rng.randbytes(40)),
        )
    ]
    decoded = in_node(decode=[wire.encode(record).hex() for record in for_pages])["decoded"]
    for record, got in zip(for_pages, decoded, strict=True):
        assert (got["sequence"], got["tUs"]) == (record.sequence, record.t_us)
        match record.body:
            case wire_records.Ping(nonce):
                assert (got["kind"], got["nonce"]) == (wire.Kind.PING, str(nonce))
            case wire_records.Credit(sequence):
                assert (got["kind"], got["taken"]) == (wire.Kind.CREDIT, sequence)
            case wire_records.Thumbnail(data):
                assert (got["kind"], got["data"]) == (wire.Kind.PICTURE, data.hex())


def test_page_and_server_have_the_same_constants() -> None:
    assert in_node()["constants"] == {
        "version": wire.VERSION,
        "kinds": {kind.name: int(kind) for kind in wire.Kind},
        "codecs": {codec.name: int(codec) for codec in wire_records.Codec},
        "bytes": wire.MAX_RECORD_BYTES,
    }


def test_the_messages_the_page_writes_are_taken_by_the_server() -> None:
    hello = (
        '{"type":"hello","version":2,"role":"operator","session":"","device":"Pixel 7 / camera2 0",'
        '"sensors":"DeviceMotion","video":"H.264"}'
    )
    assert decode_message(hello) == Hello(
        2, "operator", "Pixel 7 / camera2 0", "", "DeviceMotion", "H.264"
    )
    assert decode_message('{"type":"command","what":"stop"}') == Command("stop")
    assert decode_message('{"type":"log","text":"x"}') == Log("x")
    welcome = json.loads(encode_message(Welcome("s", 1, "ames", 1280, 720, 30, 4_000_000)))
    assert welcome["type"] == "welcome"
