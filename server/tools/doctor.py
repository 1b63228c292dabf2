"""`lightleash doctor`: what this machine can do, and what to do about what it can't."""

from __future__ import annotations

import argparse
import json
import multiprocessing
import os
import platform
import queue
import sys
from collections.abc import Callable, Iterator, Sequence
from dataclasses import asdict, dataclass
from itertools import chain
from pathlib import Path

from server import __version__
from server.common.access import PhoneClientError, access_of, add_access_arguments
from server.common.child import deaf
from server.common.clock import wall
from server.common.options import Parser
from server.common.settings import SettingsError, load
from server.diagnostics.link_check import LEAST_S
from server.diagnostics.link_log import KEPT_S
from server.process.ports import listen
from server.tools.doctor_phone import examine

GOOD, POOR, BAD = "ok", "!!", "XX"
LATE_MS = 5.0
"""p99.9 above it: the loop does not hold 200 Hz."""
TEST_S = 0.1, 600.0
"""The 200 Hz test: from some ticks to what anybody waits for."""


@dataclass(frozen=True, slots=True)
class Finding:
    """One thing looked at."""

    grade: str
    what: str
    found: str
    advice: str = ""


def _jitter(seconds: float, results: multiprocessing.Queue[tuple[str, dict[str, float]]]) -> None:
    """In a process of its own, as the control loop is."""
    from server.control.realtime import Schedule, claim

    granted = claim()
    schedule = Schedule(0.005, window=round(seconds / 0.005))
    for _ in range(round(seconds / 0.005)):
        schedule.wait()
    results.put((granted, schedule.lateness_ms()))


def realtime(seconds: float) -> Iterator[Finding]:
    """Scheduling class, and how well 200 Hz is held."""
    context = multiprocessing.get_context("spawn")
    results: multiprocessing.Queue[tuple[str, dict[str, float]]] = context.Queue()
    process = context.Process(target=_jitter, args=(seconds, results))
    with deaf():
        process.start()
    try:
        granted, late = results.get(timeout=seconds + 30.0)
    except queue.Empty:
        yield Finding(BAD, "real time", "the test did not end", "see the messages above")
        return
    finally:
        process.terminate()  # it has said all, or nobody waits for it
        process.join(1.0)
    fifo = granted.startswith("SCHED_FIFO")
    advice = "permit real-time priority (deploy/lightleash.service does), or only simulate"
    yield Finding(GOOD if fifo else POOR, "real time", granted, "" if fifo else advice)
    text = ", ".join(f"{name} {value:g}" for name, value in late.items())
    held = late["p999"] <= LATE_MS
    advice = (
        ""
        if held
        else f"1 tick in 1000 is over {LATE_MS:g} ms late and the robot feels it: close "
        "other programs; on a laptop, plug in the charger"
    )
    yield Finding(
        GOOD if held else POOR, f"200 Hz for {seconds:g} s", f"late by ms: {text}", advice
    )


def certificates() -> Iterator[Finding]:
    """What phones will be shown."""
    from server.security.tls import certificate, fingerprint, own_addresses

    try:
        chosen = load(())
        made = certificate(chosen.state, chosen.names)
    except SettingsError as error:
        yield Finding(BAD, "certificate", str(error), "mend the setting")
        return
    except OSError as error:
        yield Finding(BAD, "certificate", str(error), "make the state directory writable")
        return
    addresses = ", ".join(own_addresses())
    yield Finding(GOOD, "certificate", f"{made.cert} for {addresses}", "install /ca.crt on phones")
    if made.authority is not None:
        yield Finding(GOOD, "fingerprint of ca.crt", f"SHA-256 {fingerprint(made.authority)}")


def ports(places: Sequence[tuple[str, int]]) -> Iterator[Finding]:
    """Whether `serve` could listen at these addresses and ports."""
    for host, number in places:
        try:
            listen(host, number).close()
            yield Finding(GOOD, f"port {number}", "free")
        except OSError as error:
            advice = "stop what uses it, or choose another with --https-port, --http-port"
            yield Finding(POOR, f"port {number}", str(error.__cause__ or error), advice)


def codecs() -> Iterator[Finding]:
    """Every codec, there and back."""
    import numpy as np

    from hardware.codec import CODECS, DecodeError, Decoder, Encoder

    luma = np.full((240, 320), 40, dtype=np.uint8)
    luma[100:110, 200:210] = 250
    for name in CODECS:
        try:
            data, _ = Encoder(320, 240, 30.0, 1_000_000, name).encode(luma, key=True)
            brightest = Decoder(name, 320, 240).decode(data).argmax()
            good = 100 <= brightest // 320 < 110
            yield Finding(GOOD if good else BAD, f"codec {name}", f"{len(data)} bytes a picture")
        except (DecodeError, OSError, ValueError) as error:
            yield Finding(BAD, f"codec {name}", str(error), "install the locked requirements")


def machine() -> Iterator[Finding]:
    """Processors and libraries."""
    import av
    import cv2

    cores = os.cpu_count() or 1
    advice = "" if cores > 1 else "video and control will fight for the one core"
    yield Finding(GOOD if cores > 1 else POOR, "processors", str(cores), advice)
    yield Finding(GOOD, "libraries", f"OpenCV {cv2.__version__}, PyAV {av.__version__}")


def cameras() -> Iterator[Finding]:
    """Whose calibrations are known."""
    from hardware.camera_file import CAMERAS, CameraFileError, load_camera

    for path in sorted(Path(CAMERAS).glob("*.yaml")):
        try:
            name, camera = load_camera(path)
            yield Finding(GOOD, "calibration", f"{name} {camera.width}x{camera.height}")
        except CameraFileError as error:
            yield Finding(BAD, "calibration", str(error), "mend the file")


def gains() -> Iterator[Finding]:
    """What gains of the chosen robot lack if it is not quite as its file says."""
    from hardware.gain_check import bodies_words, report, worst_words
    from hardware.robot_file import COMMANDS, RobotFileError, load_robot

    try:
        chosen = load(())
        robot_file = load_robot(chosen.robot, takes=COMMANDS)
    except (SettingsError, RobotFileError) as error:
        yield Finding(BAD, "robot", str(error), "mend the setting or the file")
        return
    if robot_file.robot.twist is not None:
        return
    if chosen.gains not in robot_file.gains:
        allowed = ", ".join(robot_file.gains)
        yield Finding(BAD, "gains", f"{chosen.gains!r} is not one of {allowed}", "mend the setting")
        return
    found = report(robot_file, robot_file.gains[chosen.gains])
    what, said = f"gains {chosen.gains} of {chosen.robot}", worst_words(found.worst)
    advice = f"less than is usual: {found.lacking}; `lightleash tune` finds others"
    grade = POOR if found.lacking else GOOD
    said += f" {bodies_words(robot_file)}"
    yield Finding(grade, what, said, advice if found.lacking else "")


def _phone(parser: Parser, arguments: argparse.Namespace) -> int:
    seconds = KEPT_S if arguments.seconds is None else arguments.seconds
    if not LEAST_S <= seconds <= KEPT_S:
        parser.error(f"--seconds {seconds:g}: allowed with --phone: {LEAST_S:g} to {KEPT_S:g}")
    try:
        return examine(access_of(arguments), seconds, print)
    except PhoneClientError as error:
        print(f"lightleash doctor: {error}", file=sys.stderr)
        return 1


def main(argv: Sequence[str] | None = None) -> int:
    """Entry of `lightleash doctor`: 0 if nothing is broken."""
    parser = Parser(prog="lightleash doctor", description=__doc__)
    parser.add_argument("--phone", action="store_true", help="of the running server: its link")
    parser.add_argument("--seconds", type=float, help="to listen (60), or of the 200 Hz test (3)")
    parser.add_argument("--json", action="store_true", help="for programs, or to send to somebody")
    add_access_arguments(parser)
    arguments = parser.parse_args(argv)
    if arguments.phone and arguments.json:
        parser.error("--json: not with --phone")
    if arguments.phone:
        return _phone(parser, arguments)
    seconds = 3.0 if arguments.seconds is None else arguments.seconds
    if not TEST_S[0] <= seconds <= TEST_S[1]:
        parser.error(f"--seconds {seconds:g}: allowed: {TEST_S[0]:g} to {TEST_S[1]:g}")
    checks: list[Callable[[], Iterator[Finding]]] = [
        machine,
        lambda: realtime(seconds),
        certificates,
        lambda: ports((("0.0.0.0", 8443), ("127.0.0.1", 8080))),
        codecs,
        cameras,
        gains,
    ]
    findings: list[Finding] = []
    for finding in chain.from_iterable(check() for check in checks):
        findings.append(finding)
        if not arguments.json:
            print(f"[{finding.grade}] {finding.what}: {finding.found}")
            if finding.advice:
                print(f"     → {finding.advice}")
    broken = any(finding.grade == BAD for finding in findings)
    if arguments.json:
        print(report(findings))
    else:
        print("Broken: see XX." if broken else "Ready.")
    return 1 if broken else 0


def report(findings: Sequence[Finding]) -> str:
    """JSON of all that was looked at, and of where."""
    system = {
        "lightleash": __version__,
        "python": platform.python_version(),
        "system": platform.platform(),
        "machine": platform.machine(),
        "at": wall(),
    }
    grades = {GOOD: "good", POOR: "poor", BAD: "broken"}
    looked_at = [{**asdict(finding), "grade": grades[finding.grade]} for finding in findings]
    return json.dumps({"system": system, "findings": looked_at}, indent=2, ensure_ascii=False)
