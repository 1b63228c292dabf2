"""Session: what a page may say and when, told by name when it may not."""

from __future__ import annotations

import json
import struct
from collections.abc import Callable
from dataclasses import replace
from math import inf, nan

import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from server.common.runtime_parameters import Tune
from server.protocol import wire, wire_records
from server.protocol.messages import Command, Hello, Log, encode_message
from server.protocol.screen_messages import ClockAsk, ScreenSize
from server.protocol.session import (
    BYTES_HZ,
    MAX_FAULTS,
    MESSAGES_HZ,
    RECORDS_HZ,
    Session,
    TokenBucket,
)
from server.protocol.video_path_messages import PathChoice
from server.protocol.wire import WireError
from server.protocol.wire_records import Record

FLAT = wire_records.Motion((0.0, 0.0, 0.0), (0.0, 0.0, 9.81), None, 0)
JPEG = wire_records.Picture(wire_records.Codec.JPEG, True, 1280, 720, 0, b"\xff\xd8 not really")
ROLES = ("operator", "video", "supervisor", "screen")
TOUCH = wire_records.Touch(False, True, 0, 1)
BODIES = {
    "Motion": FLAT,
    "Picture": JPEG,
    "Touch": TOUCH,
    "Pong": wire_records.Pong(1, 2),
    "Ping": wire_records.Ping(1),
    "Credit": wire_records.Credit(1),
    "Thumbnail": wire_records.Thumbnail(b"x"),
}
MAY = {
    "operator": {"Motion", "Touch", "Pong"},
    "video": {"Picture"},
    "supervisor": set(),
    "screen": set(),
}


def hello(role: str, version: int = wire.VERSION) -> str:
    return encode_message(Hello(version, role))


def opened(role: str) -> Session:
    session = Session(role)
    session.receive(hello(role), 0.0)
    return session


def refusal(session: Session, data: str | bytes, now: float = 0.0) -> WireError:
    with pytest.raises(WireError) as caught:
        session.receive(data, now)
    assert caught.value.allowed
    return caught.value


def fault(session: Session, data: str | bytes, now: float) -> str | None:
    """Code of the refusal, if it is refused."""
    try:
        session.receive(data, now)
    except WireError as error:
        return error.code
    return None


def record(body: wire_records.Body) -> bytes:
    return wire.encode(Record(1, 2, body))


@pytest.mark.parametrize("role", ROLES)
@pytest.mark.parametrize("kind", BODIES)
def test_a_role_may_send_its_own_records_and_no_others(role: str, kind: str) -> None:
    session = opened(role)
    if kind in MAY[role]:
        heard = session.receive(record(BODIES[kind]), 0.0)
        assert isinstance(heard, Record)
        assert type(heard.body).__name__ == kind
    else:
        error = refusal(session, record(BODIES[kind]))
        assert (error.code, error.field) == ("role", "record.kind")


@pytest.mark.parametrize("role", ROLES)
def test_nothing_is_taken_before_hello_and_hello_only_once(role: str) -> None:
    session = Session(role)
    assert refusal(session, record(TOUCH)).code == "order"
    assert refusal(session, encode_message(Log("hi"))).code == "order"
    assert refusal(session, encode_message(Command("stop"))).code == "order"
    assert isinstance(session.receive(hello(role), 0.0), Hello)
    error = refusal(session, hello(role))
    assert (error.code, error.field) == ("order", "hello")


def test_a_page_of_another_version_or_at_anothers_address_stays_outside() -> None:
    session = Session("operator")
    error = refusal(session, hello("operator", wire.VERSION + 1))
    assert (error.code, error.field) == ("version", "hello.version")
    error = refusal(session, hello("supervisor"))
    assert (error.code, error.field) == ("role", "hello.role")
    assert session.hello is None


def test_pictures_sockets_give_no_commands() -> None:
    error = refusal(opened("video"), encode_message(Command("arm")))
    assert (error.code, error.field) == ("role", "message.type")
    for role in ("operator", "supervisor"):
        assert opened(role).receive(encode_message(Command("stop")), 0.0) == Command("stop")


@pytest.mark.parametrize(
    ("text", "code", "field"),
    [
        ("not JSON", "type", "message"),
        ('{"type": "nonsense"}', "value", "$.type"),
        ('{"type": "command", "what": "explode"}', "value", "$.what"),
        ('{"type": "command", "what": "arm", "force": true}', "value", "message"),
        ('{"type": "log", "text": NaN}', "type", "message"),
        ('{"type": "log", "text": 1e999}', "value", "$.text"),
        ('{"type": "log", "text": "' + 201 * "x" + '"}', "value", "$.text"),
        ('{"type": "log", "text": "' + 5000 * "x" + '"}', "size", "message"),
        ("[" * 4000, "value", "message"),
        ('{"x": ' + "[" * 4000, "type", "message"),
        ("", "type", "message"),
    ],
)
def test_messages_that_are_none_are_refused_by_name(text: str, code: str, field: str) -> None:
    error = refusal(opened("operator"), text)
    assert (error.code, error.field) == (code, field)


@pytest.mark.parametrize(
    ("data", "code", "field"),
    [
        (b"", "size", "record"),
        (bytes(wire.MAX_RECORD_BYTES + 1), "size", "record"),
        (record(TOUCH)[:-1], "size", "touch"),
        (b"X" + record(TOUCH)[1:], "type", "record.magic"),
        (record(TOUCH)[:1] + b"\x09" + record(TOUCH)[2:], "version", "record.version"),
        (record(TOUCH)[:2] + b"\x63" + record(TOUCH)[3:], "type", "record.kind"),
        (record(replace(FLAT, rotation_rate=(nan, 0.0, 0.0))), "value", "motion.rotation_rate"),
        (record(replace(FLAT, acceleration=(0.0, inf, 0.0))), "value", "motion.acceleration"),
        (record(TOUCH)[:8] + struct.pack("<q", -1) + record(TOUCH)[16:], "value", "record.time"),
    ],
)
def test_records_that_are_none_are_refused_by_name(data: bytes, code: str, field: str) -> None:
    error = refusal(opened("operator"), data)
    assert (error.code, error.field) == (code, field)


@given(st.lists(st.one_of(st.binary(max_size=80), st.text(max_size=80)), max_size=20))
def test_whatever_is_said_is_taken_or_refused(things: list[str | bytes]) -> None:
    session = opened("operator")
    for thing in things:
        assert fault(session, thing, 0.0) != ""


@given(st.dictionaries(st.text(max_size=8), st.integers() | st.text(max_size=5) | st.none()))
def test_whatever_json_is_said_first_opens_nothing_but_a_true_hello(message: object) -> None:
    session = Session("operator")
    with pytest.raises(WireError):
        session.receive(json.dumps(message), 0.0)
    assert session.hello is None


def test_fifty_faults_are_borne_and_one_more_is_not() -> None:
    session = opened("operator")
    for _ in range(MAX_FAULTS):
        refusal(session, b"")
        assert not session.hopeless
    refusal(session, b"")
    assert session.hopeless


def test_rare_faults_of_a_long_session_are_forgiven() -> None:
    session = opened("operator")
    for hour in range(10 * MAX_FAULTS):
        refusal(session, b"", 3600.0 * hour)
    assert not session.hopeless


@pytest.mark.parametrize(
    ("role", "data", "rate"),
    [
        ("operator", record(TOUCH), RECORDS_HZ),
        ("operator", encode_message(Log("x")), MESSAGES_HZ),
        ("video", record(replace(JPEG, data=b"\xff\xd8" + bytes(199_974))), BYTES_HZ / 200_000),
    ],
)
def test_what_is_too_much_a_second_is_refused_and_what_is_not_is_taken(
    role: str, data: str | bytes, rate: float
) -> None:
    session, taken, seconds, offered = opened(role), 0, 5, 3.0 * rate
    for k in range(int(seconds * offered)):
        code = fault(session, data, k / offered)
        assert code in (None, "rate")
        taken += code is None
    assert seconds * rate <= taken <= (seconds + 2) * rate + 1
    session = opened(role)
    for k in range(int(seconds * rate)):
        session.receive(data, k / (0.99 * rate))


@given(st.lists(st.floats(0.0, 10.0), min_size=1, max_size=60), st.floats(1.0, 50.0))
def test_a_bucket_never_gives_more_than_its_burst_and_its_rate(
    gaps: list[float], rate: float
) -> None:
    bucket, t, taken = TokenBucket(rate, burst=rate), 0.0, 0
    for gap in gaps:
        t += gap
        taken += bucket.take(t)
    assert taken <= rate + rate * t + 1e-6


@given(st.lists(st.floats(0.0, 1.0), min_size=1, max_size=60), st.floats(1.0, 50.0))
def test_who_waits_for_a_bucket_waits_no_longer_than_is_borne_and_for_nothing_no_more_than_it_gives(
    gaps: list[float], rate: float
) -> None:
    bucket, t, given_at = TokenBucket(rate, burst=rate), 0.0, list[float]()
    for gap in gaps:
        t += gap
        wait_s = bucket.wait(t, 0.5)
        given_at += [t + wait_s] if wait_s <= 0.5 else []
    for n, end in enumerate(sorted(given_at)):
        assert n + 1 <= rate + rate * end + 1e-6


def test_a_clock_that_goes_back_gives_nothing() -> None:
    bucket = TokenBucket(1.0, burst=1.0)
    assert bucket.take(100.0)
    assert not bucket.take(0.0)
    assert not bucket.take(0.5)


def test_a_stop_is_taken_even_of_a_page_that_says_too_much() -> None:
    session = opened("operator")
    while fault(session, encode_message(Log("x")), 0.0) != "rate":
        pass
    assert fault(session, encode_message(Command("arm")), 0.0) == "rate"
    assert session.receive(encode_message(Command("stop")), 0.0) == Command("stop")


def test_only_a_supervisor_resets_after_stop() -> None:
    reset = encode_message(Command("reset"))
    assert opened("supervisor").receive(reset, 0.1) == Command("reset")
    assert refusal(opened("operator"), reset).field == "command.what"


def test_a_supervisor_and_the_operator_choose_the_pictures_way_from_those_there_are() -> None:
    choice = PathChoice("WebSocket", "operator")
    for role in ("operator", "supervisor"):
        assert opened(role).receive(encode_message(choice), 0.0) == choice
        error = refusal(opened(role), '{"type": "path", "wish": "pigeon"}')
        assert (error.code, error.field) == ("value", "$.wish")
    assert refusal(opened("video"), encode_message(choice)).code == "role"


def test_only_a_supervisor_turns_knobs() -> None:
    wish = Tune(cutoff_hz=0.5)
    assert opened("supervisor").receive(encode_message(wish), 0.0) == wish
    for role in ("operator", "video"):
        error = refusal(opened(role), encode_message(wish))
        assert (error.code, error.field) == ("role", "message.type")


def outcome(take: Callable[[], object]) -> tuple[str, str] | None:
    """Code and field of the refusal, if it is refused."""
    try:
        take()
    except WireError as error:
        return error.code, error.field
    return None


@given(
    picture=st.builds(
        wire_records.Picture,
        st.sampled_from(wire_records.Codec),
        st.booleans(),
        st.integers(0, 65_535),
        st.integers(0, 65_535),
        st.sampled_from((0, 45, 90, 180, 270, -90)),
        st.sampled_from((b"", b"\xff\xd8", b"\x00\x00\x01", bytes(wire.MAX_RECORD_BYTES))),
        st.integers(0, 7),
        st.booleans(),
    ),
    t_us=st.sampled_from((-1, 0, 5, (1 << 60) - 1, 1 << 60)),
    role=st.sampled_from(ROLES),
)
@example(JPEG, 2, "video")
@example(replace(JPEG, data=bytes(wire.MAX_RECORD_BYTES)), 2, "video")
def test_a_picture_by_packets_is_taken_or_refused_as_its_bytes_would_be(
    picture: wire_records.Picture, t_us: int, role: str
) -> None:
    one, packed = Record(7, t_us, picture), opened(role)
    as_bytes = outcome(lambda: packed.receive(wire.encode(one), 0.0))
    admitted = outcome(lambda: opened(role).admit(one, 0.0))
    assert (as_bytes is None) == (admitted is None)
    if role == "video":
        assert as_bytes == admitted


def test_pictures_by_packets_are_limited_by_number_and_bytes() -> None:
    session, one = opened("video"), Record(1, 2, replace(JPEG, data=b"\xff\xd8" + bytes(100_000)))
    taken = 0
    while outcome(lambda: session.admit(one, 0.0)) is None:
        taken += 1
    assert taken == int(BYTES_HZ // wire.size_of(one.body))
    small, session = Record(1, 2, JPEG), opened("video")
    codes = [outcome(lambda: session.admit(small, 0.0)) for _ in range(int(2 * RECORDS_HZ) + 1)]
    assert [k for k, code in enumerate(codes) if code is not None] == [2 * RECORDS_HZ]
    assert codes[-1] == ("rate", "record")
    for sequence in (-1, 1 << 32):
        assert outcome(lambda n=sequence: opened("video").admit(Record(n, 2, JPEG), 0.0))


def test_who_said_no_hello_gets_no_picture_in_by_packets() -> None:
    assert outcome(lambda: Session("video").admit(Record(1, 2, JPEG), 0.0)) == ("order", "record")


def test_a_screen_tells_its_size_and_asks_the_time_and_wishes_for_nothing() -> None:
    screen = opened("screen")
    for said in (ScreenSize(531.0, 299.0), ClockAsk(12.5), Log("no fullscreen")):
        assert screen.receive(encode_message(said), 0.1) == said
    for wish in (Command("arm"), Command("stop"), Command("reset"), Tune(), PathChoice("auto")):
        assert refusal(opened("screen"), encode_message(wish)).code == "role"
    for role in ("operator", "video", "supervisor"):
        for said in (ScreenSize(531.0, 299.0), ClockAsk(12.5)):
            assert refusal(opened(role), encode_message(said)).code == "role"


@pytest.mark.parametrize("size", [(0.0, 300.0), (500.0, 4e3), (float("nan"), 300.0)])
def test_a_screen_of_no_size_is_refused(size: tuple[float, float]) -> None:
    text = json.dumps({"type": "glass", "width_mm": size[0], "height_mm": size[1]})
    assert refusal(opened("screen"), text).code in ("value", "type")
