"""What a stranger, or somebody who was paired, might do to the server's doors. Loopback only."""

from __future__ import annotations

import contextlib
import json
import os
import random
import re
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

from server.protocol.wire import VERSION

HOST = "127.0.0.1"
STRANGERS = [f"127.0.0.{n}" for n in range(2, 22)]
"""Loopback too, and not the address that the programs of this machine have."""
MEMBER = "127.0.0.90"
"""One that somebody who was let in has."""
DATAGRAMS_HZ = 2_000.0
"""To each port: what a flood costs is the machine's, which attacker and server share here."""


@dataclass(frozen=True, slots=True)
class Target:
    """Ports of one server on the loopback interface; there is no way to name another host."""

    https: int
    http: int
    datagrams: tuple[int, ...]
    operator_token: str
    links: tuple[str, ...] = ()
    """Keys of links for viewers, each for one attacker who was let in."""


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
                Tls(context, one)
                tally.add("idle TLS")
            tally.add("TLS tried")
            time.sleep(0.01)
        over.wait()
        for one in held:
            one.close()

    return attack


class Tls:
    """TLS by hand: `wrap_socket` leaves a socket open where the other end has gone by then."""

    def __init__(self, context: ssl.SSLContext, plain: socket.socket) -> None:
        """Hands are shaken; OSError if the other end refuses, or goes."""
        self._plain = plain
        self._incoming, self._outgoing = ssl.MemoryBIO(), ssl.MemoryBIO()
        self._tls = context.wrap_bio(self._incoming, self._outgoing)
        while True:
            try:
                self._tls.do_handshake()
            except ssl.SSLWantReadError:
                plain.sendall(self._outgoing.read())
                if not self._hear():
                    raise ConnectionResetError("closed in the handshake") from None
            else:
                plain.sendall(self._outgoing.read())
                return

    def _hear(self) -> bool:
        heard = self._plain.recv(16_384)
        self._incoming.write(heard)
        return bool(heard)

    def sendall(self, data: bytes) -> None:
        self._tls.write(data)
        self._plain.sendall(self._outgoing.read())

    def recv(self, most: int) -> bytes:
        """Some of what comes; empty at the end."""
        while True:
            try:
                return self._tls.read(most)
            except ssl.SSLWantReadError:
                if not self._hear():
                    return b""
            except ssl.SSLZeroReturnError:
                return b""


def careless() -> ssl.SSLContext:
    """A client's context that trusts everybody."""
    context = ssl.SSLContext(ssl.PROTOCOL_TLS_CLIENT)
    context.check_hostname, context.verify_mode = False, ssl.CERT_NONE
    return context


def flood_http(secure: bool) -> Attack:
    """Requests as fast as one stranger gets answers, over TLS or not."""

    def attack(target: Target, over: threading.Event, tally: Tally) -> None:
        source, port = STRANGERS[secure], target.https if secure else target.http
        while not over.wait(0.005):
            with contextlib.suppress(OSError), spoken(source, port, secure) as one:
                while not over.wait(0.002):
                    one.sendall(get("/"))
                    if not one.recv(65_536):
                        break
                    tally.add("requests")

    return attack


def flood_as_member(target: Target, over: threading.Event, tally: Tally) -> None:
    """Somebody who was let in asks what costs most, as fast as he is answered."""
    cookie = pair(MEMBER, target.https, target.links[0])
    paths = ("/api/link?seconds=60", "/metrics", "/view/", "/api/status")
    while not over.wait(0.01):
        with contextlib.suppress(OSError), spoken(MEMBER, target.https, True) as one:
            for path in paths:
                one.sendall(get(path, f"Cookie: {cookie}\r\n"))
                refused = b" 429 " in one.recv(65_536)
                tally.add("members' requests refused" if refused else "members' requests")


@contextlib.contextmanager
def spoken(source: str, port: int, secure: bool) -> Iterator[socket.socket | Tls]:
    """A connection that has shaken hands, if it must."""
    with open_from(source, port) as plain:
        yield Tls(careless(), plain) if secure else plain


def get(path: str, more: str = "") -> bytes:
    """A request."""
    return f"GET {path} HTTP/1.1\r\nHost: {HOST}\r\n{more}\r\n".encode()


def pair(source: str, port: int, key: str) -> str:
    """Let somebody in by a link, from an address; the cookie as it is sent back."""
    body = f'{{"token": "{key}", "name": "bench"}}'.encode()
    with spoken(source, port, True) as page:
        page.sendall(
            f"POST /api/pair HTTP/1.1\r\nHost: {HOST}\r\nOrigin: https://{HOST}\r\n"
            f"X-Lightleash: 1\r\nContent-Length: {len(body)}\r\n\r\n".encode()
            + body
        )
        head = page.recv(65_536).decode("latin-1")
    cookie = re.search(r"set-cookie: ([^;]+)", head, re.IGNORECASE)
    if cookie is None:
        raise OSError(f"not paired: {head[:60]}")
    return cookie[1]


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


def second_phones(target: Target, over: threading.Event, tally: Tally) -> None:
    """Another paired phone wants to lead, again and again; it never comes so far as a picture."""
    headers = {"Authorization": f"Bearer {target.operator_token}"}
    hello = f'{{"type":"hello","version":{VERSION},"role":"operator","device":"second"}}'
    while not over.wait(0.3):
        with contextlib.suppress(OSError, TimeoutError, WebSocketException):
            url = f"ws://{HOST}:{target.http}/ws/phone"
            with connect(url, additional_headers=headers, proxy=None, open_timeout=2) as page:
                page.send(hello)
                said = json.loads(page.recv(timeout=0.5))
                tally.add("second phones turned away" if said["type"] == "refused" else "LET IN")


def stray_answers(target: Target, over: threading.Event, tally: Tally) -> None:
    """A paired page answers offers that nobody made."""
    rng = random.Random(3)
    while not over.wait(0.1):
        body = f'{{"id": "{rng.random()}", "sdp": "v=0"}}'.encode()
        head = (
            f"POST /api/rtc/answer HTTP/1.1\r\nHost: {HOST}\r\nConnection: close\r\n"
            f"Authorization: Bearer {target.operator_token}\r\nContent-Length: {len(body)}\r\n\r\n"
        )
        with contextlib.suppress(OSError), open_from(HOST, target.http) as one:
            one.sendall(head.encode() + body)
            refused = b" 404 " in one.recv(4_096)
            tally.add("stray answers refused" if refused else "STRAY ANSWERS TAKEN")


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
