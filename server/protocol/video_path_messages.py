"""What pages and server say to each other of the way that pictures shall come by."""

from __future__ import annotations

from typing import Literal

import msgspec

RequestedPath = Literal["auto", "WebRTC", "WebSocket", "JPEG"]


class PathChoice(msgspec.Struct, tag="path", forbid_unknown_fields=True, frozen=True):
    """Which way the pictures of the phone that leads shall come by, and who chose it.

    A supervisor's page → server → operator's page: choose so. Operator's page → server: so it
    stands, when welcomed and at each choice; `status` shows that to all.
    """

    wish: RequestedPath
    """`auto`: the best that works."""
    by: Literal["", "operator", "supervisor"] = ""
    """Who chose last; "": nobody yet. The server itself says who, of a supervisor's choice."""
