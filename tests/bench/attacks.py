"""What a stranger, or somebody who was paired, might do to the server's doors. Loopback only."""

from __future__ import annotations

import contextlib
import os
import random
import socket
import ssl
import struct
import threading
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from ipaddress import ip_address
from pathlib import Path

from websockets.exceptions import WebSocketException
from websockets.sync.client import connect

from server.wire import VERSION, encode
from server.wire_records import Codec, Picture, Record

HOST = "127.0.0.1"
STRANGERS = [f"127.0.0.{n}" for n in range(2, 22)]
"""Loopback too, and not the address that the programs of this machine have."""
DATAGRAMS_HZ = 2_000.0
"""To each port: what a flood costs is the machine's, which attacker and server share here."""
JPEG_BOMB = (
    b"\xff\xd8\xff\xc0" + struct.pack(">HBHHB", 17, 8, 30_000, 30_000, 3)
    + b"\x01\x22\x00\x02\x11\x01\x03\x11\x01" + bytes(300)
)  # fmt: skip
H264_BOMB = (
    b"\0\0\0\1\x67\x64\x00\x34\xac\x2b\x40\x20\x00\x20\x00" + b"\0\0\0\1\x65" + bytes(40_000)
)


@dataclass(frozen=True, slots=True)
class Target:
    """Ports of one server on the loopback interface; there is no way to name another host."""

    https: int
    http: int
    datagrams: tuple[int, ...]
    operator_token: str
    session: str = ""


@dataclass(slots=True)
class Tally:
    """What the attackers did."""

    counts: dict[str, int] = field(default_factory=dict)
    _lock: threading.Lock = field(default_factory=threading.Lock)

    def add(self, what: str, n: int = 1) -> None:
        with self._lock:
            self.counts[what] = self.counts.get(what, 0) + n


Attack = Callable[[Target, threading.Event, Tally], None]


def open_from(source: str, port: int, seconds: float = 2.0) -> socket.socket:
    """A connection to `port`; never leaves this machine."""
    assert ip_address(source).is_loopback
    return socket.create_connection((HOST, port), seconds, (source, 0))


def silent(n: int) -> Attack:
    """`n` sockets without a hello, half to each port."""

    def attack(target: Target, over: threading.Event, tally: Tally) -> None:
        held: list[socket.socket] = []
        for k in range(n):
            if over.is_set():
                break
            one = socket.socket()
            one.setblocking(False)
            one.bind((STRANGERS[k % len(STRANGERS)], 0))
            one.connect_ex((HOST, (target.https, target.http)[k % 2]))
            held.append(one)
            tally.add("silent sockets")
            time.sleep(0.002)
        over.wait()
        for one in held:
            one.close()

    return attack


def idle_tls(n: int) -> Attack:
    """`n` connections that shake hands and say nothing more."""

    def attack(target: Target, over: threading.Event, tally: Tally) -> None:
        context, held = careless(), list[socket.socket]()
        for k in range(n):
            if over.is_set():
                break
            with contextlib.suppress(OSError):
                one = open_from(STRANGERS[k % len(STRANGERS)], target.https)
                held.append(one)
                shake_hands(context, one)
                tally.add("idle TLS")
            tally.add("TLS tried")
            time.sleep(0.01)
        over.wait()
        for one in held:
            one.close()

    return attack


def shake_hands(context: ssl.SSLContext, plain: socket.socket) -> None:
    """TLS by hand: `wrap_socket` leaves a socket open where the other end has gone by then.

    Raises:
        OSError: the other end refuses, or goes.
    """
    incoming, outgoing = ssl.MemoryBIO(), ssl.MemoryBIO()
    tls = context.wrap_bio(incoming, outgoing)
    while True:
        try:
            tls.do_handshake()
        except ssl.SSLWantReadError:
            plain.sendall(outgoing.read())
            heard = plain.recv(16_384)
            if not heard:
                raise ConnectionResetError("closed in the handshake") from None
            incoming.write(heard)
        else:
            plain.sendall(outgoing.read())
            return


def careless() -> ssl.SSLContext:
    """A client's context that trusts everybody."""
    context = ssl.SSLContext(ssl.PROTOCOL_TLS_CLIENT)
    context.check_hostname, context.verify_mode = False, ssl.CERT_NONE
    return context


def flood_http(target: Target, over: threading.Event, tally: Tally) -> None:
    """Requests as fast as one stranger gets answers, on both ports."""
    request = f"GET / HTTP/1.1\r\nHost: {HOST}\r\n\r\n".encode()
    while not over.wait(0.005):
        with contextlib.suppress(OSError), open_from(STRANGERS[0], target.http) as one:
            while not over.wait(0.002):
                one.sendall(request)
                if not one.recv(65_536):
                    break
                tally.add("requests")


def slow_loris(n: int) -> Attack:
    """`n` heads that never end, from two addresses."""

    def attack(target: Target, over: threading.Event, tally: Tally) -> None:
        held: list[socket.socket] = []
        while not over.wait(0.2):
            while len(held) < n:
                try:
                    held.append(open_from(STRANGERS[len(held) % 2], target.http))
                except OSError:
                    break
            for one in [*held]:
                try:
                    one.send(b"x")
                    tally.add("slow bytes")
                except OSError:
                    one.close()
                    held.remove(one)
        for one in held:
            one.close()

    return attack


def flood_datagrams(target: Target, over: threading.Event, tally: Tally) -> None:
    """Random bytes and things that look like STUN to every UDP port of the server's processes."""
    rng = random.Random(7)
    stun = struct.pack("!HHI", 1, 8, 0x2112A442)
    words = [stun + rng.randbytes(20), rng.randbytes(64), rng.randbytes(1_200), b"\x80" + bytes(99)]
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as one:
        one.bind((STRANGERS[0], 0))
        while not over.wait(0.01):
            for port in target.datagrams:
                for k in range(int(0.01 * DATAGRAMS_HZ)):
                    with contextlib.suppress(OSError):
                        one.sendto(words[k % len(words)], (HOST, port))
                tally.add("datagrams", int(0.01 * DATAGRAMS_HZ))


def bombs(target: Target, over: threading.Event, tally: Tally) -> None:
    """Another paired phone sends pictures that are far larger than they say, by both sockets."""
    headers = {"Authorization": f"Bearer {target.operator_token}"}
    hello = f'{{"type":"hello","version":{VERSION},"role":"operator","device":"bomber"}}'
    pictures = [Picture(Codec.JPEG, True, 640, 480, 0, JPEG_BOMB),
                Picture(Codec.H264, True, 640, 480, 0, H264_BOMB)]  # fmt: skip
    while not over.wait(0.3):
        for path in ("/ws/phone", "/ws/video"):
            with contextlib.suppress(OSError, TimeoutError, WebSocketException):
                url = f"ws://{HOST}:{target.http}{path}"
                with connect(url, additional_headers=headers, proxy=None, open_timeout=2) as page:
                    page.send(hello)
                    for n, picture in enumerate(pictures):
                        page.send(encode(Record(n + 1, int(1e6 * time.monotonic()), picture)))
                        tally.add("bombs")
                    page.recv(timeout=0.2)


def hostile_sdp(target: Target, over: threading.Event, tally: Tally) -> None:
    """A paired page's answers that are none."""
    rng = random.Random(3)
    texts = [
        "v=0\\r\\n" + "a=x\\r\\n" * 300,
        "x" * 16_000,
        "v=0\\r\\nm=audio 9 x 0\\r\\n",
        "[" * 9_000,
    ]
    while not over.wait(0.1):
        body = f'{{"id": "{rng.random()}", "sdp": "{rng.choice(texts)}"}}'.encode()
        head = (
            f"POST /api/rtc/answer HTTP/1.1\r\nHost: {HOST}\r\nConnection: close\r\n"
            f"Authorization: Bearer {target.operator_token}\r\nContent-Length: {len(body)}\r\n\r\n"
        )
        with contextlib.suppress(OSError), open_from(HOST, target.http) as one:
            one.sendall(head.encode() + body)
            one.recv(4_096)
            tally.add("hostile SDP")


@contextlib.contextmanager
def attacked(target: Target, attacks: list[Attack]) -> Iterator[Tally]:
    """All of them at once, while this lasts."""
    over, tally = threading.Event(), Tally()
    threads = [threading.Thread(target=one, args=(target, over, tally)) for one in attacks]
    for thread in threads:
        thread.start()
    try:
        yield tally
    finally:
        over.set()
        for thread in threads:
            thread.join(10.0)


def datagram_ports(pids: list[int]) -> tuple[int, ...]:
    """UDP ports of these processes, whatever address they are bound to."""
    inodes = {
        str(link.readlink()).removeprefix("socket:[").rstrip("]")
        for pid in pids
        for link in Path(f"/proc/{pid}/fd").iterdir()
        if link.is_symlink() and os.path.lexists(link)
    }
    lines = (line.split() for line in Path("/proc/net/udp").read_text().splitlines()[1:])
    return tuple(int(line[1].split(":")[1], 16) for line in lines if line[9] in inodes)
