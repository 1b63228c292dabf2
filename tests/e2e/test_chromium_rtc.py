"""A real Chromium sends by WebRTC, each picture with its record; when that ends, by websocket."""

from __future__ import annotations

import itertools
import time
from pathlib import Path

import numpy as np
import pytest

from hardware.sim.codec import Decoder
from server.recording_files import read
from server.wire import Motion, Picture, Touch, decode
from tests.e2e.chromium_phone import ChromiumPhone
from tests.e2e.chromium_rig import led_server
from tests.e2e.serving import Serving

pytestmark = pytest.mark.e2e
SECONDS = 8.0
KEEP_CONNECTIONS = """
window.made = [];
window.RTCPeerConnection = class extends RTCPeerConnection {
  constructor(configuration) { super(configuration); made.push(this); }
};
"""
FAIL = "made.at(-1).close(); made.at(-1).dispatchEvent(new Event('connectionstatechange'))"


def path_is(server: Serving, phone: ChromiumPhone, beginning: str) -> float:
    """Play until pictures come this way; how long it took [s]."""
    started = time.monotonic()
    while time.monotonic() < started + 20.0:
        phone.play(0.1)
        if str(server.request("GET", "/api/status")["video_path"]).startswith(beginning):
            return time.monotonic() - started
    raise AssertionError(f"not {beginning}: {phone.words()}")


def test_pictures_go_by_webrtc_with_their_records_by_websocket_when_it_ends_and_back(
    chromium: str, tmp_path: Path
) -> None:
    with led_server(chromium, tmp_path, "moving", seed=2, rest_s=0.0) as (server, _, phone):
        phone.page.add_init_script(KEEP_CONNECTIONS)
        phone.page.goto(f"{server.local_https}/#k={server.operator_token}")
        phone.page.tap("#start")
        path_is(server, phone, "WebRTC, H264, dated by record")
        phone.play(2.0)
        server.request("POST", "/api/recording")
        phone.play(SECONDS)
        recorded = Path(str(server.request("DELETE", "/api/recording")["path"]))
        phone.page.evaluate(FAIL)
        path_is(server, phone, "websocket, H264")
        path_is(server, phone, "WebRTC, H264")
        phone.play_until("document.querySelector('#h-path').innerText === 'WebRTC'", 5.0)
    records = [decode(data) for _, data in read(recorded).phone_records()]
    pictures = [record for record in records if isinstance(record.body, Picture)]
    assert len(pictures) >= 10 * SECONDS  # 30 on a quiet machine
    numbers = [record.sequence for record in pictures]
    gaps = sum(b - a != 1 for a, b in itertools.pairwise(numbers))
    assert gaps <= 0.02 * len(numbers)
    assert all(b > a for a, b in itertools.pairwise(numbers))
    times = np.array([record.t_us for record in pictures])
    assert np.all(np.diff(times) > 0)  # each picture has found a capture of its own
    assert {(r.body.width, r.body.height) for r in pictures} == {(1280, 720)}
    assert sum(isinstance(record.body, Motion) for record in records) >= 25 * SECONDS
    assert sum(isinstance(record.body, Touch) for record in records) >= 10 * SECONDS
    decodes_from_its_first_key(pictures)


def decodes_from_its_first_key(pictures: list) -> None:
    """The recording holds what the page has encoded, as it came."""
    first = next(i for i, record in enumerate(pictures) if record.body.key)
    decoder = Decoder("h264", 1280, 720)
    whole = itertools.takewhile(
        lambda pair: pair[1].sequence - pair[0].sequence == 1, itertools.pairwise(pictures[first:])
    )
    for record, _ in whole:
        assert decoder.decode(record.body.data).shape == (720, 1280)
