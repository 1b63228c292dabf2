"""Real websockets: leases, faults that cost only their maker, and words for every refusal."""

from __future__ import annotations

import asyncio

import pytest

from pipeline.signals import PhoneImu, TouchState, VisionMeasurement
from server.common.clock import now
from server.control.ipc_inputs import RequestInput
from server.protocol.session import MAX_FAULTS
from server.protocol.wire import MAX_RECORD_BYTES, encode
from server.protocol.wire_records import Codec, Credit, Motion, Picture, Record, Touch
from server.web.session_manager import SessionManager
from server.web.websocket import Connection
from tests.server.house import JPEG, control_status, eventually, house_in, is_request

pytestmark = pytest.mark.slow  # real sockets, whose server stops by its own tick

FLAT = Motion((0.0, 0.0, 0.0), (0.0, 0.0, 9.81), None, 0)
SIGNALS = (PhoneImu, VisionMeasurement, TouchState, RequestInput)


@pytest.fixture
def server(tmp_path, monkeypatch):
    monkeypatch.setattr("server.web.session_manager.TICK_S", 0.02)
    monkeypatch.setattr("server.web.websocket.PING_S", 0.01)
    with house_in(tmp_path) as house:
        yield house


def play(server, scene):
    async def run():
        async with server.open():
            await scene()

    asyncio.run(run())


FAULTS = [
    ("type", "message", "no JSON"),
    ("value", "message", '{"type": "command", "what": "arm", "force": 1}'),
    ("value", "$.what", '{"type": "command", "what": "fly"}'),
    ("order", "hello", '{"type": "hello", "version": 1, "role": "operator"}'),
    ("size", "record", b""),
    ("size", "touch", encode(Record(1, 1, Touch(True, True, 1, 1)))[:-1]),
    ("role", "record.kind", encode(Record(1, 1, Credit(1)))),
    ("role", "record.kind", encode(Record(1, 1, JPEG))),
    ("value", "touch.nonce", encode(Record(1, 1, Touch(True, True, 1, 99)))),
    (
        "value",
        "motion.rotation_rate",
        encode(Record(1, 1, Motion((float("nan"), 0.0, 0.0), (0.0, 0.0, 9.8), None, 0))),
    ),
]


def test_faults_are_told_by_name_to_their_maker_alone_and_control_hears_nothing(server):
    async def scene():
        async with server.operator() as page, server.supervisor() as watcher:
            server.control.inputs()
            for code, field, data in FAULTS:
                await page.socket.send(data)
                refused = await page.until("refused")
                assert (refused["code"], refused["field"]) == (code, field)
                assert refused["allowed"]
                assert refused["fatal"] is False
            heard = []
            for _ in range(2):
                async with asyncio.timeout(5.0):
                    while isinstance(data := await watcher.socket.recv(), bytes):
                        pass
                heard.append(data)
            assert all('"type":"status"' in text for text in heard)
            assert not [m for m in server.control.inputs() if isinstance(m, SIGNALS)]
            await page.say(type="command", what="stop")
            await server.control_hears(is_request("stop"))

    play(server, scene)


def test_a_page_that_makes_too_many_faults_is_closed_and_no_other(server):
    async def scene():
        async with server.operator() as page, server.supervisor() as watcher:
            for _ in range(MAX_FAULTS + 5):
                await page.socket.send(b"")
            assert (await page.until("refused", fatal=True))["code"] == "size"
            assert await page.closed() == 1008
            await eventually(lambda: server.manager.phone is None)
            await watcher.until("status", phones=0)

    play(server, scene)


@pytest.mark.parametrize(
    "first", ['{"type": "command", "what": "arm"}', '{"type": "hello", "version": 99}', b"L"]
)
def test_who_does_not_say_hello_first_is_refused_and_closed(server, first):
    async def scene():
        async with server.page("/ws/phone") as page:
            await page.socket.send(first)
            assert (await page.until("refused"))["fatal"] is True
            assert await page.closed() == 1008
        assert server.manager.phone is None

    play(server, scene)


def test_a_page_of_another_version_is_told_to_reload(server):
    async def scene():
        async with server.page("/ws/phone") as page:
            await page.say(type="hello", version=99, role="operator")
            refused = await page.until("refused")
            assert (refused["code"], refused["field"]) == ("version", "hello.version")
            assert "reload" in str(refused["allowed"])

    play(server, scene)


def test_a_second_operator_is_refused_while_the_first_lives_and_led_by_when_it_has_gone(server):
    async def scene():
        async with server.operator("first"):
            async with server.page("/ws/phone") as page:
                refused = await page.hello("operator", device="second")
                assert (refused["code"], refused["fatal"]) == ("role", True)
            assert server.manager.phone.device == "first"
        await eventually(lambda: server.manager.phone is None)
        async with server.operator("second"):
            assert server.manager.phone.device == "second"

    play(server, scene)


def test_a_silent_operator_loses_its_place_and_what_it_says_later_reaches_nobody(
    server, monkeypatch
):
    async def scene():
        async with server.operator("first") as first:
            await first.touch(await first.synchronise())
            await server.control_hears(lambda m: isinstance(m, TouchState))
            monkeypatch.setattr("server.web.session_manager.now", lambda: now() + 2.1)
            async with server.operator("second") as second:
                monkeypatch.undo()
                server.control.inputs()
                await first.send(FLAT)
                refused = await first.until("refused")
                assert (refused["code"], refused["fatal"]) == ("role", True)
                await first.closed()
                assert server.manager.phone.device == "second"
                await second.touch(await second.synchronise(), held=True)
                heard = await server.control_hears(lambda m: isinstance(m, TouchState))
                assert not [m for m in heard if isinstance(m, PhoneImu)]

    play(server, scene)


def test_what_a_synchronised_phone_says_reaches_control_on_our_clock(server):
    async def scene():
        began = now()
        async with server.operator() as page:
            nonce = await page.synchronise()
            await page.send(FLAT)
            made = now()
            touch = Record(1, int(1e6 * made), Touch(True, True, 1, nonce))
            await page.socket.send(encode(touch))
            heard = await server.control_hears(lambda m: isinstance(m, TouchState))
            (sample,) = (m for m in heard if isinstance(m, PhoneImu))
            (touch_state,) = (m for m in heard if isinstance(m, TouchState))
            assert sample.t == pytest.approx(made, abs=0.5)
            assert touch_state.held
            assert began <= touch_state.t <= made

    play(server, scene)


def test_stop_reaches_control_from_either_socket(server):
    async def scene():
        async with server.operator() as page, server.supervisor() as watcher:
            for one in (page, watcher):
                await one.say(type="command", what="stop")
                await server.control_hears(is_request("stop"))
            await watcher.say(type="command", what="key_frame")
            await watcher.say(type="command", what="reset")
            heard = await server.control_hears(is_request("reset"))
            assert not list(filter(is_request("key_frame"), heard))

    play(server, scene)


def test_a_picture_without_a_calibration_is_refused_given_back_and_told_in_every_status(server):
    async def scene():
        async with server.operator("Nobody's phone") as page, server.page("/ws/video") as video:
            await page.synchronise()
            await eventually(lambda: server.manager.phone.ingest.clock.ready)
            await video.hello("video", session=server.manager.phone.id)
            await video.send(JPEG, sequence=5)
            refused = await video.until("refused")
            assert (refused["code"], refused["fatal"]) == ("calibration", False)
            credit = await video.record(Credit)
            assert credit.body == Credit(5)
            await page.send(FLAT)
            status = await page.until("status", leds=0)
            while not any("calibrated" in why for why in server.manager.refusals()):
                status = await page.until("status")
            assert status["ready"] is False

    play(server, scene)


def test_pictures_that_cannot_be_dated_yet_are_given_back(server):
    async def scene():
        async with server.operator(), server.page("/ws/video") as video:
            await video.hello("video", session=server.manager.phone.id)
            await video.send(JPEG, sequence=7)
            assert (await video.record(Credit)).body == Credit(7)

    play(server, scene)


@pytest.mark.parametrize("session", ["", "guess"])
def test_pictures_of_a_stranger_are_refused(server, session):
    async def scene():
        async with server.operator(), server.page("/ws/video") as video:
            refused = await video.hello("video", session=session)
            assert (refused["code"], refused["field"]) == ("role", "hello.session")

    play(server, scene)


def test_a_message_beyond_all_bounds_closes_its_connection_only(server):
    async def scene():
        async with server.operator() as page, server.supervisor() as watcher:
            await watcher.socket.send(bytes(MAX_RECORD_BYTES + 5000))
            assert await watcher.closed() == 1009
            await page.until("status", supervisors=0)
            assert server.manager.phone is not None

    play(server, scene)


def test_the_page_that_watches_is_told_who_leads_what_lacks_and_that_control_is_lost(server):
    async def scene():
        async with server.supervisor() as watcher:
            status = await watcher.until("status")
            assert status["mode"] == "LOST"
            assert "is starting" in str(status["reason"])
            server.control.send(control_status(t=now(), reason="Not armed.", refusals=["No phone"]))
            status = await watcher.until("status", mode="DISARMED")
            assert status["refusals"] == ["No phone"]
            assert not status["ready"]
            status = await watcher.until("status", mode="LOST")
            assert "does not answer" in str(status["reason"])
            async with server.operator("one\x1b[31m phone"):
                status = await watcher.until("status", phones=1)
                assert any(
                    event["text"].endswith(" leads: one·[31m phone.") for event in status["events"]
                )

    play(server, scene)


def test_a_page_that_does_not_read_loses_the_oldest_and_holds_up_nobody(server):
    async def scene():
        async with server.supervisor() as watcher, server.operator() as page:
            lazy = next(iter(server.manager.supervisors))
            for k in range(2_000):
                lazy.send(f'{{"type": "{k}"}}')
            assert len(lazy._unsent) <= 16
            await page.say(type="log", text="still here")
            await watcher.until("status", phones=1)

    play(server, scene)


class Stalled:
    """A socket that takes nothing until it is `open`, and keeps what it took."""

    def __init__(self):
        self.open, self.taken = asyncio.Event(), []

    async def send_bytes(self, data):
        await self.open.wait()
        self.taken.append(data)

    send_text = send_bytes


def test_signs_of_life_asked_for_in_a_gap_do_not_queue_and_the_rest_does_not_hold_them_up():
    async def scene():
        socket = Stalled()
        page = Connection(socket)
        writer = asyncio.create_task(page.write())
        page.send("under way")
        await asyncio.sleep(0)
        for k in range(100):
            page.send_newest(b"ping %d" % k)
        page.send("status")
        socket.open.set()
        await eventually(lambda: len(socket.taken) >= 3)
        assert socket.taken == ["under way", b"ping 99", "status"]
        writer.cancel()

    asyncio.run(scene())


def test_a_hub_whose_control_is_gone_says_that_a_stop_did_not_arrive(server, monkeypatch):
    monkeypatch.setattr("server.web.session_manager.INSISTS", 2)
    server.control.close()

    async def scene():
        async with server.supervisor() as watcher:
            await watcher.say(type="command", what="stop")
            manager: SessionManager = server.manager
            await eventually(lambda: any("did not reach" in event.text for event in manager.events))

    play(server, scene)


def test_a_camera_that_changes_its_picture_size_is_looked_up_anew(server):
    async def scene():
        async with server.operator() as page, server.page("/ws/video") as video:
            await page.synchronise()
            await eventually(lambda: server.manager.phone.ingest.clock.ready)
            await video.hello("video", session=server.manager.phone.id)
            await video.send(JPEG, sequence=1)
            await video.record(Credit)
            await eventually(lambda: server.manager.phone.vision is not None)
            odd = Picture(Codec.JPEG, True, 640, 200, 0, JPEG.data)
            await video.send(odd, sequence=2)
            assert (await video.until("refused"))["code"] == "calibration"
            assert server.manager.phone.vision is None

    play(server, scene)
