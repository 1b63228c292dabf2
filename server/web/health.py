"""Whether the server can do what it is for: for what watches over processes, not over robots."""

from __future__ import annotations

from server.web.session_manager import SessionManager
from server.web.status import mode_of


def problems(manager: SessionManager, t: float) -> list[str]:
    """Why not, at `t` [s], in words for whoever can mend it; empty if all is well."""
    control, recorder = mode_of(manager, t)[1], manager.recordings.why_not()
    return [
        *([f"{control}."] if control else []),
        *([f"Nothing can be recorded: {recorder}."] if recorder else []),
    ]
