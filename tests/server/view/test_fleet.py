"""Servers of a machine as one of them sees them: alive, starting, silent, killed, or ended."""

from __future__ import annotations

import asyncio
import json
from contextlib import ExitStack
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from threading import Thread

import msgspec
import pytest

from server.common.runtime import LAUNCH_FILE, RUN_FILE, Launch, prepare, runtime_directory
from server.process.ports import listen
from server.view import fleet
from server.view.fleet import Fleet, FleetAnswer, seen
from tests.server.house import control_status
from tests.server.live_server import LiveServer

KEY = "k" * 22
STATUS = {
    "type": "status",
    "mode": "TRACK",
    "reason": "The robot follows.",
    "robot": "ames",
    "operator": "Pixel",
    "latency_ms": {"arrival": 60.0, "detect": 2.04},
    "people": [{"name": "Eva", "leads": False}, {"name": "Anna", "leads": True}],
    "battery_v": 11.1,
}


class StatusServer(ThreadingHTTPServer):
    """Says a status to who has the key, and counts who asks."""

    def __init__(self):
        super().__init__(("127.0.0.1", 0), StatusHandler)
        self.asked = 0
        self.said = STATUS


class StatusHandler(BaseHTTPRequestHandler):
    server: StatusServer

    def do_GET(self):
        self.server.asked += 1
        is_known = self.headers["Authorization"] == f"Bearer {KEY}"
        body = json.dumps(self.server.said if is_known and self.path == "/api/status" else {})
        self.send_response(200)
        self.end_headers()
        self.wfile.write(body.encode())

    def log_message(self, *words):
        """Nothing."""


@pytest.fixture
def other():
    with StatusServer() as server:
        thread = Thread(target=server.serve_forever, kwargs={"poll_interval": 0.01})
        thread.start()
        yield server
        server.shutdown()
        thread.join()


@pytest.fixture
def launched(runtime_base):
    """Writes what a launcher and its server leave in their directory; `runs` holds its lock."""
    with ExitStack() as stack:

        def make(name, port=1, key=KEY, runs=True, serves=True):
            directory = runtime_directory(name)
            lock = prepare(directory, runtime_directory())
            stack.enter_context(lock) if runs else lock.close()
            told = Launch(name, "robots/ames.toml", 8443, port)
            (directory / LAUNCH_FILE).write_bytes(msgspec.json.encode(told))
            if serves:
                (directory / RUN_FILE).write_text(json.dumps({"operator_token": key}))
            return directory

        yield make


def states():
    return {one.name: one.state for one in asyncio.run(seen())}


def test_each_server_is_as_it_is(launched, other, monkeypatch):
    monkeypatch.setattr(fleet, "ANSWER_S", 0.2)
    with listen("127.0.0.1", 0) as deaf:
        launched("", serves=False)
        launched("killed", runs=False)
        launched("hurt", runs=False, serves=False)
        launched("deaf", deaf.getsockname()[1])
        launched("refuses", other.server_port, key="of another run")
        launched("dead", 1)
        (launched("ended", runs=False) / LAUNCH_FILE).unlink()
        assert states() == {
            "": "starting",
            "dead": "silent",
            "deaf": "silent",
            "hurt": "gone",
            "killed": "gone",
            "refuses": "silent",
        }


def test_of_a_live_one_mode_and_why_leader_latency_and_battery_are_told(launched, other):
    launched("left", other.server_port)
    [left] = asyncio.run(seen())
    assert (left.state, left.mode, left.reason) == ("live", "TRACK", "The robot follows.")
    assert (left.leader, left.latency_ms, left.battery_v) == ("Anna, Pixel", 62.0, 11.1)
    assert (left.robot, left.https_port, left.http_port) == ("ames", 8443, other.server_port)


def test_without_a_phone_nobody_leads_and_no_latency_is_told(launched, other):
    other.said = {**STATUS, "operator": "", "latency_ms": {}, "people": []}
    del other.said["battery_v"]
    launched("left", other.server_port)
    [left] = asyncio.run(seen())
    assert (left.leader, left.latency_ms, left.battery_v) == ("", None, None)


def test_however_many_ask_each_server_is_asked_twice_a_second_at_most(launched, other):
    t = 0.0
    one = Fleet(lambda: t)

    async def asked_by_many():
        return {(await reply).body for reply in [one._reply() for _ in range(20)]}

    launched("left", other.server_port)
    [body] = asyncio.run(asked_by_many())
    assert [one.name for one in msgspec.json.decode(body, type=FleetAnswer).servers] == ["left"]
    assert other.asked == 1
    t = fleet.SHOWN_S
    asyncio.run(asked_by_many())
    assert other.asked == 2


def test_a_real_servers_status_is_understood(launched, tmp_path):
    (tmp_path / "live").mkdir()
    live = LiveServer(tmp_path / "live")

    async def looked_at():
        async with live.running():
            launched("", live.port, live.doors.operator_token)
            while live.manager._shown is None:
                live.control.send(control_status(mode=0))
                await asyncio.sleep(0.01)
            return await seen()

    [one] = asyncio.run(looked_at())
    assert (one.state, one.robot, one.leader) == ("live", "ames", "")
    live.control.close()
