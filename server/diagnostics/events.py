"""What people should see, newest first: no page pushes out what others have to say. Sans-I/O."""

from __future__ import annotations

from collections import Counter, OrderedDict, deque

from server.protocol.session import TokenBucket

EVENTS, MOST_OF_PAGES = 12, 5
"""Events that are shown, and how many of these may be pages' doing."""
LINES_HZ, LINES_AT_ONCE = 0.2, 4.0
"""Of one kind of one page's doing."""
MAX_KINDS = 128
"""Of events that are told apart; the oldest is forgotten."""


class Events:
    """The newest, and how many were left out."""

    def __init__(self) -> None:
        """Begin without events."""
        self.shown: deque[str] = deque(maxlen=EVENTS)
        self._of_pages: deque[bool] = deque(maxlen=EVENTS)
        self._kinds: OrderedDict[str, TokenBucket] = OrderedDict()
        self._left_out: Counter[str] = Counter()

    def add(self, text: str, of: str = "", now: float = 0.0) -> str:
        """Show `text` without control characters; what is shown, "" if it is left out.

        `of` names the person whose page makes such events as fast as it likes, and their kind; ""
        for the server's own.
        """
        text = "".join(c if c.isprintable() else "·" for c in text)
        if not of:
            self._show(text, False)
            return text
        if not self._bucket(of).take(now):
            self._left_out[of] += 1
            return ""
        if left_out := self._left_out.pop(of, 0):
            text = f"{text} ({left_out} lines left out)"
        self._make_room()
        self._show(text, True)
        return text

    def count_up(self, now: float) -> list[str]:
        """Say how many were left out of those who have fallen silent meanwhile."""
        kinds = [of for of in self._left_out if self._bucket(of).take(now)]
        said = [f"{of}: {self._left_out.pop(of)} lines left out" for of in kinds]
        for text in said:
            self._make_room()
            self._show(text, True)
        return said

    def _show(self, text: str, of_page: bool) -> None:
        self.shown.appendleft(text)
        self._of_pages.appendleft(of_page)

    def _make_room(self) -> None:
        """The oldest of the pages' doing goes if there are many."""
        while sum(self._of_pages) >= MOST_OF_PAGES:
            oldest = max(n for n, of_page in enumerate(self._of_pages) if of_page)
            del self.shown[oldest], self._of_pages[oldest]

    def _bucket(self, of: str) -> TokenBucket:
        if of not in self._kinds:
            self._kinds[of] = TokenBucket(LINES_HZ, LINES_AT_ONCE)
            if len(self._kinds) > MAX_KINDS:
                forgotten, _ = self._kinds.popitem(last=False)
                self._left_out.pop(forgotten, None)
        self._kinds.move_to_end(of)
        return self._kinds[of]
