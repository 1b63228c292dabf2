"""Bytes of MAVLink: what pymavlink writes and reads, and what is damaged."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from hardware.link.mavlink import messages as mav
from hardware.link.mavlink.packets import MavlinkPacket, encoded, packets

ALIVE = MavlinkPacket(1, 1, mav.HEARTBEAT, (6 << 16, 2, 12, 0x81, 4, 3))
TOLD = MavlinkPacket(
    1,
    191,
    mav.SET_POSITION_TARGET_LOCAL_NED,
    (1234, 0.0, 0.0, 0.0, 0.25, -0.5, 0.125, 0.0, 0.0, 0.0, 0.0, 0.5, 1479, 1, 1, 8),
)


BY_PYMAVLINK = {
    "fd09000005010100000000000600020c810403a037": ALIVE,
    "fe090501010000000600020c8104031bdf": ALIVE,  # MAVLink 1
    "fd3500000701bf540000d20400000000000000000000000000000000803e000000bf0000003e0000000000000000"
    "00000000000000000000003fc705010108cff6": TOLD,
}


def read(data):
    return list(packets(data))


@pytest.mark.parametrize("data", BY_PYMAVLINK)
def test_bytes_are_those_of_pymavlink(data):
    data, packet = bytes.fromhex(data), BY_PYMAVLINK[data]
    assert read(data) == [packet]
    assert data[0] == 0xFE or encoded(packet, data[4]) == data


def test_zeros_at_the_end_are_left_out_but_for_one_byte():
    silent = MavlinkPacket(1, 1, mav.TIMESYNC, (0, 0))
    data = encoded(silent, 0)
    assert len(data) == 10 + 1 + 2
    assert read(data) == [silent]


def test_a_datagram_may_have_many_and_what_is_not_known_is_passed_over():
    unknown = bytes.fromhex("fd020000000101f1d801") + b"\1\2" + b"\xaa\xbb"
    data = encoded(ALIVE, 1) + unknown + encoded(TOLD, 2)
    assert read(data) == [ALIVE, TOLD]


def test_a_signature_is_passed_over():
    data = bytearray(encoded(ALIVE, 1))
    data[2] = 1  # which the CRC covers
    assert read(bytes(data) + bytes(13) + encoded(TOLD, 2)) == [None, TOLD]


@pytest.mark.parametrize("k", range(len(encoded(ALIVE, 1))))
def test_a_byte_that_was_changed_is_noticed_or_makes_another_message_that_is_not_known(k):
    data = bytearray(encoded(ALIVE, 1))
    data[k] ^= 0x10
    assert ALIVE not in read(bytes(data))
    assert all(one is None for one in read(bytes(data)))


@given(st.binary(max_size=300))
def test_any_bytes_are_read_without_an_error_and_to_their_end(data):
    heard = read(b"\xfd" + data)
    assert len(heard) <= 1 + len(data) // 10
    assert all(one is None or one.message in mav.LAYOUTS for one in heard)


@given(st.lists(st.sampled_from([ALIVE, TOLD]), max_size=4), st.binary(max_size=40))
def test_what_comes_before_damage_is_read(sent, rest):
    data = b"".join(encoded(one, k) for k, one in enumerate(sent))
    assert read(data + b"\x00" + rest)[: len(sent)] == sent
    assert read(data + b"\x00" + rest)[len(sent) :] == [None]


def test_every_layout_is_that_of_pymavlink():
    theirs = pytest.importorskip(
        "pymavlink.dialects.v20.common", reason="NO PYMAVLINK: pip install pymavlink"
    )
    rng = np.random.default_rng(1)
    for message, layout in mav.LAYOUTS.items():
        kind = theirs.mavlink_map[message]
        assert kind.crc_extra == layout.crc_extra
        assert kind.unpacker.format.startswith("<")
        values = layout.fields.unpack(rng.integers(0, 60, layout.fields.size, np.uint8).tobytes())
        packet = MavlinkPacket(3, 5, message, values)
        mine = encoded(packet, 9)
        (heard,) = theirs.MAVLink(None).parse_buffer(mine)
        assert (heard.get_msgId(), heard.get_srcSystem(), heard.get_seq()) == (message, 3, 9)
        link = theirs.MAVLink(None, srcSystem=3, srcComponent=5)
        link.seq = 9
        assert read(heard.pack(link)) == [packet]
        old = heard.pack(link, force_mavlink1=True) if message < 256 else mine
        assert [one.values[:3] for one in read(old)] == [values[:3]]
