"""The log of the server process: bounded, and one line stays one line.

What a stranger can make happen a thousand times a second is said a few times, then counted; and
whatever happens, so many bytes a second are written at most.
"""

from __future__ import annotations

import logging
import re
from collections import OrderedDict

from server.protocol.session import TokenBucket

FORMAT = "%(asctime)s %(name)s %(levelname)s %(message)s"
SAME_HZ, SAME_AT_ONCE = 0.2, 10.0
"""Lines of one kind."""
BYTES_HZ, BYTES_AT_ONCE = 150.0, 131_072.0
"""Of all lines: 0.67 MB in any hour."""
URGENT_BYTES_HZ = 50.0
"""Beside that for errors, which a flood of warnings must not drown."""
MAX_KINDS = 256
"""Of messages that are told apart; the oldest is forgotten."""
CONTROL = re.compile(r"[\x00-\x08\x0a-\x1f\x7f-\x9f\u2028\u2029]")


class Bounded(logging.Filter):
    """Lets so many records pass, and says with the next one how many it kept back."""

    def __init__(self) -> None:
        """Begin an empty hour."""
        super().__init__()
        self._kinds: OrderedDict[str, TokenBucket] = OrderedDict()
        self._kept_back: dict[str, int] = {}
        self._bytes = TokenBucket(BYTES_HZ, BYTES_AT_ONCE)
        self._urgent = TokenBucket(URGENT_BYTES_HZ, BYTES_AT_ONCE)
        self._formatter = logging.Formatter(FORMAT)

    def filter(self, record: logging.LogRecord) -> bool:
        """Whether it is written; `record` becomes text without control characters."""
        kind = f"{record.name} {str(record.msg).partition(chr(10))[0][:80]}"
        if not self._bucket(kind).take(record.created):
            self._kept_back[kind] = self._kept_back.get(kind, 0) + 1
            return False
        text = escaped(record.getMessage())
        kept_back = self._kept_back.pop(kind, 0)
        record.msg = f"{text} ({kept_back} more like it)" if kept_back else text
        record.args = ()
        bucket = self._urgent if record.levelno >= logging.ERROR else self._bytes
        size = len(self._formatter.format(record).encode(errors="replace")) + 1
        if bucket.take(record.created, float(size)):
            return True
        self._kept_back[kind] = kept_back + 1
        return False

    def _bucket(self, kind: str) -> TokenBucket:
        if kind not in self._kinds:
            self._kinds[kind] = TokenBucket(SAME_HZ, SAME_AT_ONCE)
            if len(self._kinds) > MAX_KINDS:
                forgotten, _ = self._kinds.popitem(last=False)
                self._kept_back.pop(forgotten, None)
        self._kinds.move_to_end(kind)
        return self._kinds[kind]


def escaped(text: str) -> str:
    r"""`text` in one line, with `\x1b` where it had an escape character: terminals obey those."""
    return CONTROL.sub(lambda found: repr(found[0])[1:-1], text)


def set_up() -> None:
    """Set up this process: INFO and above, to the standard error."""
    handler = logging.StreamHandler()
    handler.addFilter(Bounded())
    logging.basicConfig(level=logging.INFO, format=FORMAT, handlers=[handler])
