"""What comes by WebRTC: an answer, STUN from anybody, packets, pictures with their record."""

import struct
from contextlib import suppress
from types import SimpleNamespace

from aioice import stun as ice_stun
from aiortc.codecs import depayload, h264_depayload, vp8_depayload  # type: ignore[attr-defined]
from aiortc.codecs.h264 import H264Encoder
from aiortc.rtcrtpparameters import RTCRtpCodecParameters
from aiortc.rtp import (
    RtcpByePacket,
    RtcpPacket,
    RtcpPsfbPacket,
    RtcpReceiverInfo,
    RtcpRrPacket,
    RtcpRtpfbPacket,
    RtcpSdesPacket,
    RtcpSenderInfo,
    RtcpSourceInfo,
    RtcpSrPacket,
    RtpPacket,
    unwrap_rtx,
)
from aiortc.sdp import SessionDescription

from server.protocol.wire import MAX_RECORD_BYTES, WireError, decode, encode
from server.protocol.wire_records import Codec, Picture, Record
from server.rtc import peer
from server.rtc.answer import check_answer
from server.rtc.receiving import bitstream, jitter, metadata_trailer, nack
from server.rtc.receiving.frame_timestamping import FrameTimestamping
from tests.fuzz.pictures import encoded
from tests.fuzz.sequence import pieces, together
from tests.fuzz.target import target

ANSWER = """v=0
o=- 1 2 IN IP4 127.0.0.1
s=-
t=0 0
a=group:BUNDLE 0 1
a=msid-semantic: WMS *
m=video 9 UDP/TLS/RTP/SAVPF 99 100 97 98
c=IN IP4 0.0.0.0
a=rtcp:9 IN IP4 0.0.0.0
a=candidate:1 1 udp 2130706431 192.168.1.7 50123 typ host
a=candidate:2 1 tcp 1518280447 fe80::1 9 typ host tcptype active
a=candidate:3 1 udp 1677729535 8f6ef7a1-3a4e-4a0e-9c1f-1d2c3b4a5968.local 50124 typ srflx raddr 0.0.0.0 rport 0
a=ice-ufrag:4a6E
a=ice-pwd:LJ0dE6Ag4d7aUkYj9nPqRsTu
a=ice-options:trickle
a=fingerprint:sha-256 {0}
a=setup:active
a=mid:0
a=extmap:1 urn:ietf:params:rtp-hdrext:sdes:mid
a=sendonly
a=msid:- 5f4dcc3b
a=rtcp-mux
a=rtpmap:99 H264/90000
a=rtcp-fb:99 nack pli
a=fmtp:99 level-asymmetry-allowed=1;packetization-mode=1;profile-level-id=42e01f
a=rtpmap:100 rtx/90000
a=fmtp:100 apt=99
a=rtpmap:97 VP8/90000
a=rtpmap:98 rtx/90000
a=fmtp:98 apt=97
a=ssrc-group:FID 1 2
a=ssrc:1 cname:x
m=application 9 UDP/DTLS/SCTP webrtc-datachannel
c=IN IP4 0.0.0.0
a=ice-ufrag:4a6E
a=ice-pwd:LJ0dE6Ag4d7aUkYj9nPqRsTu
a=fingerprint:sha-256 {0}
a=setup:active
a=mid:1
a=sctp-port:5000
a=max-message-size:262144
""".format(":".join(f"{k:02X}" for k in range(32)))  # fmt: skip  # noqa: E501


def answer_seeds():
    return [ANSWER.encode(), ANSWER.replace("\n", "\r\n").encode()]


@target("answer", answer_seeds, (WireError,), max_bytes=17_000)
def answer(data: bytes) -> None:
    """What we take, aiortc reads, or refuses as we expect it to."""
    sdp = data.decode("utf-8", "replace")
    codecs = check_answer(sdp)
    assert codecs
    assert all(0 <= number <= 999 for number in codecs)
    try:
        SessionDescription.parse(sdp)
    except (*peer.REFUSALS, *peer.AIORTC_REFUSALS, StopIteration):  # a RuntimeError to who awaits
        pass


def stun_seeds():
    for kind in (ice_stun.Class.REQUEST, ice_stun.Class.RESPONSE, ice_stun.Class.ERROR):
        message = ice_stun.Message(ice_stun.Method.BINDING, kind, b"transaction1")
        message.attributes["USERNAME"] = "4a6E:9Yb2"
        message.attributes["PRIORITY"] = 1853759231
        message.attributes["XOR-MAPPED-ADDRESS"] = ("192.168.1.7", 50123)
        message.attributes["ICE-CONTROLLING"] = 1 << 63
        message.attributes["ERROR-CODE"] = (487, "Role Conflict")
        message.add_message_integrity(b"LJ0dE6Ag4d7aUkYj9nPqRsTu")
        message.add_fingerprint()
        yield bytes(message)


@target("stun", stun_seeds, (ValueError,), max_bytes=1500, mutants=4000)
def stun(data: bytes) -> None:
    """Through the wall that `server.rtc.peer` has built before aioice's reader."""
    message = ice_stun.parse_message(data)
    assert len(repr(message)) < 10_000


def rtcp_seeds():
    info = RtcpReceiverInfo(1, 0, 0, 65535, 20, 0, 0)
    sender = RtcpSenderInfo(1 << 63, 90_000, 10, 1000)
    packets = (
        RtcpSrPacket(1, sender, [info]),
        RtcpRrPacket(1, [info, info]),
        RtcpSdesPacket([RtcpSourceInfo(1, [(1, b"cname")])]),
        RtcpByePacket([1, 2]),
        RtcpRtpfbPacket(1, 1, 2, [5, 6, 7]),
        RtcpPsfbPacket(1, 1, 2, b""),
    )
    yield from (bytes(packet) for packet in packets)
    yield b"".join(bytes(packet) for packet in packets)


@target("rtcp", rtcp_seeds, (ValueError,), max_bytes=1500, mutants=4000)
def rtcp(data: bytes) -> None:
    assert len(RtcpPacket.parse(data)) <= len(data) / 4


H264 = RTCRtpCodecParameters("video/H264", 90_000, payloadType=99)
VP8 = RTCRtpCodecParameters("video/VP8", 90_000, payloadType=97)
CODECS = {99: Codec.H264, 97: Codec.VP8}
RTX = {100: 99, 98: 97}


def rtp_seeds():
    for kind, codec in ((99, "h264"), (97, "vp8")):
        packets = []
        for k, (data, _) in enumerate(encoded(codec, 3)):
            parts = (
                H264Encoder._packetize(H264Encoder._split_bitstream(data))
                if kind == 99
                else [b"\x10" + data[at : at + 900] for at in range(0, len(data), 900)]
            )
            for i, part in enumerate(parts):
                number, last = 65_534 + len(packets) & 0xFFFF, int(i == len(parts) - 1)
                packets.append(RtpPacket(kind, last, number, 3000 * k, 7, part).serialize())
        yield together(packets)
        yield together(packets[::-1])
        lost = [packet for k, packet in enumerate(packets) if k != 1]
        yield together([*lost, *packets])
        yield together([p[:1] + bytes([p[1] + 1]) + p[2:12] + p[2:4] + p[12:] for p in packets])


class Line:
    """Parts of `server.rtc` in the order in which a receiver calls them, in virtual time."""

    def __init__(self):
        self.t, self.frames = 1.0, []
        self.jitter = jitter.JitterBuffer(self._is_key, self._frame, self._now, lambda: 0.2)
        self.nacks = nack.NackGenerator(self._now, lambda: 0.08, lambda: 0.2)

    def _now(self):
        return self.t

    def _is_key(self, kind, data):
        return kind in CODECS and bitstream.begins_key(CODECS[kind], data)

    def _frame(self, frame):
        assert 0 < len(frame.data) <= MAX_RECORD_BYTES
        assert frame.key == self._is_key(frame.payload_type, frame.data)
        if self.frames:
            gap = frame.number - self.frames[-1].number
            assert gap >= 1
            assert gap == 1 or frame.key, "a picture that leans on a lost one"
        else:
            assert frame.key
        self.frames.append(frame)

    def take(self, data: bytes) -> None:
        packet = RtpPacket.parse(data)
        kind = packet.payload_type
        if kind in RTX:
            if len(packet.payload) < 2:
                return
            packet = unwrap_rtx(packet, payload_type=RTX[kind], ssrc=7)
        elif kind not in CODECS:
            return
        self.nacks.add(packet)
        codec = H264 if packet.payload_type == 99 else VP8
        packet._data = depayload(codec, packet.payload) if packet.payload else b""  # type: ignore[attr-defined]
        self.jitter.add(packet)


@target("rtp", rtp_seeds, max_bytes=8192)
def rtp(data: bytes) -> int:
    """Packets in any order: whole pictures come out, in order, and little is waited for."""
    line, packets = Line(), pieces(data)
    for piece in packets:
        line.t += (piece[0] if piece else 0) / 2560
        try:
            line.take(piece)
        except ValueError:  # as aiortc's receiver
            continue
        assert len(line.jitter._waiting) <= jitter.CAPACITY
        assert line.jitter._size <= MAX_RECORD_BYTES
        assert len(line.nacks._lost) <= nack.MAX_MISSING
        assert all(0 <= number < 1 << 16 for number in line.nacks.missing)
    return len(packets)


def payload_seeds():
    for data, _ in encoded("h264", 2):
        units = H264Encoder._split_bitstream(data)
        yield from (b"\0" + part for part in H264Encoder._packetize(units))
    yield b"\0\x7c\x85" + 20 * b"x"  # the first fragment of a key
    yield b"\1\x10" + encoded("vp8", 1)[0][0][:200]
    yield b"\1\x90\xe0\x81\2\3\4" + 20 * b"x"


@target("rtp_payload", payload_seeds, (ValueError,), max_bytes=2048)
def rtp_payload(data: bytes) -> None:
    """aiortc's readers of one packet's payload."""
    out = (vp8_depayload if data[:1] == b"\1" else h264_depayload)(data[1:])
    assert len(out) <= 8 * len(data)


def bitstream_seeds():
    for codec in ("h264", "vp8"):
        for data, _ in encoded(codec, 2, width=320, height=180):
            yield bytes([codec == "vp8"]) + data
    yield b"\0\0\0\0\1" + bytes.fromhex("6764001facd9405005bb0110000003001000000303c0f1831960")


@target("bitstream", bitstream_seeds, max_bytes=1024, mutants=4000)
def size_of_key(data: bytes) -> None:
    """Undecoded bytes tell a size that a record can carry, or none."""
    codec, data = (Codec.VP8 if data[:1] == b"\1" else Codec.H264), data[1:]
    size = bitstream.size_of_key(codec, data)
    if not bitstream.begins_key(codec, data):
        assert size is None
    if size is not None:
        picture = Picture(codec, True, *size, 0, data)
        with suppress(WireError):  # too large or too small: refused, with a reason
            decode(encode(Record(1, 1, picture)))


def trailer_seeds():
    half = (0.5, -0.5, 0.5, -0.5)
    yield metadata_trailer.append(
        b"\0\0\0\1\x65picture", metadata_trailer.FrameRecord(7, 123_456_789, 90, half, 2)
    )
    yield metadata_trailer.append(
        b"x", metadata_trailer.FrameRecord(2**32 - 1, 2**60 - 1, 270, None)
    )


@target("trailer", trailer_seeds, (WireError,), max_bytes=128, mutants=4000)
def split(data: bytes) -> None:
    picture, said = metadata_trailer.split(data)
    if said is None:
        assert picture == data
        return
    assert data.startswith(picture)
    assert len(data) == len(picture) + metadata_trailer.TRAILER_BYTES
    assert 0 <= said.t_us < 1 << 60
    assert said.shrunk in (0, 1, 2)
    if said.orientation_wxyz is not None:
        assert abs(sum(q * q for q in said.orientation_wxyz) - 1.0) < 1e-9
    again, repeated = metadata_trailer.split(metadata_trailer.append(picture, said))
    assert again == picture
    assert (repeated.sequence, repeated.t_us) == (said.sequence, said.t_us)
    assert (repeated.screen_angle_deg, repeated.shrunk) == (said.screen_angle_deg, said.shrunk)


STEP = struct.Struct("<BIqd")


def dating_seeds():
    steps = [(k % 3, 3000 * k, 33_333 * k, 1e5 + 33_333.0 * k) for k in range(12)]
    return [b"".join(STEP.pack(*step) for step in steps)]


@target("dating", dating_seeds, max_bytes=2048)
def dating(data: bytes) -> None:
    """Pairs, pictures with and without a record: each date is a whole number a record can carry."""
    dates = FrameTimestamping()
    for kind, stamp, t_us, arrival_us in STEP.iter_unpack(
        data[: len(data) // STEP.size * STEP.size]
    ):
        if not 0 <= t_us < 1 << 60 or not 0.0 <= arrival_us < 1e18:
            continue
        if kind % 3 == 0:
            dates.pair(stamp, t_us)
            continue
        said = SimpleNamespace(t_us=t_us) if kind % 3 == 1 else None
        date = dates.date(said, stamp, arrival_us)
        assert isinstance(date.t_us, int)
        assert -(1 << 62) < date.t_us < 1 << 62
