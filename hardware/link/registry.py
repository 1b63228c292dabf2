"""Every way to a robot, by the name that `[link] kind` of its robot file gives it.

Another package adds its own by an entry point of the group `lightleash.followers`, whose name is
the kind and whose object is a `LinkKind`.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from difflib import get_close_matches
from importlib.metadata import EntryPoint, entry_points

from hardware.follower import Blinking, Follower, FollowerError, HasTool
from hardware.link import robot_end, udp
from hardware.link.rpit import rpit_follower
from hardware.link.silence import SilenceTimes
from hardware.robot_file import COMMANDS, RobotFile
from pipeline.robot import Robot

GROUP = "lightleash.followers"
SIMULATED = "udp"
"""The kind by which every simulated robot is reached."""

Connect = Callable[[RobotFile, bytes, int], Follower]
"""Robot file, key of 16 bytes (zeros if the kind has none) and epoch → a link that has sent nothing
yet. Raises `FollowerError` where that can't be, with what is allowed."""


@dataclass(frozen=True, slots=True)
class LinkKind:
    """One way to robots."""

    connect: Connect
    stops_in_silence: bool
    """The far end goes to zero by itself when it hears nothing, like `robot_end.py`."""
    keyed: bool
    """Both ends share a key of `lightleash robot key`."""
    takes: tuple[str, ...] = ("thrusts",)
    """Which of `robot_file.COMMANDS` it can carry."""
    silence: SilenceTimes = robot_end.SILENCE
    """When the far end does so; of one that does not by itself, what `stopped_by` has to keep."""


OWN = {
    "udp": LinkKind(udp.connect, stops_in_silence=True, keyed=True, takes=COMMANDS),
    "rpit": LinkKind(rpit_follower.connect, stops_in_silence=False, keyed=False),
}


def link_kind(name: str) -> LinkKind:
    """The kind called so.

    Raises:
        FollowerError: there is none, or the package that brings it is broken.
    """
    if name in OWN:
        return OWN[name]
    others = {point.name: point for point in entry_points(group=GROUP)}
    if name in others:
        return _loaded(others[name])
    known = sorted({*OWN, *others})
    close = get_close_matches(name, known, n=1)
    hint = f" (did you mean {close[0]!r}?)" if close else ""
    raise FollowerError(f"link.kind = {name!r}", f"one of {', '.join(known)}{hint}")


def connect(robot_file: RobotFile, key: bytes, epoch: int) -> Follower:
    """Link to the robot of a robot file, by the kind that it names.

    Raises:
        FollowerError: no such kind, one that can't carry what the robot takes or has, or no such
            robot.
    """
    link = robot_file.link
    kind = link_kind(link.kind)
    if link.takes not in kind.takes:
        what = f"link.takes = {link.takes!r} by a link of kind {link.kind!r}"
        raise FollowerError(what, f"{' or '.join(kind.takes)} by this one")
    follower = kind.connect(robot_file, key, epoch)
    if lacking := _lacking(robot_file.robot, follower):
        follower.close()
        raise FollowerError(f"{lacking} by a link of kind {link.kind!r}", "none by this one")
    return follower


def _lacking(robot: Robot, follower: Follower) -> str:
    """What a robot has by its file and the link has no word for, or ""."""
    if robot.tool and not isinstance(follower, HasTool):
        return "[tool]"
    return "blinks = true" if robot.blinks and not isinstance(follower, Blinking) else ""


def _loaded(point: EntryPoint) -> LinkKind:
    try:
        kind = point.load()
    except (ImportError, AttributeError) as error:
        what = f"link.kind = {point.name!r}: {point.value} does not load: {error}"
        raise FollowerError(what, "an installed package that brings it") from error
    if not isinstance(kind, LinkKind):
        what = f"link.kind = {point.name!r}: {point.value} is no LinkKind"
        raise FollowerError(what, "an object of hardware.link.registry.LinkKind")
    return kind
