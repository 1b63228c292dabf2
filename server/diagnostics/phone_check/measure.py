"""From what came of a phone to figures. Pure."""

from __future__ import annotations

from collections import Counter
from math import nan, sqrt
from typing import Final

import numpy as np

from pipeline.config import FailsafeConfig
from pipeline.frames import Array
from pipeline.glass.robot_of_light import GlassSeen
from server.diagnostics.link_check import check
from server.diagnostics.phone_check.figures import GlassFigures, PhoneFigures, Quantiles
from server.diagnostics.phone_check.phone_watch import PhoneFacts, PhoneSeries, PixelLook

POSE_UNKNOWNS: Final = 6
OFTEN: Final = 0.15
"""Share of the pictures in which so many LEDs must be seen to count."""
ENDS_S: Final = 30.0
"""Beginning and end, of which the rates of pictures are compared ..."""
LONG_S: Final = 120.0
"""... where they lasted at least this long."""
NOTHING: Final = (nan, nan, nan)


def figures(series: PhoneSeries) -> PhoneFigures:
    """What a series shows."""
    link, facts, picture = series.link, series.facts, series.picture
    taken, motion = (np.array([t for t, _ in one]) for one in (link.pictures, link.motion))
    ages = _quantiles_ms(np.array([came - t for t, came in link.pictures]))
    seconds = max(link.end - link.begin, 1e-9)
    clock = facts.clock
    begin_hz, end_hz, long_s = _ends(np.array(series.taken))
    noise_px, dots_px, codec_pct = _noise(series.looks)
    return PhoneFigures(
        device=facts.device,
        seconds=seconds,
        size=f"{picture.width}x{picture.height}" if picture else "",
        codec=picture.codec.name if picture else "",
        kbit_s=8e-3 * series.bytes / seconds,
        pictures=len(taken),
        picture_hz=_rate(taken),
        jitter_ms=1e3 * float(np.diff(taken).std()) if len(taken) > 2 else nan,
        lost_pct=_lost_pct(taken, series.undecodable),
        by_arrival=picture.by_arrival if picture else False,
        age_ms=ages,
        begin_hz=begin_hz,
        end_hz=end_hz,
        long_s=long_s,
        motion_hz=_rate(motion),
        motion_silence_ms=1e3 * float(np.diff(motion).max()) if len(motion) > 1 else nan,
        axes=facts.axes,
        gyro_bias_deg_s=float(np.rad2deg(series.rest.bias)),
        gravity_m_s2=series.rest.gravity,
        clock_ppm=1e6 * clock.drift,
        clock_error_ms=1e3 * clock.error,
        round_trip_ms=1e3 * clock.round_trip,
        found_pct=_found_pct([look.found for look in series.looks]),
        noise_px=noise_px,
        dots_px=dots_px,
        codec_pct=codec_pct,
        focal_px=facts.camera.focal_px if facts.camera is not None else nan,
        is_calibrated=facts.is_calibrated,
        camera=facts.health,
        complaints=facts.complaints,
        link=check(link, FailsafeConfig()),
        glass=_glass(facts, facts.glass, ages) if facts.glass is not None else None,
    )


def _glass(facts: PhoneFacts, seen: GlassSeen, ages_ms: Quantiles) -> GlassFigures:
    """What a screen tells.

    The lag ends at the dates at which ages begin: whatever these are wrong by, their sum is not.
    One that was measured through another phone is wrong by that one's dates.
    """
    lag = seen.lag if seen.t_lag >= facts.since else None
    focal = seen.views.focal_error()
    lag_ms = 1e3 * lag.value if lag is not None else nan
    told = facts.camera.extrinsics.time_offset_s if facts.camera is not None else 0.0
    p50, p95, p99 = (age + lag_ms - 1e3 * told for age in ages_ms)
    return GlassFigures(
        lag_ms=lag_ms,
        lag_sigma_ms=1e3 * lag.sigma if lag is not None else nan,
        light_ms=(p50, p95, p99),
        focal_pct=100.0 * focal.value if focal is not None else nan,
        focal_sigma_pct=100.0 * focal.sigma if focal is not None else nan,
        held_pct=100.0 * seen.held.value if seen.held is not None else nan,
        held_sigma_pct=100.0 * seen.held.sigma if seen.held is not None else nan,
    )


def _noise(looks: tuple[PixelLook, ...]) -> tuple[float, tuple[float, ...], float]:
    """Of an LED's centre per coordinate [px], of each LED, and the share that is the codec's [%].

    A pose takes up six of the LEDs' errors: what is left is that much less. Where an LED was left
    out because it did not fit, the others tell too little: pictures with the most LEDs count.
    """
    told = [look for look in looks if 2 * len(look.led) > POSE_UNKNOWNS]
    if not told:
        return nan, (), nan
    often = Counter(len(look.led) for look in told)
    enough = (n for n, count in often.items() if count >= OFTEN * len(told))
    most = max(enough, default=max(often))
    told = [look for look in told if len(look.led) == most]
    variances: list[float] = []
    by_led: dict[int, list[float]] = {}
    for look in told:
        spare = 2 * len(look.led) - POSE_UNKNOWNS
        variances.append(sum(off**2 for off in look.off_px) / spare)
        for led, off in zip(look.led, look.off_px, strict=True):
            by_led.setdefault(led, []).append(off**2 * len(look.led) / spare)
    variance = float(np.median(variances))
    own = float(np.median([look.own_px**2 for look in told]))
    dots = tuple(sqrt(float(np.mean(by_led[led]))) for led in sorted(by_led))
    return sqrt(variance), dots, 100.0 * max(0.0, 1.0 - own / variance) if variance else nan


def _found_pct(found: list[bool]) -> float:
    """Of pictures since the first in which the robot was found: before, nobody pointed at it."""
    if not any(found):
        return 0.0 if found else nan
    since = found[found.index(True) :]
    return 100.0 * sum(since) / len(since)


def _lost_pct(taken: Array, undecodable: int) -> float:
    if len(taken) < 3:
        return nan
    rhythm, lasted = float(np.median(np.diff(np.sort(taken)))), float(np.ptp(taken))
    due = max(round(lasted / rhythm) + 1, len(taken))
    return 100.0 * (due - len(taken) + undecodable) / due


def _rate(t: Array) -> float:
    return (len(t) - 1) / float(t[-1] - t[0]) if len(t) > 1 and t[-1] > t[0] else nan


def _quantiles_ms(seconds: Array) -> Quantiles:
    if len(seconds) == 0:
        return NOTHING
    p50, p95, p99 = (1e3 * np.percentile(seconds, (50.0, 95.0, 99.0))).tolist()
    return p50, p95, p99


def _ends(taken: Array) -> tuple[float, float, float]:
    """Pictures a second at the beginning and at the end, and how long they came [s]."""
    lasted = float(taken[-1] - taken[0]) if len(taken) > 1 else 0.0
    if lasted < LONG_S:
        return nan, nan, lasted
    begin, end = taken[taken < taken[0] + ENDS_S], taken[taken > taken[-1] - ENDS_S]
    return _rate(begin), _rate(end), lasted
