"""RPIt's structs, against bytes put together by hand."""

from __future__ import annotations

import struct

import pytest

from hardware.follower import FollowerState, Refusal
from hardware.link.datagram import CommandDatagram, LinkError
from hardware.link.rpit.structs import STRUCT, decode_con, encode_mes

LARGEST = 2**53 - 1
CON = {
    0: 1.0, 1: 2.0, 2: 5.0, 3: 7.0, 4: float(LARGEST), 5: 11.0, 6: 13.0, 7: 4.0, 8: 2.0, 9: 17.0,
    10: 0.1, 11: 0.2, 12: 0.3, 13: 1.0, 14: 2.0, 15: 9.8, 16: 0.5, 17: 0.25,
}  # fmt: skip


def con(changes=(), sent_ns=2**64 - 1, magic=3141592):
    values = {**CON, **dict(changes)}
    body = b"".join(struct.pack("<d", values.get(k, 0.0)) for k in range(150))
    return struct.pack("<I", magic) + b"\xff" * 4 + struct.pack("<Q", sent_ns) + body


def test_a_mes_has_every_value_at_its_place_and_zeros_elsewhere():
    command = CommandDatagram(
        epoch=LARGEST, counter=3, nonce=10**12, challenge=5, armed=True, thrusts=(0.5, 1.5)
    )
    data = encode_mes(command, boot_id=9, now_ns=10**18)
    assert len(data) == STRUCT.size == 1216
    assert data[:16] == struct.pack("<IIQ", 3141592, 0, 10**18)
    values = [struct.unpack("<d", data[k : k + 8])[0] for k in range(16, 1216, 8)]
    head = [1.0, 2.0, float(LARGEST), 3.0, 5.0, 9.0, 1e12, 1.0, 0.0]
    assert values == [*head, *[0.0] * 7, 0.5, 1.5, *[0.0] * 132]


def test_stop_has_a_place_of_its_own():
    stop = CommandDatagram(1, 1, 0, 5, armed=False, thrusts=(0.0,), stop=True)
    values = STRUCT.unpack(encode_mes(stop, 0, 1))[2:]
    assert values[7:9] == (0.0, 1.0)


def test_a_con_is_read_from_its_places():
    decoded = decode_con(con())
    sample = decoded.sample
    assert decoded.sent_ns == 2**64 - 1
    assert (sample.epoch, sample.accepted, sample.challenge) == (5, 7, LARGEST)
    assert (sample.boot_id, sample.t_us, sample.nonce, sample.counter) == (11, 13, 13, 17)
    assert (sample.state, sample.refusal) == (FollowerState.COAST, Refusal.SILENT)
    assert sample.omega_in_b == (0.1, 0.2, 0.3)
    assert sample.a_in_b == (1.0, 2.0, 9.8)
    assert sample.thrusts == (0.5, 0.25)


def test_values_that_are_free_may_be_anything():
    assert decode_con(con({18: float("nan"), 149: -1e300})) == decode_con(con())


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({0: 0.0}, "con.valid"),
        ({0: float("nan")}, "con.valid"),
        ({1: 0.0}, "con.thrusters"),
        ({1: 17.0}, "con.thrusters"),
        ({1: 2.5}, "con.thrusters"),
        ({2: -1.0}, "con.epoch"),
        ({2: 2.0**53}, "con.epoch"),
        ({3: 2.0**32}, "con.counter taken"),
        ({4: float("inf")}, "con.challenge"),
        ({5: 0.0}, "con.boot id"),
        ({6: 0.0}, "con.time"),
        ({6: float("nan")}, "con.time"),
        ({7: 6.0}, "con.state"),
        ({8: float(len(Refusal))}, "con.refusal"),
        ({9: 2.0**32}, "con.counter"),
        ({10: float("nan")}, "finite"),
        ({15: float("inf")}, "finite"),
        ({17: float("nan")}, "finite"),
    ],
)
def test_a_value_that_can_not_be_is_named(changes, words):
    with pytest.raises(LinkError, match=words):
        decode_con(con(changes))


@pytest.mark.parametrize("data", [b"", con()[:-1], con() + b"\0", con(magic=3141593), con()[:96]])
def test_other_sizes_and_magics_are_no_con(data):
    with pytest.raises(LinkError, match=r"size|magic"):
        decode_con(data)
