"""How many places there are at the doors, and how fast they are taken."""

from __future__ import annotations

from dataclasses import dataclass

OWN_HANDLES = 192
"""File handles that the process keeps for itself: libraries, recordings, datagrams."""


@dataclass(frozen=True, slots=True)
class AdmissionLimits:
    """Places, and rates with what may come at once."""

    strangers: int = 64
    per_stranger: int = 16
    known: int = 192
    per_known: int = 64
    here: int = 64
    connections_hz: float = 32.0
    """Of all strangers: a TLS handshake costs a millisecond or two of the event loop."""
    per_stranger_connections_hz: float = 8.0
    per_known_connections_hz: float = 32.0
    here_connections_hz: float = 200.0
    requests_hz: float = 100.0
    """Of all strangers; the pages are some sixty files."""
    per_stranger_requests_hz: float = 40.0
    burst_s: float = 4.0
    """So many seconds' worth may come at once."""


def limits_for(handles: int) -> AdmissionLimits:
    """Limits that fit in so many file handles: strangers give way first."""
    usual = AdmissionLimits()
    free = max(handles - OWN_HANDLES, 16)
    known, here = min(usual.known, free * 3 // 5), min(usual.here, free // 5)
    strangers = free - known - here
    return AdmissionLimits(
        strangers=max(4, min(usual.strangers, strangers)),
        per_stranger=max(2, min(usual.per_stranger, strangers // 4)),
        known=known,
        here=here,
        per_known=max(8, min(usual.per_known, known // 3)),
    )
