"""The robot's link: datagrams and both ends, with its key: fuzzed is what lies behind the MAC."""

import struct
from dataclasses import replace
from math import isfinite

import numpy as np

from hardware.follower import (
    STOPPED,
    BlinkOrder,
    EStop,
    FollowerState,
    Refusal,
    RobotHealth,
    ThrustCommand,
)
from hardware.link.blink_datagram import LASTS_MS, BlinkDatagram, decode_blink, encode_blink
from hardware.link.control_end import ControlEnd
from hardware.link.datagram import (
    ATTITUDE_COMMAND_MAGIC,
    COMMAND_MAGIC,
    MAX_THRUSTERS,
    NOTHING_FELT,
    ODOMETRY_MAGIC,
    SAMPLE_MAGIC,
    TWIST_COMMAND_MAGIC,
    TWIST_SAMPLE_MAGIC,
    CommandDatagram,
    LinkError,
    SampleDatagram,
    decode_command,
    decode_sample,
    encode_command,
    encode_sample,
)
from hardware.link.health_datagram import MAGIC as HEALTH_MAGIC
from hardware.link.health_datagram import MOST_V, HealthDatagram, decode_health, encode_health
from hardware.link.link_key import MAC_BYTES, mac
from hardware.link.mavlink import messages as mavlink
from hardware.link.mavlink.autopilot_end import AutopilotEnd
from hardware.link.mavlink.packets import MavlinkPacket, encoded, packets
from hardware.link.robot_end import LinkLimits, RobotEnd
from hardware.link.rpit.structs import decode_con
from hardware.link.tool_datagram import ToolDatagram, decode_tool, encode_tool
from hardware.robot_file import COMMANDS, MavlinkParameters, load_robot
from tests.fuzz.sequence import pieces, together
from tests.fuzz.target import target

KEY = bytes(range(16))
PEER, STRANGER = ("control", 1), ("stranger", 2)
STILL = (0.0, 0.0, 0.0)
AUTOPILOTS = load_robot("twister", takes=COMMANDS)
LIMITS = LinkLimits(thrusters=2, f_max=3.0, max_rise=1.0, ramp_us=500_000, handshake_us=20_000)
MOVING = (FollowerState.RUNNING, FollowerState.COAST, FollowerState.RAMP)
FORGED, SEALED, PATCHED, HONEST, TICK, PULL = range(6)
"""What a piece does: first byte; the second is how many milliseconds later."""


def sealed(body: bytes) -> bytes:
    """A datagram that the MAC vouches for."""
    return body + mac(KEY, body)


def command_seeds():
    for thrusts in ((1.0,), (0.0, 0.5), (0.1,) * MAX_THRUSTERS, (float("nan"), float("inf"))):
        command = CommandDatagram(5, 7, 11, 13, True, thrusts, stop=thrusts[0] == 0.0)
        yield encode_command(command, KEY)[:-MAC_BYTES]
    twist = CommandDatagram(5, 7, 11, 13, True, (), twist_in_b=(0.1, -0.2, 0.3, 0.0, 0.5, 1.0))
    yield encode_command(twist, KEY)[:-MAC_BYTES]
    attitude = CommandDatagram(5, 7, 11, 13, True, (), attitude=(0.1, -0.2, 0.5, 11.0))
    yield encode_command(attitude, KEY)[:-MAC_BYTES]


def has_nan(thrusts) -> bool:
    return any(thrust != thrust for thrust in thrusts)


@target("command", command_seeds, (LinkError,), max_bytes=160, mutants=4000)
def command(data: bytes) -> None:
    """What is taken is the bytes and nothing else; without the MAC nothing is taken."""
    try:
        decode_command(data, KEY)
        raise AssertionError("taken without the key")
    except LinkError:
        pass
    decoded = decode_command(sealed(data), KEY)
    assert 1 <= len(decoded.values) <= MAX_THRUSTERS
    again = encode_command(decoded, KEY)
    assert again[: len(data)] == data or has_nan(decoded.values)  # a NaN may come out quiet
    count = data[5]
    shapes = {COMMAND_MAGIC: (count, 0, 0), TWIST_COMMAND_MAGIC: (0, 6, 0)}
    assert decoded.shape == (shapes | {ATTITUDE_COMMAND_MAGIC: (0, 0, 4)})[data[:4]]


def sample_seeds():
    for state in FollowerState:
        sample = SampleDatagram(
            state, Refusal.NONE, 10**6, 3, 5, 7, 9, 11, 13, (0.1, 0.2, 0.3), (0.0, 0.0, 9.8),
            (1.0, 2.0),
        )  # fmt: skip
        yield encode_sample(sample, KEY)[:-MAC_BYTES]
        twist = replace(sample, thrusts=(), twist_in_b=(0.1, -0.2, 0.3, 0.0, 0.5, 1.0))
        yield encode_sample(twist, KEY)[:-MAC_BYTES]
        told = replace(
            twist, omega_in_b=NOTHING_FELT[:3], a_in_b=NOTHING_FELT[3:], twist_age_s=0.02
        )
        yield encode_sample(told, KEY)[:-MAC_BYTES]


ZEROS = slice(56, 76)
"""Of a robot without motion sensors; either sign is a zero."""


def sample_magic(decoded: SampleDatagram) -> bytes:
    """By what it says of its motion."""
    if decoded.twist_age_s is not None:
        return ODOMETRY_MAGIC
    return TWIST_SAMPLE_MAGIC if decoded.twist_in_b else SAMPLE_MAGIC


@target("sample", sample_seeds, (LinkError,), max_bytes=180, mutants=4000)
def sample(data: bytes) -> None:
    """The same for samples, whose numbers are all finite."""
    decoded = decode_sample(sealed(data), KEY)
    values = decoded.twist_in_b or decoded.thrusts
    assert all(map(isfinite, (*decoded.omega_in_b, *decoded.a_in_b, *values)))
    assert 0 <= decoded.t_us < 1 << 60
    again = encode_sample(decoded, KEY)[: len(data)]
    if data[:4] == ODOMETRY_MAGIC:
        assert not any(struct.unpack("<5f", data[ZEROS]))
        data = data[: ZEROS.start] + again[ZEROS] + data[ZEROS.stop :]
    assert again == data
    assert data[:4] == sample_magic(decoded)
    assert len(decoded.twist_in_b) in (0, 6)
    assert bool(decoded.thrusts) != bool(decoded.twist_in_b)


def con_seeds():
    for m, state in ((1, 0.0), (8, 1.0), (16, 4.0)):
        head = [1.0, float(m), 5.0, 7.0, 2.0**53 - 1.0, 11.0, 13.0, state, 2.0, 17.0]
        values = [*head, 0.1, 0.2, 0.3, 0.0, 0.0, 9.8, *m * [0.5], *(134 - m) * [0.0]]
        yield struct.pack("<I4xQ150d", 3141592, 10**15, *values)


@target("rpit_con", con_seeds, (LinkError,), max_bytes=1300, mutants=4000)
def rpit_con(data: bytes) -> None:
    """What is taken of RPIt's struct are its numbers, whole or finite as they have to be."""
    con = decode_con(data)
    values, said = struct.unpack("<I4xQ150d", data)[2:], con.sample
    assert 1 <= len(said.thrusts) <= MAX_THRUSTERS
    assert all(map(isfinite, (*said.omega_in_b, *said.a_in_b, *said.thrusts)))
    assert said.boot_id > 0
    assert said.t_us == said.nonce > 0
    head = (said.epoch, said.accepted, said.challenge, said.boot_id, said.t_us, said.state)
    assert values[2:8] == tuple(map(float, head))


def mavlink_seeds():
    moving = 1000, 0.0, 0.0, 0.0, 0.1, 0.2, 0.3
    said = {
        mavlink.HEARTBEAT: (6 << 16, 2, 12, 0x81, 4, 3),
        mavlink.ATTITUDE: moving,
        mavlink.LOCAL_POSITION_NED: moving,
        mavlink.HIGHRES_IMU: (10**6, 0.0, 0.0, -9.8, *10 * (0.1,), 63),
        mavlink.TIMESYNC: (0, 10**9),
    }
    packed = [encoded(MavlinkPacket(1, 1, kind, values), kind) for kind, values in said.items()]
    yield b"".join(packed)
    yield from packed


@target("mavlink", mavlink_seeds, (), max_bytes=600, mutants=4000)
def mavlink_datagram(data: bytes) -> None:
    """What is read is what would be written, and nothing but numbers is said for it."""
    for packet in packets(data):
        if packet is not None:
            (again,) = packets(encoded(packet, 0))
            assert repr(again) == repr(packet)  # as bytes: a field may be no number
    names = MavlinkParameters(1, 1, 191, "LOCAL_POSITION_NED")
    end = AutopilotEnd(AUTOPILOTS, PEER[0], names, 1)
    for k in range(3):
        end.receive(data, PEER, 50.0 + k)
        for going in (*end.command(end.zero(), 50.0 + k), *end.answers()):
            assert all(isfinite(value) for packet in packets(going) for value in packet.values)


def blink_seeds():
    for lasts_ms in (0, 500, LASTS_MS):
        order = BlinkOrder(10**6, lasts_ms, 62, (0, 4, -1, 2, 1, 3, 3, -1))
        yield encode_blink(BlinkDatagram(5, 7, order), KEY)[:-MAC_BYTES]


@target("blink_order", blink_seeds, (LinkError,), max_bytes=80, mutants=4000)
def blink_order(data: bytes) -> None:
    """The same for blink orders, which end soon and are never taken for a command."""
    decoded = decode_blink(sealed(data), KEY)
    assert encode_blink(decoded, KEY)[: len(data)] == data
    assert decoded.order.lasts_ms <= LASTS_MS
    assert RobotEnd(LIMITS, 9, KEY).receive(sealed(data), PEER, 10**6) == Refusal.MALFORMED


def tool_seeds():
    for opening in (0.0, 0.5, 1.0):
        yield encode_tool(ToolDatagram(5, 7, opening), KEY)[:-MAC_BYTES]


@target("tool_order", tool_seeds, (LinkError,), max_bytes=60, mutants=4000)
def tool_order(data: bytes) -> None:
    """The same for orders to a tool, which opens by no more than all."""
    decoded = decode_tool(sealed(data), KEY)
    assert encode_tool(decoded, KEY)[: len(data)] == data
    assert 0.0 <= decoded.opening <= 1.0
    assert RobotEnd(LIMITS, 9, KEY).receive(sealed(data), PEER, 10**6) == Refusal.MALFORMED


def health_seeds():
    for volts, e_stop in ((None, 2), (0.0, 1), (11.25, 0), (MOST_V, 2)):
        said = HealthDatagram(10**6, 11, 13, RobotHealth(volts, EStop(e_stop)))
        yield encode_health(said, KEY)[:-MAC_BYTES]


@target("health", health_seeds, (LinkError,), max_bytes=60, mutants=4000)
def health(data: bytes) -> None:
    """The same for what a robot tells of itself, whose voltage is one, or not known."""
    decoded = decode_health(sealed(data), KEY)
    volts = decoded.health.battery_v
    again = encode_health(decoded, KEY)
    # a NaN may have any bits beside those that make it one
    assert again[:24] == data[:24] if volts is None else again[: len(data)] == data
    assert volts is None or 0.0 <= volts <= MOST_V
    assert 0 <= decoded.t_us < 1 << 60
    assert RobotEnd(LIMITS, 9, KEY).receive(sealed(data), PEER, 10**6) == Refusal.MALFORMED


class RobotRig:
    """A robot's end, and somebody who has its key."""

    def __init__(self):
        self.end, self.now_us, self.nonce = RobotEnd(LIMITS, 9, KEY), 1_000_000, 0
        self.counter = 100
        self.taken_us = self.heard = 0

    def thrusts(self) -> list[float]:
        thrusts = self.end.setpoint(self.now_us).tolist()
        assert all(0.0 <= thrust <= LIMITS.f_max * (1.0 + 1e-5) for thrust in thrusts)
        if any(thrusts):
            assert self.end.state in MOVING, "thrust though it refuses"
            silence = self.now_us - self.taken_us
            assert silence <= LIMITS.silence_us or self.end.state != FollowerState.RUNNING
        return thrusts

    def tick(self, dt_ms: int) -> None:
        self.now_us += 1000 * dt_ms
        self.nonce += 1
        data = self.end.sample(self.now_us, self.nonce, STILL, STILL, np.array(self.thrusts()))
        assert decode_sample(data, KEY).nonce == self.nonce

    def honest(self, changes: bytes) -> bytes:
        """The next command of one who means well, with the thrust of the first byte."""
        self.counter += 1
        thrust = LIMITS.f_max * (changes[0] if changes else 0) / 255
        body = CommandDatagram(5, self.counter, self.nonce, 1, True, (thrust, thrust))
        return encode_command(body, KEY)[:-MAC_BYTES]

    def step(self, piece: bytes) -> None:
        kind, dt_ms = (piece + b"\0\0")[:2]
        self.tick(dt_ms)
        if kind % 6 == PULL:
            self.pull(piece[2:3] == b"\1")
        elif kind % 6 != TICK:
            self.heard += 1
            self.hear(kind % 6, piece[2:])

    def pull(self, is_open: bool) -> None:
        """Somebody presses its emergency stop, or releases it."""
        before = self.end.state
        self.end.wire(is_open=is_open)
        if is_open:
            assert self.end.state == FollowerState.STOPPED_BY_WIRE
            assert not any(self.thrusts()), "thrust though it is stopped by wire"
        else:
            assert self.end.state == before, "closing the wire moves nothing"

    def hear(self, kind: int, rest: bytes) -> None:
        before, state = self.thrusts(), self.end.state
        if kind == FORGED:
            assert self.end.receive(rest, STRANGER, self.now_us) == Refusal.MALFORMED
            assert self.end.state == state
            assert self.thrusts() == before
            assert STRANGER not in self.end.recipients(self.now_us)
            return
        body = bytearray(rest if kind == SEALED else self.honest(rest))
        if kind == PATCHED and len(rest) > 1:
            at = rest[1] % len(body)
            body[at : at + len(rest) - 2] = rest[2:][: len(body) - at]
        why = self.end.receive(sealed(bytes(body)), PEER, self.now_us)
        if why == Refusal.NONE:
            self.taken_us = self.now_us
        after = self.thrusts()
        assert why != Refusal.NONE or self.end.e_stop != EStop.OPEN, "taken while it is pressed"
        if why != Refusal.NONE or state in STOPPED:
            assert all(a <= b for a, b in zip(after, before, strict=True)), "refused, gives thrust"


def robot_seeds():
    def piece(kind, dt_ms=5, rest=b""):
        return bytes([kind, dt_ms]) + rest

    start = [piece(HONEST)] * 7
    flight = [piece(HONEST, rest=bytes([level])) for level in (50, 90, 120, 90)]
    yield together([*start, *flight, piece(TICK, 80), piece(TICK, 250), *start, *flight])
    yield together([*start, *flight, piece(TICK, 80), *flight])
    pressed, released = piece(PULL, rest=b"\1"), piece(PULL, rest=b"\0")
    later = piece(PATCHED, 5, b"\0\x08\x09")  # zero of another process
    yield together([released, *start, *flight, pressed, *flight, later, released, later])
    yield together([*start, *flight, piece(PATCHED, 5, b"\0\6\2")])  # flags: stop
    yield together([*start, piece(PATCHED, 5, b"\0\x08\x09"), *start])  # a later epoch
    yield together([*start, *flight, piece(SEALED, 5, next(iter(command_seeds())))])
    yield together([*start, *flight, piece(FORGED, 5, 3 * b"LLcm\2\2\1\0" + 48 * b"\0")])


@target("robot_end", robot_seeds, max_bytes=2048, mutants=600)
def robot_end(data: bytes) -> int:
    """Whatever who has the key says, and when: thrust within its range, and none unasked for."""
    rig = RobotRig()
    for piece in pieces(data):
        rig.step(piece)
    return rig.heard


def control_seeds():
    samples = list(sample_seeds())
    yield together([b"\0" + one for one in samples])
    yield together([b"\1" + one for one in samples])
    yield together([b"\2" + samples[0], b"\3" + samples[1], b"\1" + samples[2]])
    yield together([b"\0" + heard(k) for k in range(1, 8)] + [b"\1" + heard(9)])
    said = [b"\0" + one for one in health_seeds()]
    yield together([said[0], b"\0" + heard(1), *said, said[1], b"\0" + heard(2), said[2]])


def heard(counter: int, epoch: int = 9) -> bytes:
    """A sample of a robot that has heard the first command, and follows a later epoch."""
    said = SampleDatagram(
        FollowerState.REFUSING, Refusal.EPOCH, 10**6, 3, 5, epoch, 11, counter, 13, STILL, STILL,
        (0.0, 0.0),
    )  # fmt: skip
    return encode_sample(said, KEY)[:-MAC_BYTES]


@target("control_end", control_seeds, max_bytes=2048, mutants=600)
def control_end(data: bytes) -> int:
    """Whatever a robot says: samples in order, and the next command is one that can be sent."""
    challenges = iter(range(5, 1 << 20))
    end = ControlEnd(2, LIMITS.f_max, LIMITS.max_rise, 5, KEY, lambda: next(challenges))
    datagrams, last = pieces(data), None
    for k, piece in enumerate(datagrams):
        now = 0.005 * k
        armed = piece[:1] == b"\1"
        said = end.command(ThrustCommand(np.full(2, 2.0 * armed), armed), now)
        sent = decode_command(said, KEY)
        assert sent.epoch >= 5
        assert max(sent.thrusts) <= LIMITS.f_max
        dropped, told = end.dropped, end.health
        heard = end.receive(piece[1:] if piece[:1] == b"\2" else sealed(piece[1:]), now)
        if end.health is not told and end.health is not None:
            assert (piece[1:5], end.health[1], heard) == (HEALTH_MAGIC, now, None)
        else:
            assert end.dropped == dropped + (heard is None)
        if heard is not None:
            assert np.isfinite(heard.omega_in_b).all()
            assert np.isfinite(heard.a_in_b).all()
            assert heard.round_trip_s is None or 0.0 <= heard.round_trip_s <= now
            last = heard
    assert last is None or last.thrusts.shape == (2,)
    return len(datagrams)
