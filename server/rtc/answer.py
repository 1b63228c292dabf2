"""Is a page's answer one that we take? Checked before aiortc reads it: it comes from outside."""

from __future__ import annotations

import re
from ipaddress import ip_address

from server.protocol.wire import WireError
from server.protocol.wire_records import Codec
from server.rtc.candidates import LOCAL_NAME

MAX_BYTES, MAX_LINES, MAX_LINE = 16_384, 400, 1_024
MAX_CANDIDATES = 24
MAX_NAMED_CANDIDATES = 4
"""With a name for this network instead of an address (mDNS); each costs a look-up."""
MEDIA = ("video", "application")
MEDIA_LINE = re.compile(r"m=(\w+) \d{1,5} \S+( \S+)+")
CODECS = {"H264": Codec.H264, "VP8": Codec.VP8}
OTHERS = ("rtx",)
PRINTABLE = re.compile(r"[\t\x20-\x7e]*")
CANDIDATE = re.compile(
    r"a=candidate:[\w+/=-]{1,64} [12] (?i:udp|tcp) \d{1,10} (\S{1,64}) (\d{1,5}) "
    r"typ (host|srflx|prflx|relay)( .*)?"
)
CREDENTIAL = re.compile(r"a=ice-(?:ufrag:[\w+/-]{4,64}|pwd:[\w+/-]{22,256})")
FINGERPRINT = re.compile(r"a=fingerprint:(?i:sha-(?:256|384|512)) [0-9A-Fa-f:]{95,191}")
SETUP = ("a=setup:active", "a=setup:passive")


def check_answer(sdp: str) -> dict[int, Codec]:
    """The codecs of pictures by their payload type, if the answer is one to our offer.

    Raises:
        WireError: it is not; says what would be.
    """
    lines = _lines(sdp)
    sections = _sections(lines)
    for line in lines:
        _check_line(line)
    _check_candidates([line for line in lines if line.startswith("a=candidate:")])
    _check_security(lines)
    return _codecs(sections[0])


def _lines(sdp: str) -> list[str]:
    if not 0 < len(sdp) <= MAX_BYTES:
        raise WireError("size", "sdp", f"1 to {MAX_BYTES} characters")
    lines = [line for line in sdp.replace("\r\n", "\n").split("\n") if line]
    if len(lines) > MAX_LINES or any(len(line) > MAX_LINE for line in lines):
        raise WireError("size", "sdp", f"{MAX_LINES} lines of {MAX_LINE} characters")
    if lines[:1] != ["v=0"]:
        raise WireError("type", "sdp", "a session description, beginning with v=0")
    return lines


def _sections(lines: list[str]) -> list[list[str]]:
    """The lines of the pictures and those of the data channel."""
    starts = [i for i, line in enumerate(lines) if line.startswith("m=")]
    media = [MEDIA_LINE.fullmatch(lines[i]) for i in starts]
    if tuple(found and found[1] for found in media) != MEDIA:
        raise WireError("value", "sdp.media", f"{' and '.join(MEDIA)}, in this order")
    ends = [*starts[1:], len(lines)]
    return [lines[start:end] for start, end in zip(starts, ends, strict=True)]


def _check_line(line: str) -> None:
    if not PRINTABLE.fullmatch(line) or line[1:2] != "=":
        raise WireError("type", "sdp", "lines of printable ASCII, as in a=…")
    if line.startswith(("a=ice-ufrag", "a=ice-pwd")) and not CREDENTIAL.fullmatch(line):
        raise WireError("value", "sdp.ice", "a ufrag of 4 to 64, a pwd of 22 to 256 characters")
    if line.startswith("a=fingerprint:") and not FINGERPRINT.fullmatch(line):
        raise WireError("value", "sdp.fingerprint", "sha-256, sha-384 or sha-512")
    if line.startswith("a=setup:") and line not in SETUP:
        raise WireError("value", "sdp.setup", "active or passive")


def _check_candidates(lines: list[str]) -> None:
    if len(lines) > MAX_CANDIDATES:
        raise WireError("size", "sdp.candidates", f"at most {MAX_CANDIDATES}")
    named = 0
    for line in lines:
        found = CANDIDATE.fullmatch(line)
        if found is None or int(found[2]) > 65535:
            raise WireError("value", "sdp.candidate", "as in RFC 8839: host, srflx, prflx, relay")
        if LOCAL_NAME.fullmatch(found[1]):
            named += 1
        else:
            _check_address(found[1])
    if named > MAX_NAMED_CANDIDATES:
        raise WireError("size", "sdp.candidates", f"at most {MAX_NAMED_CANDIDATES} .local names")


def _check_address(text: str) -> None:
    try:
        address = ip_address(text)
    except ValueError:
        raise WireError(
            "value", "sdp.candidate", "an IP address, or a random .local name"
        ) from None
    if address.is_multicast or address.is_unspecified or text == "255.255.255.255":
        raise WireError("value", "sdp.candidate", "the address of one machine")


def _check_security(lines: list[str]) -> None:
    for beginning in ("a=ice-ufrag:", "a=ice-pwd:", "a=fingerprint:", "a=setup:"):
        if not any(line.startswith(beginning) for line in lines):
            raise WireError("value", "sdp", f"a line {beginning}…")


def _codecs(video: list[str]) -> dict[int, Codec]:
    if "a=sendonly" not in video or video[0].split(" ")[1] == "0":
        raise WireError("value", "sdp.video", "sendonly: the page sends pictures, nothing else")
    codecs: dict[int, Codec] = {}
    for line in video:
        if not line.startswith("a=rtpmap:"):
            continue
        number, _, name = line.removeprefix("a=rtpmap:").partition(" ")
        name = name.partition("/")[0]
        if name not in (*CODECS, *OTHERS) or not (number.isdigit() and len(number) <= 3):
            raise WireError("value", "sdp.codec", f"{', '.join(CODECS)} and their rtx")
        if name in CODECS:
            codecs[int(number)] = CODECS[name]
    if not codecs:
        raise WireError("value", "sdp.codec", "H264 or VP8: the page can encode neither")
    return codecs
