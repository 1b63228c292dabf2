"""What people should see, newest first: no page pushes out what others have to say. Sans-I/O.

What happens again is shown once, with how often and when last.
"""

from __future__ import annotations

from collections import Counter, OrderedDict, deque

from server.protocol.messages import LoggedEvent
from server.protocol.session import TokenBucket

EVENTS, MOST_OF_PAGES = 12, 5
"""Events that are shown, and how many of these may be pages' doing."""
LINES_HZ, LINES_AT_ONCE = 0.2, 4.0
"""Of one kind of one page's doing."""
MAX_KINDS = 128
"""Of events that are told apart; the oldest is forgotten."""


class Events:
    """The newest, and how many were left out."""

    def __init__(self, unix_zero_s: float = 0.0) -> None:
        """Begin without events; `unix_zero_s` is the time of day when `now` was 0."""
        self._unix_zero_s = unix_zero_s
        self.shown: deque[LoggedEvent] = deque(maxlen=EVENTS)
        self._of_pages: deque[bool] = deque(maxlen=EVENTS)
        self._kinds: OrderedDict[str, TokenBucket] = OrderedDict()
        self._left_out: Counter[str] = Counter()

    def add(self, text: str, now: float, of: str = "") -> str:
        """Show `text` without control characters; what is shown, "" if it is left out.

        `of` names the person whose page makes such events as fast as it likes, and their kind; ""
        for the server's own.
        """
        text = "".join(c if c.isprintable() else "·" for c in text)
        if not of:
            self._show(text, now, of_page=False)
            return text
        if not self._bucket(of).take(now):
            self._left_out[of] += 1
            return ""
        if left_out := self._left_out.pop(of, 0):
            text = f"{text} ({left_out} lines left out)"
        self._show(text, now, of_page=True)
        return text

    def count_up(self, now: float) -> list[str]:
        """Say how many were left out of those who have fallen silent meanwhile."""
        kinds = [of for of in self._left_out if self._bucket(of).take(now)]
        said = [f"{of}: {self._left_out.pop(of)} lines left out" for of in kinds]
        for text in said:
            self._show(text, now, of_page=True)
        return said

    def _show(self, text: str, now: float, of_page: bool) -> None:
        times = 1 + self._forget(text)
        if of_page and sum(self._of_pages) >= MOST_OF_PAGES:
            self._remove(max(n for n, one in enumerate(self._of_pages) if one))
        self.shown.appendleft(LoggedEvent(text, round(1e3 * (self._unix_zero_s + now)), times))
        self._of_pages.appendleft(of_page)

    def _forget(self, text: str) -> int:
        """Take what is shown with this text away; how often it had happened."""
        for n, event in enumerate(self.shown):
            if event.text == text:
                self._remove(n)
                return event.times
        return 0

    def _remove(self, n: int) -> None:
        del self.shown[n], self._of_pages[n]

    def _bucket(self, of: str) -> TokenBucket:
        if of not in self._kinds:
            self._kinds[of] = TokenBucket(LINES_HZ, LINES_AT_ONCE)
            if len(self._kinds) > MAX_KINDS:
                forgotten, _ = self._kinds.popitem(last=False)
                self._left_out.pop(forgotten, None)
        self._kinds.move_to_end(of)
        return self._kinds[of]
