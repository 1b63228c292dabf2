"""How old a request is when it arrives: a link that was away must not carry out an old one.

What a page says can lie in buffers for minutes and come when somebody else flies. The page says how
long ago its holder asked, by its own clock, and what the server's clock says, as far as it has
heard: what the server's clock says by then is the time on the way.
"""

from __future__ import annotations

from server.protocol.messages import Command
from server.protocol.wire import WireError

OLDEST_S = 3.5
"""Pages give up after 3 s; the rest is for the way."""


def age_s(command: Command, now: float) -> float:
    """Age of a request [s], at `now` [s]; on the way, as far as that is known."""
    on_the_way = 0.0 if command.server_ms is None else now - 1e-3 * command.server_ms
    # a page that knows a later time than ours heard it before this computer was started anew
    return 1e-3 * command.age_ms + max(0.0, on_the_way)


def refuse_old(command: Command, now: float) -> Command:
    """The command, if it is young enough to be obeyed at `now` [s].

    Raises:
        WireError: it is not.
    """
    if age_s(command, now) > OLDEST_S:
        raise WireError("age", "command.age_ms", f"what was asked for in the last {OLDEST_S:g} s")
    return command
