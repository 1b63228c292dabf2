"""Frames of the MultiWii Serial Protocol: the firmware's own bytes, and any rubbish around them."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from hardware.flight_controller import msp
from hardware.flight_controller.msp import AnswerParser, MspAnswer, MspError

VARIANT = b"$M>\x04\x02BTFL\x1a"
IMU = b"$M>\x12f\x00\x00\x00\x00\xff\x00]\x00E\xff\xe7\xfe\x00\x00\x00\x00\x00\x00u"
"""Both as Betaflight 4.6.0 sent them."""


def answer_of(command: int, payload: bytes, direction: bytes = b">") -> bytes:
    return b"$M" + direction + msp.request(command, payload)[3:]


def test_a_request_is_what_the_firmware_takes():
    assert msp.request(msp.FC_VARIANT) == b"$M<\x00\x02\x02"
    assert msp.request(msp.SET_MOTOR, bytes([1, 2])) == b"$M<\x02\xd6\x01\x02\xd7"


def test_a_payload_that_does_not_fit_is_refused():
    with pytest.raises(MspError, match="at most 255"):
        msp.request(msp.SET_MOTOR, bytes(256))


def test_answers_of_the_firmware_are_read_in_order():
    answers = AnswerParser().feed(VARIANT + IMU)
    assert [a.command for a in answers] == [msp.FC_VARIANT, msp.RAW_IMU]
    assert answers[0].payload == b"BTFL"
    assert len(answers[1].payload) == 18


def test_a_refusal_is_told_apart():
    assert AnswerParser().feed(answer_of(200, b"", b"!")) == [MspAnswer(200, b"", refused=True)]


@given(st.lists(st.integers(1, 9), min_size=1, max_size=40))
def test_wherever_the_stream_is_cut_the_same_answers_come(cuts):
    stream, parser, answers = VARIANT + IMU + VARIANT, AnswerParser(), []
    whole = AnswerParser().feed(stream)
    for cut in [*cuts, len(stream)]:
        answers += parser.feed(stream[:cut])
        stream = stream[cut:]
    assert answers == whole


@given(st.binary(max_size=40).filter(lambda b: b"$" not in b))
def test_rubbish_between_answers_costs_none(rubbish):
    answers = AnswerParser().feed(rubbish + VARIANT + rubbish + IMU)
    assert [a.command for a in answers] == [msp.FC_VARIANT, msp.RAW_IMU]


@given(st.integers(3, len(VARIANT) - 1), st.integers(1, 255))
def test_a_damaged_answer_is_never_believed_and_the_next_ones_are(at, change):
    damaged = bytearray(VARIANT)
    damaged[at] ^= change
    answers = AnswerParser().feed(bytes(damaged) + 60 * IMU)
    assert all(a.payload == AnswerParser().feed(IMU)[0].payload for a in answers)
    assert len(answers) > 45


@given(st.binary(max_size=3000))
def test_no_bytes_break_the_parser_or_are_kept(data):
    parser = AnswerParser()
    parser.feed(data)
    assert len(parser._bytes) <= msp.MAX_FRAME
