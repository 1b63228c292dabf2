"""The check of a phone over real sockets: who may ask, and what of a phone is told."""

from __future__ import annotations

import asyncio
import json
import urllib.request
from pathlib import Path
from typing import Any

import pytest

from server.protocol.wire_records import Motion
from server.security.security import cookie_name
from tests.server.house import HOST, JPEG, House, house_in
from tests.server.web.test_people import Browser, play

WXYZ = (1.0, 0.0, 0.0, 0.0)


@pytest.fixture
def house(tmp_path: Path) -> Any:
    with house_in(tmp_path) as made:
        yield made


def asked(house: House, cookie: str, seconds: float) -> dict[str, Any]:
    """What a page with that cookie is told."""
    url = f"http://{HOST}:{house.port}/api/check?seconds={seconds}"
    request = urllib.request.Request(url, headers={"Cookie": cookie})
    with urllib.request.urlopen(request, timeout=5.0) as response:
        answer: dict[str, Any] = json.loads(response.read())
        return answer


def test_a_viewer_is_told_what_came_of_the_phone_and_what_did_not_is_no_number(
    house: House,
) -> None:
    async def scene() -> None:
        name = cookie_name(False, f"{HOST}:{house.port}")
        cookie = f"{name}={Browser(house, 'viewer', 'Vera').value}"
        async with house.operator("<b>mine</b>") as phone, house.page("/ws/video") as video:
            await phone.synchronise()
            assert house.manager.phone is not None
            await video.hello("video", session=house.manager.phone.id)
            for k in range(20):
                await phone.send(Motion((0.0, 0.0, 0.01 * k), (0.0, 9.81, 0.0), WXYZ, 90), k)
                await phone.answer()
            await video.send(JPEG)
            await video.until("refused")  # nobody has calibrated it
            answer = await asyncio.to_thread(asked, house, cookie, 60.0)
        report, found = answer["report"], answer["report"]["figures"]
        assert found["device"] == "<b>mine</b>"
        assert "&lt;b&gt;mine" in answer["page"]
        assert "<b>" not in answer["page"]
        assert found["size"] == "1280x720"
        assert found["motion_hz"] > 10.0
        assert found["age_ms"][0] >= 0.0
        assert found["glass"] is None
        assert found["noise_px"] is None
        assert all("nan" not in line["value"] for line in report["lines"])
        assert report["grade"] == "poor"
        assert any("camera" in one["value"] for one in report["lines"] if one["grade"] == "poor")
        assert 0.0 < answer["heard_s"] < 60.0

    play(house, scene)
