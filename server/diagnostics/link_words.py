"""What a link's figures mean to who wants to fly with it, and what he can do about them."""

from __future__ import annotations

from server.protocol.link_messages import LinkReport

TITLES = {
    "good": "Good: the robot will follow nearly all of the time.",
    "fair": "Usable: the robot will wait for the network now and then.",
    "poor": "Poor: don't fly with this link.",
    "unknown": "Not enough was heard of the phone to say anything.",
}
SLOW_MS = 60.0
"""A round trip of more leaves little of what the robot bears without news."""
SPREAD_MS = 40.0
"""Between the usual and a slow round trip: a busy channel, or a radio that falls asleep."""
FEW_PICTURES_HZ, FEW_MOTION_HZ = 20.0, 45.0
LATE_PICTURES_MS = 150.0
LONG_WAIT_MS = 500.0
MOSTLY = 0.5
"""Of the time following; with less nobody counts how often it waits."""
SIDES = {
    "link": "the phone's link",
    "phone": "the phone, which was too busy",
    "server": "the server's computer, which was too busy",
}


def title(report: LinkReport) -> str:
    """The verdict."""
    if report.grade == "fair" and report.waits == 0:
        return "Usable, with what is said below."
    return TITLES[report.grade]


def lines(report: LinkReport) -> list[str]:
    """What to expect, and on whose side."""
    if report.grade == "unknown":
        return []
    sentences = [
        f"The robot would follow {100.0 * report.follows:.1f} % of the time.",
        *_waits(report),
    ]
    if report.rtt_ms is not None:
        slow = f", 1 in 20 takes over {report.rtt_p95_ms:.0f} ms" if report.rtt_p95_ms else ""
        sentences.append(f"Round trip {report.rtt_ms:.0f} ms{slow}.")
    if report.picture_age_ms is None:
        sentences.append("No pictures came.")
    else:
        sentences.append(
            f"Pictures: {report.picture_hz:.0f} a second, {report.picture_age_ms:.0f} ms old, "
            f"longest wait {1e-3 * (report.picture_gap_ms or 0.0):.2f} s."
        )
    sentences.append(
        f"Motion samples: {report.motion_hz:.0f} a second."
        if report.motion_hz
        else "No motion samples came."
    )
    return sentences


def _waits(report: LinkReport) -> list[str]:
    longest = f"the longest silence was {1e-3 * report.longest_ms:.2f} s"
    if report.waits + report.ends == 0:
        return [f"It would not have to wait; {longest}."]
    sentences = []
    if report.waits:
        minutely = report.waits * 60.0 / report.seconds
        often = f"{minutely:.0f} times" if minutely >= 1.5 else "once"
        sentences.append(f"It would wait for news about {often} a minute; {longest}.")
    if report.waits and report.follows < MOSTLY:
        sentences = [f"It would mostly wait for news; {longest}."]
    if report.ends:
        one = "silence" if report.ends == 1 else "silences"
        sentences.append(f"{report.ends} {one} would have ended a flight; {longest}.")
    whose = [f"{n} by {SIDES[side]}" for side, n in report.sides.items() if n]
    return [*sentences, f"Caused: {', '.join(whose)}."]


def advice(report: LinkReport) -> list[str]:
    """What to do, the most useful first."""
    if report.grade == "unknown":
        return ["Open the page on the phone, tap Start, keep it in front, and check again."]
    steps: list[str] = []
    spread = (report.rtt_p95_ms or 0.0) - (report.rtt_ms or 0.0)
    slow = (report.rtt_ms or 0.0) > SLOW_MS
    if report.sides["link"] or slow or spread > SPREAD_MS:
        steps += [
            "Use a 5 GHz Wi-Fi that nobody else uses, near its access point, or let the phone's "
            "own hotspot be the network.",
            "Surest is a USB cable. Android: run “adb reverse tcp:8080 tcp:8080” on the computer, "
            "open http://localhost:8080 on the phone, and choose the path WebSocket.",
            "Keep the phone awake and on its charger, with power saving, Bluetooth and location "
            "scans off: they put its radio to sleep.",
        ]
    if report.sides["phone"]:
        steps.append("Close other apps and tabs on the phone, and let it cool down.")
    if report.sides["server"]:
        steps.append("Close other programs on the server's computer; a laptop wants its charger.")
    if report.picture_hz < FEW_PICTURES_HZ or (report.picture_gap_ms or 0.0) > LONG_WAIT_MS:
        steps.append("Few pictures, or long waits for one: try another path or more light.")
    elif (report.picture_age_ms or 0.0) > LATE_PICTURES_MS:
        steps.append("The pictures are old: try another path for them.")
    if report.motion_hz < FEW_MOTION_HZ:
        steps.append("Few motion samples: allow motion sensors, and leave power saving.")
    return steps
