"""Turns of a hand as the virtual camera gets them, every period: from a phone's motion sensors.

Simulated (with rounding, noise, delays) or recorded. Each sample is carried on to now by the last
rate, as control does.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Iterable, Iterator

import numpy as np

from hardware.sim.hand import Hand, make_hand
from hardware.sim.phone import PhoneOptions, VirtualPhone
from hardware.sim.render import RenderOptions
from pipeline.camera.lens import Camera
from pipeline.config import PERIOD_S
from pipeline.estimation.attitude import Attitude
from pipeline.frames import Array, R_cd, exp
from pipeline.signals import PhoneImu
from server.phone.ingest import Ingest
from server.protocol.wire import WireError, decode
from server.protocol.wire_records import Motion, Ping, Pong
from server.recording.reader import Recording
from server.recording.writer import PHONE_RECORDS, SERVER_RECORDS, RecordingError

SHORTEST_S = 5.0
"""Of a recording: a second of tremor after the virtual camera has settled."""
Arrival = tuple[float, PhoneImu]
"""(time of arrival [s], sample)."""
REST_S = 1.0
"""Of a simulated hand, before it moves."""


def simulated(hand: Hand, seconds: float, seed: int) -> Iterator[Arrival]:
    """What the sensors of a virtual phone in that hand deliver."""
    options = PhoneOptions()
    blind, nothing = Camera(1, 1, np.eye(3), "plumb_bob", np.zeros(4)), np.zeros((0, 3))
    phone = VirtualPhone(
        blind, hand, nothing, RenderOptions(), np.random.default_rng(seed), options
    )
    R = R_cd(options.screen_angle_deg)
    for event in phone.motions.deliveries(0.0, seconds):
        reading = phone.motion(event.t_capture)
        sample = PhoneImu(event.t_capture, R @ reading.omega_m_in_d, R @ reading.a_m_in_d)
        yield event.t_deliver, sample


def recorded(recording: Recording) -> Iterator[Arrival]:
    """Turns of a recorded hand.

    Raises:
        RecordingError: the file is damaged.
    """
    nonces: deque[int] = deque()
    ingest = Ingest(nonces.popleft)
    for entry in recording.entries(PHONE_RECORDS, SERVER_RECORDS):
        try:
            record = decode(entry.data)
            if isinstance(record.body, Ping):
                nonces.append(record.body.nonce)
                ingest.ping(entry.t)
            elif isinstance(record.body, (Pong, Motion)):
                signal = ingest.record(record, entry.t)
                if isinstance(signal, PhoneImu):
                    yield entry.t, signal
        except WireError:
            continue  # the server refused it then, too


def attitudes(arrivals: Iterable[Arrival]) -> tuple[Array, Array]:
    """(n,) times [s] and (n, 3, 3) R_fc, one a period; f as it was before it was put right."""
    attitude, newest, turned = Attitude(), None, np.eye(3)
    times: list[float] = []
    turns: list[Array] = []
    t = 0.0
    for arrival, sample in arrivals:
        if newest is None:
            t = arrival
        while newest is not None and t < arrival:
            if attitude.R_fc is not None:
                omega = newest.omega_m_cf_in_c - attitude.bias_omega
                times.append(t)
                turns.append(turned.T @ attitude.R_fc @ exp(omega * (t - newest.t)))
            t += PERIOD_S
        attitude.add(sample)
        turned = attitude.take_turn() @ turned
        newest = sample
    return np.array(times), np.array(turns).reshape(-1, 3, 3)


def attitudes_of_recording(recording: Recording) -> tuple[Array, Array]:
    """(n,) times [s] and (n, 3, 3) R_fc.

    Raises:
        RecordingError: the file is damaged, or too short to say anything of tremor.
    """
    times, R_fc = attitudes(recorded(recording))
    if len(times) < round(SHORTEST_S / PERIOD_S):
        what = f"holds {PERIOD_S * len(times):.1f} s of the phone's motion"
        raise RecordingError(recording.path, what, f"at least {SHORTEST_S:g} s")
    return times, R_fc


def attitudes_of_hand(kind: str, seconds: float, seed: int) -> tuple[Array, Array, Array]:
    """(n,) times [s], (n, 3, 3) R_fc as the sensors give it, and the true one.

    Raises:
        ValueError: no such hand.
    """
    hand = make_hand(kind, seed=seed, rest_s=REST_S)
    times, R_fc = attitudes(simulated(hand, seconds, seed))
    return times, R_fc, np.array([hand.pose(t)[0] for t in times])
