"""The bytes of the link: what is written is read, and nothing else is read at all."""

import json
import struct
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from hardware.follower import EXPLANATIONS, NOT_MEASURED, FollowerState, Refusal
from hardware.link.datagram import (
    MAX_BYTES,
    CommandDatagram,
    LinkError,
    SampleDatagram,
    decode_command,
    decode_sample,
    encode_command,
    encode_sample,
    is_later,
)
from hardware.link.link_key import mac

KEY = bytes(range(16))
VECTORS = json.loads((Path(__file__).parents[2] / "data" / "link_vectors.json").read_text())

u32 = st.integers(0, 2**32 - 1)
u64 = st.integers(0, 2**64 - 1)
f32 = st.floats(width=32, allow_nan=False, allow_infinity=False)
rows = st.lists(f32, min_size=1, max_size=16).map(tuple)
threes = st.tuples(f32, f32, f32)
commands = st.builds(CommandDatagram, u64, u32, u64, u64, st.booleans(), rows, st.booleans())
samples = st.builds(
    SampleDatagram,
    st.sampled_from(FollowerState),
    st.sampled_from(Refusal),
    st.integers(0, 2**60 - 1),
    u64,
    u64,
    u64,
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
    assert decode_command(encode_command(command, KEY), KEY) == command


@settings(max_examples=40)
@given(samples)
def test_samples_are_read_as_written(sample):
    assert decode_sample(encode_sample(sample, KEY), KEY) == sample


@settings(max_examples=40)
@given(st.binary(max_size=2 * MAX_BYTES))
def test_any_bytes_give_nothing_but_a_link_error(data):
    for decode in (decode_command, decode_sample):
        with pytest.raises(LinkError):
            decode(data, KEY)


@settings(max_examples=40)
@given(commands, samples, st.data())
def test_any_change_of_a_single_byte_is_found(command, sample, data):
    for good, decode in (
        (encode_command(command, KEY), decode_command),
        (encode_sample(sample, KEY), decode_sample),
    ):
        at = data.draw(st.integers(0, len(good) - 1))
        changed = bytearray(good)
        changed[at] ^= data.draw(st.integers(1, 255))
        with pytest.raises(LinkError):
            decode(bytes(changed), KEY)


@settings(max_examples=40)
@given(commands, samples, st.binary(min_size=16, max_size=16).filter(lambda key: key != KEY))
def test_nothing_made_with_another_key_is_believed(command, sample, key):
    with pytest.raises(LinkError, match="mac"):
        decode_command(encode_command(command, key), KEY)
    with pytest.raises(LinkError, match="mac"):
        decode_sample(encode_sample(sample, key), KEY)


@settings(max_examples=40)
@given(commands, samples)
def test_neither_end_believes_its_own_words_thrown_back(command, sample):
    with pytest.raises(LinkError):
        decode_sample(encode_command(command, KEY), KEY)
    with pytest.raises(LinkError):
        decode_command(encode_sample(sample, KEY), KEY)


@settings(max_examples=40)
@given(st.binary(max_size=MAX_BYTES))
def test_a_right_mac_around_anything_gives_a_command_or_a_link_error(data):
    data = b"LLcm\2" + data
    data += mac(KEY, data)
    try:
        command = decode_command(data, KEY)
    except LinkError:
        return
    assert len(data) == 52 + 4 * len(command.thrusts)


@pytest.mark.parametrize("vector", VECTORS["hmac_sha256"])
def test_the_mac_is_the_one_of_rfc_4231(vector):
    key, data = bytes.fromhex(vector["key"]), bytes.fromhex(vector["data"])
    assert mac(key, data) == bytes.fromhex(vector["digest"])[:16]


@pytest.mark.parametrize("vector", VECTORS["datagrams"])
def test_the_bytes_are_the_recorded_ones(vector):
    key, data = bytes.fromhex(vector["key"]), bytes.fromhex(vector["bytes"])
    decode = {"command": decode_command, "sample": decode_sample}[vector["kind"]]
    encode: Any = {"command": encode_command, "sample": encode_sample}[vector["kind"]]
    read = decode(data, key)
    assert encode(read, key) == data
    fields = {k: tuple(v) if isinstance(v, list) else v for k, v in vector["fields"].items()}
    assert read == type(read)(**fields)


def test_the_offsets_are_the_documented_ones():
    data = encode_command(CommandDatagram(1, 2, 3, 4, True, (5.0, 6.0)), KEY)
    assert len(data) == 60
    assert data[:8] == b"LLcm\x02\x02\x01\x00"
    assert struct.unpack_from("<QQQI", data, 8) == (1, 3, 4, 2)
    assert struct.unpack_from("<2f", data, 36) == (5.0, 6.0)
    assert data[44:] == mac(KEY, data[:44])
    data = encode_sample(sample_of(7.0), KEY)
    assert len(data) == 96
    assert data[:8] == b"LLsm\x02\x01\x02\x02"
    assert struct.unpack_from("<4Q3I", data, 8) == (1, 2, 3, 4, 5, 6, 7)
    assert struct.unpack_from("<7f", data, 52) == (7, 8, 9, 10, 11, 12, 13)
    assert data[80:] == mac(KEY, data[:80])


def sample_of(value):
    told = (FollowerState.RAMP, Refusal.SILENT, 1, 2, 3, 4, 5, 6, 7)
    return SampleDatagram(*told, (value, 8.0, 9.0), (10.0, 11.0, 12.0), (13.0,))


@pytest.mark.parametrize("value", [np.nan, np.inf])
def test_a_sample_that_is_not_a_number_is_refused(value):
    with pytest.raises(LinkError, match="finite"):
        decode_sample(encode_sample(sample_of(value), KEY), KEY)


@settings(max_examples=40)
@given(u32, st.integers(1, 2**31 - 1))
def test_later_is_later_round_the_corner_and_never_both_ways(a, ahead):
    assert is_later((a + ahead) % 2**32, a)
    assert not is_later(a, (a + ahead) % 2**32)
    assert not is_later(a, a)


def test_every_refusal_has_words_for_a_person():
    assert set(EXPLANATIONS) == set(Refusal)
    assert all(text.endswith((".", "?")) for why, text in EXPLANATIONS.items() if why)


TOLD = SampleDatagram(
    state=FollowerState.RUNNING,
    refusal=Refusal.NONE,
    t_us=1,
    nonce=2,
    challenge=3,
    epoch=4,
    boot_id=5,
    counter=6,
    accepted=7,
    omega_in_b=(0.0, 0.0, 0.0),
    a_in_b=(0.0, 0.0, 0.0),
    thrusts=(),
    twist_in_b=(0.5, 0.0, 0.0, 0.0, 0.0, 0.25),
    twist_age_s=0.0625,
)


@pytest.mark.parametrize("age_s", [0.0, 0.0625, 10.0, NOT_MEASURED])
def test_a_robot_without_motion_sensors_says_how_old_its_twist_is(age_s):
    sample = replace(TOLD, twist_age_s=age_s)
    data = encode_sample(sample, KEY)
    assert data[:4] == b"LLto"
    assert decode_sample(data, KEY) == sample


@pytest.mark.parametrize("age_s", [-0.5, 10.5, -2.0, 1e9])
def test_no_twist_is_of_the_future_or_of_long_ago(age_s):
    with pytest.raises(LinkError, match="twist_age"):
        decode_sample(encode_sample(replace(TOLD, twist_age_s=age_s), KEY), KEY)


def test_who_has_no_motion_sensors_says_nothing_by_them():
    body = bytearray(encode_sample(TOLD, KEY)[:-16])
    struct.pack_into("<f", body, 72, 9.8)
    with pytest.raises(LinkError, match="then zeros"):
        decode_sample(bytes(body) + mac(KEY, bytes(body)), KEY)
