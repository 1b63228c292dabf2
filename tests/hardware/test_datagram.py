"""The bytes of the link: what is written is read, and nothing else is read at all."""

import struct
from zlib import crc32

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from hardware.datagram import (
    MAX_BYTES,
    Command,
    LinkError,
    Sample,
    decode_command,
    decode_sample,
    encode_command,
    encode_sample,
    epoch_after,
    is_later,
)
from hardware.follower import EXPLANATIONS, FollowerState, Refusal

u32 = st.integers(0, 2**32 - 1)
f32 = st.floats(width=32, allow_nan=False, allow_infinity=False)
rows = st.lists(f32, min_size=1, max_size=16).map(tuple)
threes = st.tuples(f32, f32, f32)
commands = st.builds(Command, u32, u32, st.integers(0, 2**64 - 1), u32, st.booleans(), rows)
samples = st.builds(
    Sample,
    st.sampled_from(FollowerState),
    st.sampled_from(Refusal),
    st.integers(0, 2**60 - 1),
    u32,
    u32,
    u32,
    u32,
    u32,
    threes,
    threes,
    rows,
)


@settings(max_examples=40)
@given(commands)
def test_commands_are_read_as_written(command):
    assert decode_command(encode_command(command)) == command


@settings(max_examples=40)
@given(samples)
def test_samples_are_read_as_written(sample):
    assert decode_sample(encode_sample(sample)) == sample


@settings(max_examples=40)
@given(st.binary(max_size=2 * MAX_BYTES))
def test_any_bytes_give_nothing_but_a_link_error(data):
    for decode in (decode_command, decode_sample):
        with pytest.raises(LinkError):
            decode(data)


@settings(max_examples=40)
@given(commands, st.data())
def test_any_damage_of_up_to_four_bytes_in_a_row_is_found(command, data):
    good = bytearray(encode_command(command))
    start = data.draw(st.integers(0, len(good) - 1))
    damage = data.draw(st.binary(min_size=1, max_size=4).filter(any))
    for i, byte in enumerate(damage[: len(good) - start]):
        good[start + i] ^= byte
    if bytes(good) != encode_command(command):
        with pytest.raises(LinkError):
            decode_command(bytes(good))


@settings(max_examples=40)
@given(st.binary(max_size=MAX_BYTES))
def test_a_right_crc_around_anything_gives_a_command_or_a_link_error(data):
    data = b"LLcm\1" + data
    data += crc32(data).to_bytes(4, "little")
    try:
        command = decode_command(data)
    except LinkError:
        return
    assert len(data) == 32 + 4 * len(command.thrusts)


def test_the_offsets_are_the_documented_ones():
    data = encode_command(Command(1, 2, 3, 4, True, (5.0, 6.0)))
    assert len(data) == 40
    assert data[:8] == b"LLcm\x01\x02\x01\x00"
    assert struct.unpack_from("<II", data, 8) == (1, 2)
    assert struct.unpack_from("<QI", data, 16) == (3, 4)
    assert struct.unpack_from("<2f", data, 28) == (5.0, 6.0)
    sample = Sample(
        FollowerState.RAMP, Refusal.SILENT, 1, 2, 3, 4, 5, 6, (7.0, 8, 9), (10.0, 11, 12), (13.0,)
    )
    data = encode_sample(sample)
    assert len(data) == 68
    assert data[:8] == b"LLsm\x01\x01\x02\x02"
    assert struct.unpack_from("<Q5I", data, 8) == (1, 2, 3, 4, 5, 6)
    assert struct.unpack_from("<7f", data, 36) == (7, 8, 9, 10, 11, 12, 13)


@pytest.mark.parametrize("value", [np.nan, np.inf])
def test_a_sample_that_is_not_a_number_is_refused(value):
    sample = Sample(
        FollowerState.IDLE, Refusal.NONE, 1, 2, 3, 4, 5, 6, (value, 0, 0), (0.0, 0, 0), (0.0,)
    )
    with pytest.raises(LinkError, match="finite"):
        decode_sample(encode_sample(sample))


@settings(max_examples=40)
@given(u32, st.integers(1, 2**31 - 1))
def test_later_is_later_round_the_corner_and_never_both_ways(a, ahead):
    assert is_later((a + ahead) % 2**32, a)
    assert not is_later(a, (a + ahead) % 2**32)
    assert not is_later(a, a)


@settings(max_examples=40)
@given(u32)
def test_the_next_epoch_is_later_and_never_none(epoch):
    assert epoch_after(epoch) != 0
    assert is_later(epoch_after(epoch), epoch)


def test_every_refusal_has_words_for_a_person():
    assert set(EXPLANATIONS) == set(Refusal)
    assert all(text.endswith((".", "?")) for why, text in EXPLANATIONS.items() if why)
