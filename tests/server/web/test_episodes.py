"""Tasks and discarded presses, from a supervisor's page into the recording and its export."""

from __future__ import annotations

import asyncio
from pathlib import Path

import httpx2
import pytest
from starlette.testclient import TestClient

from pipeline.signals import TouchState
from server.export.decoded import DecodedRecording
from server.export.episodes import episodes
from server.protocol.wire_records import Touch
from server.recording.episodes import TaskNote, VerdictNote, decode_note
from server.recording.reader import read
from server.recording.writer import EPISODES
from tests.server.house import HOST, house_in


@pytest.mark.e2e
def test_what_a_supervisor_says_of_presses_is_in_the_recording(tmp_path):
    """A real phone's session presses three times; the second press is discarded, the third kept."""

    async def scene(house) -> Path:
        key = {"Authorization": f"Bearer {house.doors.supervisor_token}", "X-Lightleash": "1"}
        async with house.open(), house.operator() as page, house.supervisor() as watcher:
            base = f"http://{HOST}:{house.port}"
            async with httpx2.AsyncClient(base_url=base, headers=key, trust_env=False) as client:
                nonce, sequence = await page.synchronise(), 10

                async def say(path: str, **body: object) -> httpx2.Response:
                    return await client.post(f"/api/{path}", json=body)

                async def touch(held: bool, press: int) -> None:
                    nonlocal sequence
                    sequence += 1
                    await page.send(Touch(held, True, press, nonce), sequence)

                assert (await say("task", text="fetch")).status_code == 202
                assert (await say("episode", press=1, keep=False)).status_code == 409
                await touch(True, 1)
                await touch(False, 1)
                await house.control_hears(is_released)
                await client.post("/api/recording")
                await watcher.until("status", task="fetch", episode=None)
                for press in (2, 3, 4):
                    await touch(True, press)
                    await watcher.until("status", episode={"press": press, "keep": True})
                    if press == 3:
                        assert (await say("episode", press=2, keep=False)).status_code == 409
                        assert (await say("episode", press=3, keep=False)).json() == {
                            "press": 3,
                            "keep": False,
                        }
                        await watcher.until("status", episode={"press": 3, "keep": False})
                        await say("task", text="put back")
                    if press == 4:
                        for keep in (False, True):
                            await say("episode", press=4, keep=keep)
                    await touch(False, press)
                path = (await client.delete("/api/recording")).json()["path"]
                assert (await say("episode", press=4, keep=False)).status_code == 409
                return Path(path)

    with house_in(tmp_path) as house:
        recording = read(asyncio.run(scene(house)))
    notes = [decode_note(entry.data) for entry in recording.entries(EPISODES)]
    assert notes == [
        TaskNote("fetch"),
        VerdictNote(3, keep=False),
        TaskNote("put back"),
        VerdictNote(4, keep=False),
        VerdictNote(4, keep=True),
    ]
    found = episodes(DecodedRecording(recording).items())
    told = [(one.number, one.task, one.keep) for one in found]
    assert told == [(0, "fetch", True), (1, "fetch", False), (2, "put back", True)]


def is_released(message):
    return isinstance(message, TouchState) and not message.held


@pytest.mark.parametrize(
    ("body", "field"),
    [
        ({"text": "two\nlines"}, "text"),
        ({"text": "x" * 201}, "text"),
        ({"text": 3}, "text"),
        ({}, "text"),
    ],
)
def test_a_task_is_a_line(tmp_path, body, field):
    with house_in(tmp_path) as house:
        key = {"Authorization": f"Bearer {house.doors.supervisor_token}"}
        client = TestClient(house.app, base_url="http://127.0.0.1:8080", headers=key)
        answer = client.post("/api/task", json=body)
        assert answer.status_code == 400
        assert answer.json()["field"] == field
        assert house.manager.recordings.task == ""
