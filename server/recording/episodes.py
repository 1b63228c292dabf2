"""What people say of a recording's episodes, each from a press of the hold button to its release.

A note is an item of the channel `supervisor/episodes`. A task counts for presses after it; a
verdict for the newest press of that number before it: a phone that comes anew counts anew.
"""

from __future__ import annotations

from typing import Annotated

import msgspec

LONGEST_TASK = 200  # characters
LARGEST_PRESS = (1 << 32) - 1
"""As a phone counts on the wire."""


class TaskNote(msgspec.Struct, frozen=True, tag="task"):
    """What episodes are for from now on."""

    text: Annotated[str, msgspec.Meta(max_length=LONGEST_TASK)]
    """In words; "" for nothing in particular."""


class VerdictNote(msgspec.Struct, frozen=True, tag="verdict"):
    """Whether somebody should learn from an episode; the last one of it counts."""

    press: Annotated[int, msgspec.Meta(ge=0, le=LARGEST_PRESS)]
    """As its phone counts."""
    keep: bool


EpisodeNote = TaskNote | VerdictNote
decode_note = msgspec.json.Decoder(EpisodeNote).decode
"""Raises msgspec.MsgspecError if it is none."""
