"""A page's two sockets against a small server on the loopback interface."""

import asyncio

import pytest

from server.common.access import Access, PhoneClientError
from server.protocol.messages import Command, Refused, decode_message, encode_message
from server.protocol.video_path_messages import PathChoice
from server.protocol.wire import decode, encode
from server.protocol.wire_records import Credit, Ping, Pong, Record, Touch
from server.virtual_phone.phone_client import PhoneClient
from tests.server.page_server import WELCOME, PageServer, picture, status

pytestmark = pytest.mark.e2e


def test_hello_pong_and_wish():
    ping = encode(Record(5, 123, Ping(42)))
    server = PageServer([encode_message(WELCOME), ping, encode_message(status("DISARMED"))])

    async def talk(client):
        assert await client.open("a device") == WELCOME
        running = asyncio.create_task(client.run())
        async with asyncio.timeout(5.0):
            while len(server.heard) < 2:
                await asyncio.sleep(0)
        running.cancel()

    asyncio.run(server.session(talk))
    assert server.tokens == ["Bearer secret"] * 2
    main, video = server.hellos
    assert (main["role"], main["device"]) == ("operator", "a device")
    assert (video["role"], video["session"]) == ("video", "s1")
    (_, pong), (_, wish) = server.heard
    assert decode(pong).body == Pong(42, 123)
    assert decode_message(wish) == Command("arm")


def test_a_supervisors_choice_of_another_way_changes_nothing():
    choice = encode_message(PathChoice("JPEG", "supervisor"))
    server = PageServer([encode_message(WELCOME), choice, encode_message(status("DISARMED"))])

    async def talk(client):
        await client.open("a device")
        running = asyncio.create_task(client.run())
        async with asyncio.timeout(5.0):
            while not server.heard:
                await asyncio.sleep(0)
        assert not running.done()
        assert client.refusals == []
        running.cancel()

    asyncio.run(server.session(talk))
    ((_, wish),) = server.heard
    assert decode_message(wish) == Command("arm")


def test_a_ping_is_answered_with_the_newest_touch_too():
    server = PageServer([encode_message(WELCOME)])

    async def talk(client):
        await client.open("a device")
        await client.send(Record(1, 100, Touch(True, True, 3, 7)))
        await client._take(Record(5, 123, Ping(42)))
        async with asyncio.timeout(5.0):
            while len(server.heard) < 3:
                await asyncio.sleep(0)

    asyncio.run(server.session(talk))
    said = [decode(data) for _, data in server.heard]
    assert said[1].body == Pong(42, 123)
    assert (said[2].sequence, said[2].body) == (2, Touch(True, True, 3, 42))


def test_three_pictures_are_under_way_and_no_more():
    server = PageServer([encode_message(WELCOME)], credit=False)

    async def talk(client):
        await client.open("a device")
        for k in range(3):
            assert client.has_credit
            await client.send(picture(k))
        assert not client.has_credit
        await client._take(Record(1, 1, Credit(0)))
        assert client.has_credit

    asyncio.run(server.session(talk))


def test_credit_of_a_later_picture_covers_the_earlier():
    server = PageServer([encode_message(WELCOME)])

    async def talk(client):
        await client.open("a device")
        running = asyncio.create_task(client.run())
        async with asyncio.timeout(5.0):
            for k in range(20):
                await client.credit()
                await client.send(picture(k))
        running.cancel()

    asyncio.run(server.session(talk))
    paths = [path for path, _ in server.heard]
    assert paths.count("/ws/video") >= 17


@pytest.mark.parametrize(
    ("first", "why"),
    [
        (encode_message(Refused("role", "token", "an operator's", True)), "token: an operator's"),
        (encode_message(status("LOST")), "something else than welcome"),
        ('{"type":"salut"}', "no Lightleash server"),
        (encode(Record(5, 123, Ping(42))), "no Lightleash server"),
    ],
)
def test_another_answer_than_welcome_is_told(first, why):
    async def talk(client):
        with pytest.raises(PhoneClientError, match=why):
            await client.open("a device")

    asyncio.run(PageServer([first]).session(talk))


def test_a_closed_connection_is_told_with_its_reason():
    class Closing(PageServer):
        async def __call__(self, socket):
            await socket.recv()
            await socket.send(encode_message(WELCOME))
            await socket.send(encode_message(Refused("rate", "frame", "30 a second", True)))
            await socket.close(1008, "refused")

    async def talk(client):
        await client.open("a device")
        with pytest.raises(PhoneClientError, match="30 a second"):
            await client.run()

    asyncio.run(Closing([]).session(talk))


def test_no_server_is_told():
    client = PhoneClient(Access("http://127.0.0.1:9", "t"), None, None)
    with pytest.raises(PhoneClientError, match=r"127\.0\.0\.1:9"):
        asyncio.run(client.open("a device"))
