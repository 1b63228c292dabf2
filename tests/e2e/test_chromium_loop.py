"""A real Chromium leads the simulated robot, over TLS, through the page as it is, by each way."""

from __future__ import annotations

from functools import partial
from itertools import pairwise
from pathlib import Path

import pytest

from tests.e2e.chromium_rig import flown, led_server, start

pytestmark = [pytest.mark.e2e, pytest.mark.flight]
LEARNT_S, STEADY_S, CHANGED_S = 8.0, 14.0, 4.0
"""Of tracking: the suspension is learnt; then pictures go on by another way, each so long."""
WAYS = {"WebRTC": "WebRTC", "WebSocket": "websocket, H264", "JPEG": "websocket, JPEG"}
"""What the server says of the page's ways."""
CHANGES = ("WebSocket", "JPEG", "WebRTC")


def test_the_robot_follows_by_each_way_does_not_jump_when_it_is_changed_and_stops_on_its_stop(
    chromium: str, tmp_path: Path
) -> None:
    with led_server(chromium, tmp_path, "moving", seed=2, rest_s=4.0) as (server, _, phone):
        refused: list[str] = []
        phone.page.on("console", lambda message: refused.append(message.text))
        start(phone, server)
        phone.play_until("document.querySelector('#h-path').innerText === 'WebRTC'", 25.0)
        came: dict[str, str] = {}

        def look(wish: str) -> None:
            came[wish] = str(server.request("GET", "/api/status")["video_path"])

        starts = [STEADY_S + CHANGED_S * k for k in range(len(CHANGES) + 1)]
        # a flight that a busy machine ended may have left another way
        wishes = [(0.0, partial(phone.choose, "#path-wish", "WebRTC"))]
        for wish, (begin, end) in zip(CHANGES, pairwise(starts), strict=True):
            wishes.append((begin, partial(phone.choose, "#path-wish", wish)))
            wishes.append((end - 0.1, partial(look, wish)))
        flight = flown(phone, server, starts[-1], wishes)
        assert phone.rms_mm(flight.distances, LEARNT_S) <= 40.0
        steady = max(d for t, d in flight.distances if LEARNT_S <= t < STEADY_S)
        for wish, (begin, end) in zip(CHANGES, pairwise(starts), strict=True):
            assert came[wish].startswith(WAYS[wish])
            changed = max(d for t, d in flight.distances if begin <= t < end)
            assert changed <= 1.5 * steady + 0.03, f"{wish}: {flight.account()}"
        streams = flight.status["streams"]
        assert isinstance(streams, dict)
        assert streams["phone_imu"]["rate_hz"] >= 25.0  # 60 on a quiet machine
        assert streams["video"]["rate_hz"] >= 10.0  # 30 on a quiet machine
        phone.page.tap("#stop")
        phone.play_until("document.body.innerText.includes('STOPPED')", 3.0)
        assert not [text for text in refused if "Content Security Policy" in text]
