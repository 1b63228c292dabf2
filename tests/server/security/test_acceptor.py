"""Doors on real sockets: who says nothing, who comes too often, and no file handles left."""

from __future__ import annotations

import asyncio
import contextlib
import errno
import gc
import logging
import select
import socket
import ssl
from types import SimpleNamespace

import pytest

from server.security import acceptor
from server.security.acceptor import Acceptor
from server.security.admission import Admission
from server.security.places import AdmissionLimits
from server.security.tls import certificate
from tests.server.house import eventually

pytestmark = pytest.mark.slow  # real sockets and deadlines

HOST = "127.0.0.1"
STRANGER = "127.0.0.2"
"""Loopback too, but not the address that every program of this machine has."""
HURRY_S = 0.1


class Echo(asyncio.Protocol):
    """Says back what it hears."""

    def connection_made(self, transport):
        self.transport = transport

    def data_received(self, data):
        self.transport.write(data)


@pytest.fixture(scope="module")
def secure(tmp_path_factory):
    made = certificate(tmp_path_factory.mktemp("tls"))
    context = ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER)
    context.load_cert_chain(made.cert, made.key)
    return SimpleNamespace(context=context, trust=ssl.create_default_context(cafile=made.authority))


@pytest.fixture(autouse=True)
def hurried(monkeypatch):
    monkeypatch.setattr(acceptor, "HELLO_S", HURRY_S)
    monkeypatch.setattr(acceptor, "BACK_OFF_S", 0.01)


@contextlib.asynccontextmanager
async def door(context=None, limits=None, plain=None):
    admission = Admission(limits)
    with socket.create_server((HOST, 0), backlog=1024) as bound:
        one = Acceptor(bound, context, Echo, admission, plain)
        one.start()
        try:
            yield SimpleNamespace(
                port=bound.getsockname()[1], admission=admission, acceptor=one, bound=bound
            )
        finally:
            one.close()


async def come(port, source=HOST, **options):
    return await asyncio.open_connection(HOST, port, local_addr=(source, 0), **options)


def knock(port, source):
    """A connection that has begun, and says nothing."""
    one = socket.socket()
    one.bind((source, 0))
    one.setblocking(False)
    one.connect_ex((HOST, port))
    return one


async def ends(reader):
    async with asyncio.timeout(4.0):
        with contextlib.suppress(ConnectionError):
            return await reader.read()
    return b""


async def echoed(reader, writer):
    writer.write(b"hello")
    async with asyncio.timeout(4.0):
        answer = await reader.readexactly(5)
    writer.transport.abort()
    return answer == b"hello"


@pytest.mark.parametrize("with_tls", [False, True])
def test_who_says_nothing_is_cut_and_its_place_given_back(secure, with_tls):
    async def run():
        async with door(secure.context if with_tls else None) as here:
            silent = [await come(here.port) for _ in range(20)]
            await eventually(lambda: len(here.admission) == 20)
            assert await asyncio.gather(*(ends(reader) for reader, _ in silent)) == [b""] * 20
            await eventually(lambda: len(here.admission) == 0)
            for _, writer in silent:
                writer.close()

    asyncio.run(run())


def test_a_silent_socket_costs_no_memory_for_tls(secure, monkeypatch):
    monkeypatch.setattr(acceptor, "HELLO_S", 60.0)

    def secured():
        return sum(isinstance(one, ssl.SSLObject) for one in gc.get_objects())

    async def run():
        async with door(secure.context) as here:
            before = secured()
            silent = [await come(here.port) for _ in range(20)]
            await eventually(lambda: len(here.admission) == 20)
            assert secured() == before
            for _, writer in silent:
                writer.transport.abort()
            await eventually(lambda: len(here.admission) == 0)

    asyncio.run(run())


@pytest.mark.parametrize(
    "hello", [b"GET / HTTP/1.1\r\n\r\n", b"\x16\x03\x01", b"\x16\x03\x01\xff\xff" + bytes(99)]
)
def test_half_a_handshake_or_none_is_cut_without_a_word_in_the_log(secure, hello, caplog):
    async def run():
        async with door(secure.context) as here:
            reader, writer = await come(here.port)
            writer.write(hello)
            await ends(reader)
            await eventually(lambda: len(here.admission) == 0)
            writer.close()

    asyncio.run(run())
    assert caplog.records == []


class Help(Echo):
    """Says something else."""

    def data_received(self, data):
        self.transport.write(b"HELP!")


def test_who_speaks_no_tls_meets_the_other_protocol_and_its_place_is_given_back(secure):
    async def run():
        async with door(secure.context, plain=Help) as here:
            assert await echoed(*await come(here.port, ssl=secure.trust))
            reader, writer = await come(here.port)
            writer.write(b"GET / HTTP/1.1\r\n\r\n")
            async with asyncio.timeout(4.0):
                assert await reader.readexactly(5) == b"HELP!"
            writer.transport.abort()
            await eventually(lambda: len(here.admission) == 0)

    asyncio.run(run())


def test_where_no_tls_is_spoken_nobody_meets_the_other_protocol():
    async def run():
        async with door(None, plain=Help) as here:
            assert await echoed(*await come(here.port))

    asyncio.run(run())


@pytest.mark.parametrize("with_tls", [False, True])
def test_who_shakes_hands_is_served_and_its_place_given_back(secure, with_tls):
    options = {"ssl": secure.trust} if with_tls else {}

    async def run():
        async with door(secure.context if with_tls else None) as here:
            for _ in range(3):
                assert await echoed(*await come(here.port, **options))
            await eventually(lambda: len(here.admission) == 0)

    asyncio.run(run())


def test_who_comes_too_soon_after_others_of_its_address_waits_and_is_served(secure):
    async def run():
        limits = AdmissionLimits(per_stranger_connections_hz=10.0, burst_s=0.2)
        async with door(secure.context, limits) as here:
            began = asyncio.get_running_loop().time()
            options = {"source": STRANGER, "ssl": secure.trust, "server_hostname": HOST}
            many = await asyncio.gather(*(come(here.port, **options) for _ in range(8)))
            assert asyncio.get_running_loop().time() - began >= (8 - 2) / 10.0
            assert all([await echoed(*one) for one in many])
            assert here.admission.refused == 0

    asyncio.run(run())


def test_a_flood_of_strangers_is_turned_away_at_once_and_others_are_served(secure):
    async def run():
        limits = AdmissionLimits(strangers=8, per_stranger=4)
        async with door(secure.context, limits) as here:
            flood = [knock(here.port, STRANGER) for _ in range(300)]
            await eventually(lambda: here.admission.refused == 296)
            assert here.admission.strangers <= 4
            assert await echoed(*await come(here.port, ssl=secure.trust))
            assert await echoed(*await come(here.port, "127.0.0.3", ssl=secure.trust))
            for one in flood:
                one.close()

    asyncio.run(run())


def test_a_strangers_connection_ends_however_it_talks(monkeypatch):
    monkeypatch.setattr(acceptor, "STRANGER_S", HURRY_S)

    async def run():
        async with door() as here:
            reader, writer = await come(here.port, STRANGER)
            own_reader, own_writer = await come(here.port, HOST)
            for one in (writer, own_writer):
                one.write(b"hello")
            assert await ends(reader) == b"hello"
            assert await own_reader.readexactly(5) == b"hello"
            assert len(here.admission) == 1
            for one in (writer, own_writer):
                one.transport.abort()

    asyncio.run(run())


def test_one_that_is_ended_before_its_handshake_begins_leaves_no_handle():
    async def run():
        async with door() as here:
            client = knock(here.port, STRANGER)
            select.select([here.bound], [], [], 4.0)
            here.acceptor._accept()  # the handshake is yet to take its first step
            assert len(here.admission) == 1
            (place,) = here.admission._places.values()
            guest = place.end.__self__
            place.end()
            await eventually(lambda: guest.fileno() == -1)
            assert len(here.admission) == 0
            client.close()

    asyncio.run(run())


def test_a_fault_in_a_handshake_is_told_and_its_place_given_back(caplog):
    def broken():
        raise ZeroDivisionError("no protocol")

    async def run():
        async with door() as here:
            here.acceptor._protocol = broken
            reader, writer = await come(here.port)
            writer.write(b"hello")
            assert await ends(reader) == b""
            await eventually(lambda: len(here.admission) == 0)
            writer.close()

    asyncio.run(run())
    assert "no protocol" in caplog.text


class Poor:
    """A listening socket of a process without file handles."""

    def __init__(self, bound):
        self._bound, self.tries, self.is_poor = bound, 0, True

    def accept(self):
        self.tries += 1
        if self.is_poor:
            raise OSError(errno.EMFILE, "Too many open files")
        return self._bound.accept()

    def __getattr__(self, name):
        return getattr(self._bound, name)


def test_without_file_handles_it_waits_ends_a_stranger_and_goes_on(caplog):
    async def run():
        async with door() as here:
            stranger, writer = await come(here.port, STRANGER)
            writer.write(b"hello")
            assert await stranger.readexactly(5) == b"hello"
            poor = here.acceptor._bound = Poor(here.bound)
            reader, other = await come(here.port)
            await eventually(lambda: poor.tries >= 3)
            turns, tries = await spins(), poor.tries
            assert poor.tries - tries < turns / 10  # it does not spin
            assert await ends(stranger) == b""
            poor.is_poor = False
            assert await echoed(reader, other)
            writer.close()

    with caplog.at_level(logging.ERROR, "lightleash"):
        asyncio.run(run())
    assert "Too many open files" in caplog.text


async def spins():
    """Turns of the event loop in a while in which it has nothing to do."""
    for _ in range(1000):
        await asyncio.sleep(0)
    return 1000
