"""Three roles, and which may do what takes another."""

from __future__ import annotations

from typing import Literal, get_args

Role = Literal["viewer", "operator", "supervisor"]
"""Each may do what those before it may."""
Confirm = Literal["supervisor", "self"]
"""Who confirms an operator: a supervisor, or his link is enough."""
Least = Literal["anyone", "known", "viewer", "operator", "supervisor"]
"""known: has exchanged a link, and may still wait for a supervisor or have been refused."""

RANKS = {name: rank for rank, name in enumerate(get_args(Least))}


def is_enough(role: Role, least: Least) -> bool:
    """Whether `role` may do what takes `least`."""
    return RANKS[role] >= RANKS[least]
