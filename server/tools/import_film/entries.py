"""Items of a recording that a phone would have left that saw and felt the same.

Server and phone share one clock here, that of the motion samples: PINGs and PONGs say so.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from heapq import merge
from math import ceil

import numpy as np

from pipeline.frames import Array, R_cd
from server.protocol.messages import Hello, encode_message
from server.protocol.wire import VERSION, encode
from server.protocol.wire_records import Body, Motion, Ping, Pong, Record, Touch
from server.recording.writer import PHONE_MESSAGES, PHONE_RECORDS, SERVER_RECORDS
from server.tools.import_film.pictures import Taken

Item = tuple[str, float, bytes]
"""Topic, when it came [s], bytes."""
LEAD_S = 1.0
"""The server asks for the phone's clock for so long before anything is dated."""
PING_S, WAY_S = 0.05, 0.001
"""Between two PINGs, and each way of one."""
MOTION_LATENCY_S, PICTURE_LATENCY_S = 0.02, 0.1
"""Samples come before the picture they belong to, as live ones do."""


def entries(pictures: Sequence[Taken], imu: Array, device: str) -> Iterator[Item]:
    """Items in the order of time; `imu` (n, 7) in the camera's axes, times from `LEAD_S` on."""
    times = [t for t, _ in pictures] + imu[:, 0].tolist()
    begin, end = min(times) - LEAD_S, max(times) + PICTURE_LATENCY_S
    hello = Hello(VERSION, "operator", device, sensors="imported", video="imported")
    yield PHONE_MESSAGES, begin, encode_message(hello).encode()
    angle = pictures[0][1].screen_angle_deg
    streams = (_life(begin, end), _motions(imu, angle), _films(pictures))
    yield from merge(*streams, key=lambda item: item[1])


def _said(t: float, number: int, t_made: float, body: Body, topic: str = PHONE_RECORDS) -> Item:
    return topic, t, encode(Record(number, round(1e6 * t_made), body))


def _life(begin: float, end: float) -> Iterator[Item]:
    """The server asks, the phone answers; nobody touches it."""
    for k in range(1, ceil((end - begin) / PING_S)):
        t = begin + k * PING_S
        yield _said(t - WAY_S, k, t - WAY_S, Ping(k), SERVER_RECORDS)
        yield _said(t + WAY_S, k, t, Pong(k, round(1e6 * (t - WAY_S))))
        yield _said(t + WAY_S, k, t, Touch(False, True, 0, k))


def _motions(imu: Array, screen_angle_deg: int) -> Iterator[Item]:
    R_dc = R_cd(screen_angle_deg).T
    turned = np.hstack((imu[:, 1:4] @ R_dc.T, imu[:, 4:] @ R_dc.T))
    for k, (t, row) in enumerate(zip(imu[:, 0].tolist(), turned.tolist(), strict=True)):
        rate, force = (row[0], row[1], row[2]), (row[3], row[4], row[5])
        yield _said(t + MOTION_LATENCY_S, k, t, Motion(rate, force, None, screen_angle_deg))


def _films(pictures: Sequence[Taken]) -> Iterator[Item]:
    for k, (t, picture) in enumerate(pictures):
        yield _said(t + PICTURE_LATENCY_S, k, t, picture)
