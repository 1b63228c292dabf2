"""`lightleash doctor --phone`: what it will be like to fly with the operator's link."""

from __future__ import annotations

import json
import ssl
import time
import urllib.error
import urllib.request
from collections.abc import Callable
from http.client import HTTPException

import msgspec

from server.common.access import Access, PhoneClientError, direct
from server.diagnostics.link_log import KEPT_S
from server.protocol.link_messages import LinkReport

TIMEOUT_S = 5.0
EXIT_CODES = {"good": 0, "fair": 0, "poor": 1, "unknown": 1}


def examine(access: Access, seconds: float, emit: Callable[[str], None]) -> int:
    """Listen for `seconds`, `emit` the verdict; 0 if somebody may fly with it.

    Raises:
        PhoneClientError: no server there, or nobody leads.
    """
    ask(access, KEPT_S)  # says at once if there is no phone
    emit(f"Listening to the phone's link for {seconds:g} s: hold the phone as you will in flight.")
    time.sleep(seconds)
    report = ask(access, seconds)
    emit(text_of(report))
    return EXIT_CODES[report.grade]


def ask(access: Access, seconds: float) -> LinkReport:
    """The verdict on the last `seconds`.

    Raises:
        PhoneClientError: no server there, or nobody leads.
    """
    url = f"{access.url.rstrip('/')}/api/link?seconds={seconds:g}"
    headers = {"Authorization": f"Bearer {access.token}"}
    secure = access.url.startswith("https")
    try:
        request = urllib.request.Request(url, headers=headers)
        tls = ssl.create_default_context(cafile=access.ca) if secure else None
        with direct(tls).open(request, timeout=TIMEOUT_S) as answer:
            return msgspec.json.decode(answer.read(), type=LinkReport)
    except urllib.error.HTTPError as error:
        raise PhoneClientError(f"{access.url}: {_why(error.read()) or error}") from error
    except (OSError, HTTPException, msgspec.MsgspecError) as error:
        raise PhoneClientError(f"{access.url}: {' '.join(str(error).split())}") from error


def _why(body: bytes) -> str:
    """The server's refusal in words, "" if it has none."""
    try:
        said = json.loads(body)
        return f"{said['field']}: {said['allowed']}"
    except (ValueError, LookupError, TypeError):
        return ""


def text_of(report: LinkReport) -> str:
    """Text for a terminal."""
    gaps = ", ".join(f"> {ms} ms: {count}" for ms, count in report.gaps.items())
    lines = [
        report.title,
        *(f"  {line}" for line in report.lines),
        f"  Silences in {report.seconds:g} s: {gaps}; {100.0 * report.lost:.1f} % of PINGs "
        "were answered late or not at all.",
        *(f"  → {step}" for step in report.advice),
    ]
    return "\n".join(lines)
