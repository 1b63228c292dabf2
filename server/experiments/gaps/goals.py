"""What a gap may cost."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

from server.experiments.gaps import vanish
from server.experiments.gaps.flight import RELEASE_M_S
from server.experiments.gaps.measure import GapRow
from server.experiments.gaps.schedule import heard_again
from server.experiments.gaps.vanish import Vanished

FOLLOWS_PCT: Final = {160.0: 95.0, 250.0: 93.0, 400.0: 88.0}
"""Gap [ms], every 5 s, the button held: least share of the time."""
TRACE_PCT: Final = 97.0
EXCURSION_MM: Final = 50.0
STEP_MM: Final = 1.0
BORNE_MS: Final = 400.0
"""Longer gaps are flown, and asked nothing."""


def goals(rows: Sequence[GapRow], vanished: Sequence[Vanished]) -> dict[str, bool]:
    """What is to be shown, and whether it was; nothing is said of what was not flown."""
    phones = [row for row in rows if row.link == "phone's link"]
    traces = [row for row in rows if row.way == "radio"]
    held: dict[str, bool] = {}
    for gap_ms, least in FOLLOWS_PCT.items():
        for way in ("webrtc", "websocket"):
            asked = [r for r in phones if (r.gap_ms, r.every_s, r.way) == (gap_ms, 5.0, way)]
            less = waits_longer_pct(gap_ms, 5.0) if way == "websocket" else 0.0
            for row in asked:
                why = f" ({least:g} % less what TCP waits longer)" if less else ""
                held[f"{gap_ms:g} ms every 5 s, {way}: follows {least - less:.1f} %{why}"] = (
                    row.follows_pct >= least - less
                )
    short = [row for row in phones if row.gap_ms <= BORNE_MS and row.every_s >= 5.0]
    if short:
        held[f"gaps to {BORNE_MS:g} ms every 5 s and more: no flight ended"] = all(
            row.ended == 0 for row in short
        )
    for row in (row for row in traces if "worst" not in row.link):
        held[f"{row.link}: follows {TRACE_PCT:g} %, no flight ended"] = (
            row.follows_pct >= TRACE_PCT and row.ended == 0
        )
    if short or traces:
        held |= _reference([*short, *traces])
    return held | vanish.goals(vanished)


def _reference(rows: Sequence[GapRow]) -> dict[str, bool]:
    return {
        f"gaps and traces: excursion within {EXCURSION_MM:g} mm": all(
            row.excursion_mm <= EXCURSION_MM for row in rows
        ),
        f"gaps and traces: the reference is released at no more than {RELEASE_M_S:g} m/s beyond "
        "the estimate's noise": all(
            not row.release_m_s > RELEASE_M_S + row.quiet_m_s for row in rows
        ),
        "gaps and traces: the reference has not moved in a gap but with the robot": all(
            not row.step_mm > STEP_MM for row in rows
        ),
    }


def waits_longer_pct(gap_ms: float, every_s: float) -> float:
    """Share of the time that TCP adds to a gap, by waiting for its own time-out."""
    return 100.0 * (heard_again(0.0, 1e-3 * gap_ms) - 1e-3 * gap_ms) / every_s
