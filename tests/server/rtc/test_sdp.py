"""The offer asks for what we want; an answer that is anything else is refused with a reason."""

import asyncio
import contextlib
import random
import struct

import pytest
from aioice import stun
from aiortc import RTCConfiguration, RTCPeerConnection, RTCSessionDescription
from hypothesis import given
from hypothesis import strategies as st

from server.common.settings import TURN_LIVES_S, RtcSettings
from server.protocol.wire import WireError
from server.protocol.wire_records import Codec
from server.rtc.answer import MAX_BYTES, MAX_CANDIDATES, check_answer
from server.rtc.offer import Bitrates, bitrates, tuned
from server.rtc.peer import PeerCallbacks, PeerConnection
from server.virtual_phone.rtc_client import EncodedTrack

SOURCE = "127.0.0.1"
NOW_S = 1.7e9
SILENT = PeerCallbacks(*[lambda *_: None] * 5)


def talk(settings=None, answering=None):
    """(offer, answer) of our peer and a page made of aiortc."""

    async def run():
        peer = PeerConnection(settings or RtcSettings(), 3_000_000, SILENT)
        page = RTCPeerConnection(RTCConfiguration(iceServers=[]))
        try:
            offer = await peer.offer()
            page.addTrack(EncodedTrack())
            await page.setRemoteDescription(RTCSessionDescription(offer, "offer"))
            await page.setLocalDescription(await page.createAnswer())
            answer = page.localDescription.sdp
            return offer, await answering(peer, answer) if answering else answer
        finally:
            await page.close()
            await peer.close()

    return asyncio.run(run())


@pytest.fixture(scope="module")
def descriptions():
    return talk()


def test_the_offer_has_h264_first_no_brakes_and_our_bitrates(descriptions):
    offer, _ = descriptions
    names = [line.split()[1] for line in offer.splitlines() if line.startswith("a=rtpmap")]
    assert [name for name in names if "rtx" not in name] == ["H264/90000"] * 2 + ["VP8/90000"]
    for brake in ("goog-remb", "transport-cc", "abs-send-time"):
        assert brake not in offer
    assert offer.count("x-google-start-bitrate=3000") == 3
    assert offer.count("x-google-min-bitrate=750;x-google-max-bitrate=3750") == 3


def test_by_default_nobody_else_is_asked_where_we_are(descriptions):
    offer, _ = descriptions
    kinds = {line.split()[7] for line in offer.splitlines() if line.startswith("a=candidate")}
    assert kinds <= {"host"}
    assert RtcSettings().ice_servers(NOW_S) == []


def test_a_relay_is_told_to_both_ends_and_its_password_to_no_recording():
    settings = RtcSettings(turn_url="turn:relay:3478", turn_username="u", turn_password="hidden")
    assert settings.ice_servers(NOW_S) == [
        {"urls": "turn:relay:3478", "username": "u", "credential": "hidden"}
    ]
    assert "hidden" not in settings.model_dump_json()


def test_with_a_shared_secret_a_relay_s_credential_ends_by_itself():
    settings = RtcSettings(turn_url="turn:relay:3478", turn_secret="north")
    (told,) = settings.ice_servers(NOW_S)
    until, name = told["username"].split(":")
    assert int(until) == NOW_S + TURN_LIVES_S
    assert name == "lightleash"
    # printf '%s' USERNAME | openssl dgst -binary -sha1 -hmac north | openssl base64
    assert told["credential"] == "A3iOWM2ASUxD/E4BlJOlbezn4kc="
    assert "north" not in settings.model_dump_json()
    assert settings.ice_servers(NOW_S + 1) != [told]


def test_an_answer_of_a_page_is_taken(descriptions):
    _, answer = descriptions
    codecs = check_answer(answer)
    assert set(codecs.values()) == {Codec.H264, Codec.VP8}
    assert "goog-remb" not in answer


def test_every_line_that_is_said_of_a_codec_stays_one_line():
    text = "v=0\r\na=rtpmap:97 VP8/90000\r\na=rtpmap:98 rtx/90000\r\na=fmtp:98 apt=97\r\n"
    assert tuned(text, Bitrates(2_000_000, 1_000_000, 3_000_000)) == (
        "v=0\r\na=rtpmap:97 VP8/90000\r\n"
        "a=fmtp:97 x-google-start-bitrate=2000;x-google-min-bitrate=1000;"
        "x-google-max-bitrate=3000\r\na=rtpmap:98 rtx/90000\r\na=fmtp:98 apt=97\r\n"
    )
    assert bitrates(4_000_000) == Bitrates(4_000_000, 1_000_000, 5_000_000)


LINE = "a=candidate:1 1 udp 2130706431 {} 5000 typ host"
HOSTILE = {
    "nothing": (lambda sdp: "", "size"),
    "ends of lines alone": (lambda sdp: "\r\n\n", "type"),
    "a book": (lambda sdp: sdp + "a=x\r\n" * MAX_BYTES, "size"),
    "a long line": (lambda sdp: sdp + "a=" + "x" * 2000, "size"),
    "many lines": (lambda sdp: sdp + "a=b\r\n" * 500, "size"),
    "a story": (lambda sdp: "Once upon a time", "type"),
    "other letters": (lambda sdp: sdp + "a=\u202e\r\n", "type"),
    "control characters": (lambda sdp: sdp + "a=\x1b[2J\r\n", "type"),
    "sound": (lambda sdp: sdp + "m=audio 9 UDP/TLS/RTP/SAVPF 0\r\n", "value"),
    "pictures twice": (lambda sdp: sdp.replace("m=application", "m=video"), "value"),
    "no pictures": (lambda sdp: sdp.replace("m=video ", "m=text "), "value"),
    "refused pictures": (lambda sdp: sdp.replace("a=sendonly", "a=inactive"), "value"),
    "pictures for us": (lambda sdp: sdp.replace("a=sendonly", "a=sendrecv"), "value"),
    "another codec": (lambda sdp: sdp.replace("H264/90000", "H265/90000"), "value"),
    "a big payload type": (lambda sdp: sdp.replace("a=rtpmap:97 ", "a=rtpmap:97000 "), "value"),
    "many candidates": (
        lambda sdp: sdp + (LINE.format("10.0.0.9") + "\r\n") * (MAX_CANDIDATES + 1), "size",
    ),
    "many names": (
        lambda sdp: sdp + (LINE.format("0" * 36 + ".local") + "\r\n") * 5, "size",
    ),
    "a name to look up": (lambda sdp: sdp + LINE.format("evil.example.org"), "value"),
    "everybody": (lambda sdp: sdp + LINE.format("224.0.0.251"), "value"),
    "nobody": (lambda sdp: sdp + LINE.format("0.0.0.0"), "value"),
    "the whole network": (lambda sdp: sdp + LINE.format("255.255.255.255"), "value"),
    "no port": (lambda sdp: sdp + LINE.format("10.0.0.9").replace("5000", "70000"), "value"),
    "a weak fingerprint": (lambda sdp: sdp.replace("sha-256", "md5"), "value"),
    "no fingerprint": (lambda sdp: sdp.replace("a=fingerprint:", "a=print:"), "value"),
    "no secret": (lambda sdp: sdp.replace("a=ice-pwd:", "a=ice-word:"), "value"),
    "a short secret": (lambda sdp: sdp + "a=ice-pwd:short\r\n", "value"),
    "both begin": (lambda sdp: sdp.replace("a=setup:active", "a=setup:actpass"), "value"),
}  # fmt: skip


@pytest.mark.parametrize("name", HOSTILE)
def test_hostile_answers_are_refused_with_a_reason(name, descriptions):
    change, code = HOSTILE[name]
    _, answer = descriptions
    with pytest.raises(WireError) as refused:
        check_answer(change(answer))
    assert refused.value.code == code
    assert refused.value.allowed


def test_an_offer_is_answered_once():
    async def twice(peer, answer):
        await peer.answer(answer, SOURCE)
        with pytest.raises(WireError, match="one answer"):
            await peer.answer(answer, SOURCE)

    talk(answering=twice)


def mutated(sdp, rng):
    """An answer with some lines missing, said twice, out of order or misspelt."""
    lines = sdp.splitlines()
    for _ in range(rng.randint(1, 3)):
        at = rng.randrange(1, len(lines))
        match rng.randrange(4):
            case 0:
                del lines[at]
            case 1:
                lines.insert(rng.randrange(1, len(lines)), lines[at])
            case 2:
                other = rng.randrange(1, len(lines))
                lines[at], lines[other] = lines[other], lines[at]
            case 3:
                letters = list(lines[at])
                letters[rng.randrange(2, len(letters))] = rng.choice(" :;/=0aZ-")
                lines[at] = "".join(letters)
    return "\r\n".join(lines) + "\r\n"


def test_mutilated_answers_are_taken_or_refused_with_a_reason(descriptions):
    _, answer = descriptions
    rng = random.Random(5)

    async def tell(sdp):
        peer = PeerConnection(RtcSettings(), 3_000_000, SILENT)
        try:
            await peer.offer()
            await peer.answer(sdp, SOURCE)
        except WireError:
            return False
        finally:
            await peer.close()
        return True

    async def run():
        return [await tell(mutated(answer, rng)) for _ in range(60)]

    taken = asyncio.run(run())
    assert any(taken)
    assert not all(taken)


@given(st.binary(max_size=64), st.integers(0, 0xFFFF))
def test_datagrams_that_look_like_stun_are_read_or_refused(payload, kind):
    header = struct.pack("!HHI", kind & 0x3FFF, len(payload), 0x2112A442) + bytes(12)
    for data in (payload, header + payload):
        with contextlib.suppress(ValueError):
            stun.parse_message(data)


def test_a_stun_attribute_shorter_than_its_number_is_refused():
    priority = struct.pack("!HH", 0x0024, 1) + bytes(4)
    with pytest.raises(ValueError, match="no STUN message"):
        stun.parse_message(struct.pack("!HHI", 1, len(priority), 0x2112A442) + bytes(12) + priority)


def test_what_only_aiortc_finds_wrong_is_refused_too():
    async def broken(peer, answer):
        with pytest.raises(WireError, match="an answer to the offer"):
            await peer.answer(answer.replace("a=mid:0", "a=mid:7"), SOURCE)

    talk(answering=broken)
