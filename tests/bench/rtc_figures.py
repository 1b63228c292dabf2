"""What `bench_rtc` makes of the pictures of a run, and which goals they meet."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, fields

import numpy as np

from server.common.settings import VideoSettings

RATE_HZ = 30.0
CLOCK_MS = 2.0
"""So far the clocks of page and server may be apart."""
SETTLED_S = 3.0
"""From the first picture until the figures count; the bitrate is that of its last second."""
COLUMNS = (
    ("way", "way", "{}"),
    ("p50_ms", "p50 ms", "{:.1f}"),
    ("p95_ms", "p95 ms", "{:.1f}"),
    ("shot_ms", "shot ms", "{:.1f}"),
    ("way_ms", "way ms", "{:.1f}"),
    ("luma_ms", "luma ms", "{:.1f}"),
    ("dropped_percent", "drops %", "{:.1f}"),
    ("first_s", "first s", "{:.2f}"),
    ("bitrate_percent", "bitrate %", "{:.0f}"),
    ("matched_percent", "matched %", "{:.2f}"),
    ("imu_hz", "IMU Hz", "{:.1f}"),
    ("sync_ms", "sync p95 ms", "{:.2f}"),
)


@dataclass(frozen=True, slots=True)
class Row:
    """One run, or the medians of several."""

    way: str
    p50_ms: float
    """Painted to luma in numpy."""
    p95_ms: float
    shot_ms: float
    """Painted to taken by the camera, p50."""
    way_ms: float
    """Taken to whole at the server, p50: encoder and network."""
    luma_ms: float
    """Whole at the server to luma in numpy, p50: queue and decoder."""
    dropped_percent: float
    """Of 30 a second."""
    first_s: float
    """From the tap to the first whole picture of 1280x720."""
    bitrate_percent: float
    """Of what is wanted, in the third second after the first picture."""
    matched_percent: float
    """Pictures taken, as their record says, after they were painted and before the next one was."""
    imu_hz: float
    sync_ms: float
    """Error of the clock, p95."""


def judged(
    way: str, seen: dict[str, list], epoch: float, tapped: float, seconds: float, sent_bps: float
) -> Row:
    """`epoch` is when the page's clock began, `tapped` when it began to film, by our clock [s]."""
    rows = [row for row in seen["pictures"] if row[4] == 1280]
    pictures = np.array([[np.nan if x is None else x for x in row] for row in rows], float)
    t, painted, taken, size, _, came = pictures.T
    first = t[0]
    counts = (t > first + SETTLED_S) & (t <= first + SETTLED_S + seconds) & ~np.isnan(painted)
    delay = (1e3 * (t - epoch) - painted)[counts]
    shown, shot = painted[counts], 1e3 * (taken[counts] - epoch)
    own = (shot > shown - CLOCK_MS) & (shot < np.append(shown[1:], np.inf) + CLOCK_MS)
    third = (t > first + SETTLED_S - 1.0) & (t <= first + SETTLED_S)
    bps = sent_bps if "stock" in way else 8.0 * size[third].sum()
    clock = np.abs(np.array(seen["clock"]) + epoch)
    return Row(
        way=way,
        p50_ms=float(np.percentile(delay, 50)),
        p95_ms=float(np.percentile(delay, 95)),
        shot_ms=float(np.median(shot - shown)),
        way_ms=1e3 * float(np.median((came - taken)[counts])),
        luma_ms=1e3 * float(np.median((t - came)[counts])),
        dropped_percent=100.0
        * max(0.0, 1.0 - len(np.unique(painted[counts])) / (RATE_HZ * seconds)),
        first_s=first - tapped,
        bitrate_percent=100.0 * bps / VideoSettings().bitrate_bps,
        matched_percent=100.0 * float(np.mean(own)) if way != "stock" else np.nan,
        imu_hz=float(np.median(seen["imu_hz"])) if seen["imu_hz"] else np.nan,
        sync_ms=1e3 * float(np.percentile(clock, 95)) if len(clock) else np.nan,
    )


def median(rows: list[Row]) -> Row:
    figures = [field.name for field in fields(Row)][1:]
    return Row(rows[0].way, *(float(np.median([getattr(r, f) for r in rows])) for f in figures))


def goals(rows: dict[str, Row]) -> Iterator[tuple[bool, str]]:
    """Whether it is met, and the figures."""
    tuned = rows["tuned"]
    for other, most in (("stock", 0.5), ("WebCodecs", 1.2)):
        if other in rows:
            ratio = tuned.p50_ms / rows[other].p50_ms
            yield ratio <= most, f"p50 tuned / {other}: {ratio:.2f}, at most {most}"
    yield tuned.dropped_percent <= 2.0, f"drops {tuned.dropped_percent:.1f} %, at most 2"
    yield tuned.first_s <= 2.0, f"first picture after {tuned.first_s:.2f} s, at most 2"
    yield tuned.bitrate_percent >= 80.0, f"bitrate {tuned.bitrate_percent:.0f} %, at least 80"
    for way in ("tuned", "tuned VP8"):
        if way in rows:
            share = rows[way].matched_percent
            yield share == 100.0, f"{way}: records matched {share:.2f} %, 100"
    yield tuned.imu_hz >= 55.0, f"IMU {tuned.imu_hz:.1f} Hz, at least 55"
    yield tuned.sync_ms <= 1.0, f"clock p95 {tuned.sync_ms:.2f} ms, at most 1"
