"""French on the phone: whatever the server may say to it is in the page's dictionary."""

from __future__ import annotations

import ast
import json
import re
from collections.abc import Iterator
from pathlib import Path

import pytest

from server.web.page_files import CLIENT
from tests.sources import parsed, texts

SPEAKERS = {
    "hardware": "camera_file follower",
    "pipeline/camera": "exposure verdict",
    "pipeline": "teleop",
    "pipeline/control": "failsafe flight_envelope latency_guard thrust_acting thruster_health"
    " twist_margins",
    "pipeline/estimation": "rate_axes sensor_doubts sensor_monitor sensor_validation",
    "pipeline/glass": "lens_meter robot_of_light",
    "pipeline/timing": "clock_synchronisation offset_watch time_offset",
    "pipeline/vision": "camera_lies gating misplaced_leds repeated_frames robot_identity vision"
    " visual_front_end",
    "server/calibration": "guide job verdict",
    "server/control": "controller gap_log process robot_clock robot_health tick_rate told_body",
    "server/diagnostics": "blame camera_health link_words load",
    "server/phone": "calibration_control calibration_session phone_session",
    "server/process": "server_process",
    "server/protocol": "command_age session",
    "server/security": "least_role pairings quotas security",
    "server/view": "glass_watch screen",
    "server/web": "app handover people_api session_manager status websocket",
}
"""Modules by room whose sentences become reasons, refusals, doubts or advice on a phone."""
ELSEWHERE = {"check": {"server/diagnostics/phone_check": "verdicts"}, "supervisor": {}}
"""Those whose sentences other pages show, by the page."""
TO_SUPERVISORS = {
    "a line of text",
    "a paired page; end the program on its computer instead",
    "the four letters on that phone's screen",
    "the newest one of the recording that runs",
    "this server has a certificate of its owner's",
    "Recorded: {}",
    "from the next press: {} times as far, {}",
    ", waits to be confirmed",
    "virtual camera:",
}
"""What is refused to supervisors, and parts of events."""
LISTENED_TO = ("pipeline", "server/calibration", "server/control", "server/phone", "server/view")
"""Rooms, and those in them, of which no module may begin to speak unheard ..."""
WHOLE = re.compile(r"[A-Z].* .*[.?]")
"""... in whole sentences."""
TO_PHONES = ("WireError", "RefusedRequest", "PairingError", "CameraFileError")
"""Errors whose words a phone may show."""
TO_LOGS = ("log_event", "note", "debug", "info", "warning", "error", "exception", "add_argument")
"""Functions whose words go to the supervisor, to logs or to the terminal."""
SHORT = ("larger", "smaller", "Tilted", "Turned", "arming", "once", "silence", "silences")
"""Of one word, so that they are not known from names of fields."""
UNTOLD = {
    # beginnings by which a sentence is known
    "Control runs slowly",
    "Pictures are",
    "The server's computer stood still",
    # to supervisors: of gains, with words of the margins that only engineers read
    "Gains {} have less margin than is usual {}: {}.",
    "With gains {} a robot with a {} or thrusters' {} of what its file says{} could become"
    " unstable",
    "`lightleash tune` finds others.",
    # to whoever writes a program for them, and in the terminal
    "of somebody who is {}",
    "true, to give up being paired as {}",
    "viewer, operator; lightleash invite makes the other one",
    "websocket, {}",
    # to who writes a page or a program
    "A key of the run file; pages bring the cookie of their pairing instead.",
    "At least:",
    "after hello",
    "as {}: {}",
    "hello first",
    "none: this robot has no tool",
    "local program ({})",
    "a twist",
    "attitude and thrust",
    "no more than {} m/s and {} rad/s",
    "no more than {} rad and {} rad/s",
    "not as {}",
    "text/plain; version=0.0.4",
    "the session of the phone that leads",
    "token operator",
    "token supervisor",
    "{} at this address",
    "{} records, {} MB a second",
    # names of stages, and of a phone without one
    "a phone",
    "capture to arrival",
    "to control",
}
"""What these modules say to others, or only look for."""
PLACE = re.compile(r"\{[^{}]*\}")
JOINS = re.compile(r"^; |^(?:\{\} )+(?=[A-Z])|^\{\}\. |(?<=\.) \{\}$")
SEVERAL, ONE = re.compile(r"\S \S"), re.compile(r"[A-Z][a-z]+\.")
"""A sentence of several words, and one of a single word."""
NAME, FIGURE = re.compile(r"[A-Z][a-z]+"), re.compile(r"[{}±\s]*(?:ms|px)")
"""Of a figure, and one without words."""


def french(name: str) -> dict[str, str]:
    """The dictionary of what the server says, of a file's name."""
    text = (CLIENT / f"src/words/french_{name}.js").read_text(encoding="utf-8")
    text = text[text.index(" SERVER = {") + 10 :]
    words: dict[str, str] = json.loads(text[: text.index("\n};") + 2])
    return words


def of_page() -> str:
    """The dictionary of what the page says, as text."""
    return (CLIENT / "src/words/french_page.js").read_text(encoding="utf-8")


def literals(tree: ast.AST) -> Iterator[str]:
    """Each text in it with {} for what is put in; no docstrings, logs, programmers' errors."""
    for node in ast.iter_child_nodes(tree):
        match node:
            case ast.Expr(value=ast.Constant(value=str())):
                continue
            case ast.Call(func=ast.Attribute(attr=name) | ast.Name(id=name)) if name in TO_LOGS:
                continue
            case ast.Raise(exc=ast.Call(func=ast.Name(id=name))) if name not in TO_PHONES:
                continue
            case ast.JoinedStr(values=values):
                parts = (part.value if isinstance(part, ast.Constant) else "{}" for part in values)
                yield PLACE.sub("{}", "".join(str(part) for part in parts))
                for part in values:
                    if not isinstance(part, ast.Constant):
                        yield from literals(part)
                continue
            case ast.Constant(value=str(text)):
                yield PLACE.sub("{}", text)
        yield from literals(node)


def sentences(text: str) -> list[str]:
    """A text's sentences, without what only joins one to others."""
    parts = re.split(r"(?<=\S\S[.!?]) (?=[^a-z])", text.strip())
    return [JOINS.sub("", part).strip() for part in parts]


def spoken(path: Path) -> set[str]:
    """All sentences of a module."""
    return {one for text in literals(parsed(texts()[path])) for one in sentences(text)}


def modules(speakers: dict[str, str]) -> list[Path]:
    """By room."""
    return [Path(room, f"{name}.py") for room in speakers for name in speakers[room].split()]


def told(every: set[str]) -> set[str]:
    """Those for people among a module's texts."""
    several = {one for one in every if SEVERAL.search(one) and re.search("[a-z]{2}", one)}
    return {*several, *(one for one in every if ONE.fullmatch(one))}


def said() -> set[str]:
    """All that a phone may be told."""
    every = {one for path in modules(SPEAKERS) for one in spoken(path)}
    rooms = [path for path in texts() if path.as_posix().startswith(LISTENED_TO)]
    whole = {one for path in rooms for one in spoken(path) if WHOLE.fullmatch(one)}
    return {*told(every), *whole, *(every & set(SHORT))} - UNTOLD - TO_SUPERVISORS


def events() -> set[str]:
    """What is said by calls of `log_event`, and is no sentence put into another."""
    calls = (
        node
        for path in texts()
        if path.as_posix().startswith("server/")
        for node in ast.walk(parsed(texts()[path]))
        if isinstance(node, ast.Call) and getattr(node.func, "attr", "") == "log_event"
    )
    every = {text for call in calls for part in call.args for text in literals(ast.Expr(part))}
    return {one for text in every for one in sentences(text)}


def said_on(page: str) -> set[str]:
    """All that is said on another page beside it, single words with a capital among them."""
    every = {one for path in modules(ELSEWHERE[page]) for one in spoken(path)}
    if page == "supervisor":
        every |= events() | TO_SUPERVISORS
    names = {one for one in every if NAME.fullmatch(one)}
    bare = {one for one in every if FIGURE.fullmatch(one)}
    return {*told(every), *names} - bare - UNTOLD - said()


def test_whatever_the_server_says_to_a_phone_has_french_words() -> None:
    assert len(said()) > 200
    known = french("server")
    missing = {one for one in said() if one not in known and f'  "{one}": ' not in of_page()}
    assert missing == set()


def test_no_french_is_kept_for_what_the_server_does_not_say() -> None:
    assert set(french("server")) - said() == set()


@pytest.mark.parametrize("page", ELSEWHERE)
def test_whatever_the_server_says_on_another_page_has_french_words_and_nothing_else_has(
    page: str,
) -> None:
    assert len(said_on(page)) > 20
    assert said_on(page) == set(french(page))
