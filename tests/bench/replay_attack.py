"""What somebody who hears the robot's link may do: say again what was said, as whoever said it.

Datagrams of the loopback interface are captured and sent again, old ones and new, to where they
went (replay) and to where they came from (reflection), with the true sender's address and port.
Needs CAP_NET_RAW; without it nothing is sent, and the tally says so.
"""

from __future__ import annotations

import contextlib
import random
import socket
import struct
import threading
from collections import deque
from typing import Final, NamedTuple

from tests.bench.attacks import Tally, Target

ETH_P_IP, ETHERNET, IP_HEADER, UDP_HEADER = 0x0800, 14, 20, 8
UDP: Final = 17
REMEMBERED: Final = 4_000
AT_ONCE: Final = 16
"""Frames looked at in a turn: who floods the same ports is not to be heard at length."""
AGAIN_S: Final = 0.005
"""Between two volleys: one new and one old datagram, each replayed and reflected."""


class Datagram(NamedTuple):
    """UDP over IPv4, as captured."""

    source: tuple[bytes, int]
    target: tuple[bytes, int]
    payload: bytes

    def packet(self) -> bytes:
        """With headers of both protocols; no checksum of UDP, which is optional (RFC 768)."""
        length = UDP_HEADER + len(self.payload)
        ends = self.source[0], self.target[0]
        ip = struct.pack("!BBHHHBBH4s4s", 0x45, 0, IP_HEADER + length, 0, 0, 64, UDP, 0, *ends)
        udp = struct.pack("!HHHH", self.source[1], self.target[1], length, 0)
        return ip + udp + self.payload


def captured(frame: bytes) -> Datagram | None:
    """What an Ethernet frame carries, if that is a datagram over IPv4 without options."""
    ip = frame[ETHERNET:]
    if len(ip) < IP_HEADER + UDP_HEADER or ip[0] != 0x45 or ip[9] != UDP:
        return None
    source, target, length = struct.unpack_from("!HHH", ip, IP_HEADER)
    payload = ip[IP_HEADER + UDP_HEADER : IP_HEADER + length]
    return Datagram((ip[12:16], source), (ip[16:20], target), payload)


def replayed(target: Target, over: threading.Event, tally: Tally) -> None:
    """What the server's processes say to each other: robot and control."""
    rng, heard = random.Random(11), deque[Datagram](maxlen=REMEMBERED)
    with contextlib.ExitStack() as stack:
        try:
            ear = stack.enter_context(
                socket.socket(socket.AF_PACKET, socket.SOCK_RAW, socket.htons(ETH_P_IP))
            )
            mouth = stack.enter_context(
                socket.socket(socket.AF_INET, socket.SOCK_RAW, socket.IPPROTO_RAW)
            )
        except PermissionError:
            tally.add("not allowed to replay")
            return
        ear.bind(("lo", ETH_P_IP))
        ear.settimeout(AGAIN_S)
        while not over.wait(AGAIN_S):
            with contextlib.suppress(TimeoutError):
                for _ in range(AT_ONCE):
                    one = captured(ear.recv(65_536))
                    if one is None:
                        continue
                    if {one.source[1], one.target[1]} <= set(target.datagrams):
                        heard.append(one)
                        tally.add("captured")
            if heard:
                for one in (heard[-1], rng.choice(heard)):
                    _say_again(mouth, one, tally)


def _say_again(mouth: socket.socket, one: Datagram, tally: Tally) -> None:
    for again in (one, one._replace(source=one.target, target=one.source)):
        with contextlib.suppress(OSError):
            mouth.sendto(again.packet(), (socket.inet_ntoa(again.target[0]), 0))
            tally.add("replayed")
