"""A page whose encoder can't keep up sends fewer, then smaller pictures, and says so."""

from __future__ import annotations

import time
from pathlib import Path

import pytest

from server.protocol.wire import decode
from server.protocol.wire_records import Picture
from server.recording.reader import read
from server.replay.offline import run_offline
from tests.e2e.chromium_phone import ChromiumPhone
from tests.e2e.chromium_rig import led_server
from tests.e2e.serving import Serving

pytestmark = [pytest.mark.e2e, pytest.mark.flight]
SLOW = """
(() => {
  window.isSlow = false;
  const { getStats } = RTCRtpSender.prototype;
  RTCRtpSender.prototype.getStats = async function () {
    const reports = await getStats.call(this);
    if (!window.isSlow) return reports;
    const slow = (report) => ({
      ...report,
      framesEncoded: Math.floor(report.framesEncoded / 3),
      qualityLimitationReason: 'cpu',
    });
    return new Map([...reports].map(([id, report]) =>
      [id, report.type === 'outbound-rtp' ? slow(report) : report]));
  };
})();
"""
"""Statistics as they are on a phone that is too slow."""


def wait_for(server: Serving, phone: ChromiumPhone, fits, seconds: float = 30.0) -> dict:
    """Play until the status fits."""
    end = time.monotonic() + seconds
    while time.monotonic() < end:
        phone.play(0.1)
        status = server.request("GET", "/api/status")
        if fits(status):
            return status
    raise AssertionError(f"{phone.words()} {status}")


def test_pictures_become_fewer_then_smaller_and_the_robot_is_seen_at_every_size(
    chromium: str, tmp_path: Path
) -> None:
    with led_server(chromium, tmp_path, "moving", seed=2, rest_s=0.0) as (server, _, phone):
        phone.page.add_init_script(SLOW)
        phone.page.goto(f"{server.local_https}/{server.link()}")
        phone.page.tap("#start")
        wait_for(server, phone, lambda s: s["video_path"].startswith("WebRTC") and s["leds"] == 5)
        server.request("POST", "/api/recording")
        phone.page.evaluate("isSlow = true")
        phone.play_until("document.querySelector('#h-fps').innerText.includes('↓')", 15.0)
        phone.play_until("document.body.innerText.includes('20 pictures a second')", 10.0)
        phone.play_until("document.querySelector('#h-fps').innerText.includes('½')", 40.0)
        wait_for(server, phone, lambda s: s["leds"] == 5)
        phone.play(2.0)
        phone.page.select_option("#path-wish", "WebSocket")
        wait_for(server, phone, lambda s: s["video_path"] == "websocket, H264" and s["leds"] == 5)
        phone.play(2.0)
        said = server.request("GET", "/api/status")["events"]
        assert isinstance(said, list)
        assert any("can’t keep up" in event["text"] for event in said)
        recording = read(Path(str(server.request("DELETE", "/api/recording")["path"])))
    bodies = [decode(data).body for _, data in recording.phone_records()]
    sizes = [(b.width, b.height, b.shrunk) for b in bodies if isinstance(b, Picture)]
    assert list(dict.fromkeys(sizes)) == [(640, 360, 0), (480, 270, 1), (320, 180, 2)]
    run_offline(recording, tmp_path / "run.csv")
    rows = (tmp_path / "run.csv").read_text().splitlines()[1:]
    found = [row.split(",")[3] == "1" for row in rows]
    assert sum(found[-20:]) >= 15  # of the small ones too
