"""Who may do what: three roles, and the least one for each address in one table."""

from __future__ import annotations

from typing import Literal, get_args

Role = Literal["viewer", "operator", "supervisor"]
"""Each may do what those before it may."""
Confirm = Literal["supervisor", "self"]
"""Who confirms an operator: a supervisor, or his link is enough."""
Least = Literal["anyone", "known", "viewer", "operator", "supervisor"]
"""known: has exchanged a link, and may still wait for a supervisor or have been refused."""

RANKS = {name: rank for rank, name in enumerate(get_args(Least))}
PUBLIC_FILES = (".js", ".css", ".svg")
ADDRESSES: dict[str, Least] = {
    **dict.fromkeys(("/", "/supervisor", "/board"), "anyone"),
    **dict.fromkeys(("/api/pair", "/healthz", "/ca.crt"), "anyone"),
    "/api/whoami": "known",
    **dict.fromkeys(("/api/stop", "/api/status", "/api/link", "/metrics"), "viewer"),
    **dict.fromkeys(("/view", "/view/", "/ws/supervisor"), "viewer"),
    **dict.fromkeys(("/ws/phone", "/ws/video"), "operator"),
    **dict.fromkeys(("/api/rtc", "/api/rtc/answer", "/api/people/lead"), "operator"),
    "/api/people/keep": "operator",
    **dict.fromkeys(("/api/recording", "/api/virtual-phone", "/api/invite"), "supervisor"),
    **dict.fromkeys((f"/api/people/{d}" for d in ("confirm", "deny", "revoke")), "supervisor"),
}
"""The least role; what is not in here is the supervisor's."""


def least_of(path: str, is_read: bool) -> Least:
    """The least role that may reach `path`; files of the pages are for anyone to read."""
    if is_read and path.endswith(PUBLIC_FILES) and not path.startswith("/api/"):
        return "anyone"
    return ADDRESSES.get(path, "supervisor")


def is_enough(role: Role, least: Least) -> bool:
    """Whether `role` may do what takes `least`."""
    return RANKS[role] >= RANKS[least]
