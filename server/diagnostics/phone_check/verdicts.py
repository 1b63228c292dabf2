"""What a phone's figures mean to who wants to lead with it: a line each, in words."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from math import isnan
from typing import Final

from pipeline.frames import GRAVITY
from pipeline.glass.display_lag import LEAST_LAG_S, MOST_LAG_S
from pipeline.glass.robot_of_light import LOOK
from server.diagnostics.phone_check.figures import Axes, GlassFigures, PhoneFigures
from server.protocol.link_messages import Grade

ORDER: Final[tuple[Grade, ...]] = ("good", "unknown", "fair", "poor")
"""From best to worst; what nobody knows spoils nothing."""
TITLES: Final = {
    "good": "Good: nothing speaks against leading a robot with this phone.",
    "fair": "Usable, with what is said below.",
    "poor": "Not yet: mend what is poor first.",
    "unknown": "Nothing speaks against it so far, but not all is known yet.",
}
"""Of the whole, by its grade."""
SURE: Final = 2.0
"""Standard deviations."""
AGES_MS: Final = (120.0, 200.0)
"""Of pictures at p95: good up to the one, fair up to the other."""
LAGS_MS: Final = (50.0, 1e3 * MOST_LAG_S)
"""Of a screen; beyond the latter nobody can lead by it."""
MINUTE_S: Final = 60.0
CALIBRATE: Final = (
    "Calibrate this camera at this lens and size, and switch zoom and stabilisation off."
)


@dataclass(frozen=True, slots=True)
class CheckLine:
    """One thing."""

    what: str
    value: str
    grade: Grade
    advice: str = ""


def verdicts(found: PhoneFigures) -> list[CheckLine]:
    """All lines, in the order in which a phone is set up."""
    return [
        *_pictures(found),
        *_motion(found),
        *_camera(found),
        *(_glass(found, found.glass) if found.glass is not None else ()),
        *_robot(found),
        CheckLine("Link", found.link.title, found.link.grade, " ".join(found.link.advice)),
        *(CheckLine("It was said", words, "poor") for words in found.complaints),
    ]


def worst(lines: list[CheckLine]) -> Grade:
    """The grade of the whole."""
    return max((line.grade for line in lines), key=ORDER.index)


def _low(value: float, good: float, fair: float) -> Grade:
    """Grade of what should be small."""
    if isnan(value):
        return "unknown"
    return "good" if value <= good else "fair" if value <= fair else "poor"


def _high(value: float, good: float, fair: float) -> Grade:
    return _low(-value, -good, -fair)


def _line(what: str, value: str, grade: Grade, advice: str) -> CheckLine:
    """With what to do where there is something to do."""
    is_known = grade != "unknown"
    return CheckLine(
        what, value if is_known else "unknown", grade, "" if grade == "good" else advice
    )


def _pictures(found: PhoneFigures) -> Iterator[CheckLine]:
    yield _line(
        "Pictures",
        f"{found.picture_hz:.1f} a second of {found.size}, {found.codec}, "
        f"{found.kbit_s:.0f} kbit/s, evenly within {found.jitter_ms:.1f} ms",
        _high(found.picture_hz, 25.0, 15.0),
        "More light, or a smaller picture: a camera in the dark takes fewer pictures.",
    )
    yield _line(
        "Lost pictures",
        f"{found.lost_pct:.1f} %",
        _low(found.lost_pct, 1.0, 5.0),
        "Try another way of pictures, a better network, or close other apps on the phone.",
    )
    p50, p95, p99 = found.age_ms
    if found.by_arrival:
        yield CheckLine(
            "Age of pictures",
            "unknown: they are dated by their arrival",
            "unknown",
            "Use a browser that says when a picture was taken: Chrome, or Safari from iOS 18 on.",
        )
    else:
        yield _line(
            "Age of pictures",
            f"{p50:.0f} ms from capture to the server, 1 in 20 over {p95:.0f}, "
            f"1 in 100 over {p99:.0f}",
            _low(p95, *AGES_MS),
            "Use a 5 GHz Wi-Fi or a cable; the robot follows as late as its pictures are old.",
        )
    if not isnan(found.end_hz):
        slower_pct = 100.0 * (1.0 - found.end_hz / found.begin_hz)
        yield _line(
            "Heat",
            f"{found.begin_hz:.1f} pictures a second at the beginning, {found.end_hz:.1f} "
            f"{found.long_s / MINUTE_S:.0f} minutes later",
            _low(slower_pct, 5.0, 20.0),
            "The phone is hot or saves power: out of its case, out of the sun, on its charger.",
        )


def _motion(found: PhoneFigures) -> Iterator[CheckLine]:
    yield _line(
        "Motion samples",
        f"{found.motion_hz:.0f} a second, the longest silence {found.motion_silence_ms:.0f} ms",
        _worse(
            _high(found.motion_hz, 50.0, 30.0),
            _low(found.motion_silence_ms, 60.0, 150.0),
        ),
        "Allow motion sensors, keep the page in front, close other apps, leave power saving.",
    )
    axes: dict[Axes, tuple[str, Grade]] = {
        "unknown": ("unknown", "unknown"),
        "up": ("up is where pictures have it; turns are unknown", "unknown"),
        "all": ("as in the pictures", "good"),
    }
    words, grade = axes[found.axes]
    advice = "" if grade == "good" else "Turn the phone about all its axes, the robot in sight."
    yield CheckLine("Axes of motion", words, grade, advice)
    yield _line(
        "Gyroscope at rest",
        f"{found.gyro_bias_deg_s:.2f} °/s",
        _low(found.gyro_bias_deg_s, 1.0, 3.0),
        "Lay the phone down for some seconds, so that its gyroscope finds its zero.",
    )
    off_pct = 100.0 * abs(found.gravity_m_s2 / GRAVITY - 1.0)
    yield _line(
        "Gravity at rest",
        f"{found.gravity_m_s2:.2f} m/s², {off_pct:.1f} % off",
        _low(off_pct, 2.0, 5.0),
        "This phone's accelerometer is badly calibrated: its vertical will be a little wrong.",
    )
    yield _line(
        "Clock",
        f"runs {found.clock_ppm:+.0f} ppm fast, known to {found.clock_error_ms:.1f} ms, "
        f"shortest round trip {found.round_trip_ms:.1f} ms",
        _low(abs(found.clock_ppm), 100.0, 300.0),
        "Its clock runs oddly: times are followed, but are a little worse.",
    )


def _worse(one: Grade, other: Grade) -> Grade:
    return max(one, other, key=ORDER.index)


def _camera(found: PhoneFigures) -> Iterator[CheckLine]:
    camera = found.camera
    if camera is None or camera.time_offset_ms is None or camera.larger_percent is None:
        yield CheckLine(
            "Gyroscope beside pictures",
            "unknown",
            "unknown",
            "Move the phone for half a minute with the robot in the picture.",
        )
        return
    offset, sigma = camera.time_offset_ms, camera.time_offset_sigma_ms or 0.0
    yield _line(
        "Dates of pictures",
        f"{offset:+.1f} ± {sigma:.1f} ms beside the gyroscope's",
        _low(abs(offset) - SURE * sigma, 10.0, 20.0),
        "Calibrate this camera: how late its pictures are dated is then known.",
    )
    larger, sigma = camera.larger_percent, camera.larger_sigma_percent or 0.0
    yield _line(
        "Lens",
        f"things look {larger:+.1f} ± {sigma:.1f} % larger than calibrated",
        _low(abs(larger) - SURE * sigma, 1.0, 3.0),
        CALIBRATE,
    )
    if found.glass is None:
        yield _stabilisation(camera.held_percent or 0.0, camera.held_sigma_percent or 0.0)
    yield _line(
        "Exposure",
        f"{camera.exposure_ms:.1f} ms" if camera.exposure_ms is not None else "not seen",
        "fair" if camera.hint else "good",
        camera.advice,
    )


def _stabilisation(held_pct: float, sigma_pct: float) -> CheckLine:
    return _line(
        "Stabilisation",
        f"hides {held_pct:.0f} ± {sigma_pct:.0f} % of the phone's turning",
        _low(held_pct - SURE * sigma_pct, 3.0, 15.0),  # what turns too much is not steadied
        "Turn the phone a little. Switch stabilisation off, in the browser's camera settings or by "
        "another lens.",
    )


def _glass(found: PhoneFigures, glass: GlassFigures) -> Iterator[CheckLine]:
    yield _line(
        "Screen's delay",
        f"{glass.lag_ms:.1f} ± {glass.lag_sigma_ms:.1f} ms",
        "poor" if glass.lag_ms < 1e3 * LEAST_LAG_S else _low(glass.lag_ms, *LAGS_MS),
        f"{LOOK} If it stays too long: the screen's game mode, or another screen.",
    )
    p50, p95, p99 = glass.light_ms
    good, fair = (age + lag for age, lag in zip(AGES_MS, LAGS_MS, strict=True))
    if found.by_arrival:
        value, worst_ms = f"{p50:.0f} ms in the middle; how it scatters is unknown", p50
    else:
        value = f"{p50:.0f} ms from its drawing, 1 in 20 over {p95:.0f}, 1 in 100 over {p99:.0f}"
        worst_ms = p95
    yield _line(
        "Light to server",
        value,
        _low(worst_ms, good, fair),
        f"{LOOK} If it stays too long: a quicker screen, a 5 GHz Wi-Fi or a cable.",
    )
    yield _stabilisation(glass.held_pct, glass.held_sigma_pct)
    focal = f"{found.focal_px:.0f} px"
    if not found.is_calibrated:
        is_looking = not isnan(found.focal_px)
        value = f"not calibrated; taken for {focal}" if is_looking else "unknown"
        yield CheckLine("Focal length", value, "fair" if is_looking else "unknown", CALIBRATE)
        return
    yield _line(
        "Focal length",
        f"{glass.focal_pct:+.1f} ± {glass.focal_sigma_pct:.1f} % beside the calibrated {focal}",
        _low(abs(glass.focal_pct) - SURE * glass.focal_sigma_pct, 1.0, 3.0),
        f"Lean the phone by 10° before the screen for half a minute. If it stays: {CALIBRATE}",
    )


def _robot(found: PhoneFigures) -> Iterator[CheckLine]:
    yield _line(
        "Robot found",
        f"in {found.found_pct:.1f} % of the pictures",
        _high(found.found_pct, 95.0, 80.0),
        "Keep all LEDs in the picture; dim other lights, or expose shorter.",
    )
    each = ", ".join(f"{dot:.2f}" for dot in found.dots_px)
    by = "the codec and the screen" if found.glass is not None else "the codec"
    codec = "" if isnan(found.codec_pct) else f"; {found.codec_pct:.0f} % of its square by {by}"
    yield _line(
        "LEDs in the picture",
        f"exact to {found.noise_px:.2f} px (each: {each})" + codec,
        _low(found.noise_px, 0.15, 0.4),
        "Hold the phone more quietly, focus on the robot, allow more kbit/s.",
    )
