"""The record behind a picture is the same in the page and in the server."""

from __future__ import annotations

import json
import random
import shutil
import subprocess
from pathlib import Path

import pytest

from server.rtc.receiving.metadata_trailer import FrameRecord, append, split

NODE = shutil.which("node")
pytestmark = pytest.mark.skipif(
    NODE is None, reason="!!! no node: the page's bytes are NOT checked"
)
SOURCE = (
    Path(__file__).resolve().parents[2] / "web_client" / "src" / "video" / "metadata_trailer.js"
)
DRIVER = f"""
import {{ withTrailer }} from {json.dumps(SOURCE.as_uri())};
let text = '';
for await (const part of process.stdin) text += part;
const unhex = (hex) => new Uint8Array(Buffer.from(hex, 'hex')).buffer;
const whole = JSON.parse(text).map(({{ data, ...record }}) =>
  Buffer.from(withTrailer(unhex(data), record)).toString('hex'));
console.log(JSON.stringify(whole));
"""


def test_what_the_page_appends_the_server_takes_off() -> None:
    rng = random.Random(5)
    pictures, records = [], []
    for _ in range(200):
        turn = [rng.gauss(0.0, 1.0) for _ in range(4)]
        length = sum(q * q for q in turn) ** 0.5
        w, x, y, z = (round(32767 * q / length) / 32767 for q in turn)
        orientation = rng.choice([None, (w, x, y, z)])
        angle = rng.choice([0, 90, 180, 270])
        number, t_us, shrunk = rng.getrandbits(32), rng.getrandbits(50), rng.randrange(3)
        records.append(FrameRecord(number, t_us, angle, orientation, shrunk))
        pictures.append(rng.randbytes(rng.randrange(1, 200)))
    asked = [
        {
            "data": data.hex(),
            "sequence": record.sequence,
            "captureUs": record.t_us,
            "screenAngle": record.screen_angle_deg,
            "orientation": record.orientation_wxyz,
            "shrunk": record.shrunk,
        }
        for data, record in zip(pictures, records, strict=True)
    ]
    done = subprocess.run(
        [str(NODE), "--input-type=module", "--eval", DRIVER],
        input=json.dumps(asked),
        capture_output=True,
        text=True,
        timeout=60,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    for text, data, record in zip(json.loads(done.stdout), pictures, records, strict=True):
        whole = bytes.fromhex(text)
        assert whole == append(data, record)
        plain, said = split(whole)
        assert plain == data
        assert said is not None
        assert said.orientation_wxyz == pytest.approx(record.orientation_wxyz, abs=1e-4)
