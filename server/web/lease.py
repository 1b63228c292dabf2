"""Who leads: at most one session, and who is to be the next. Sans-I/O."""

from __future__ import annotations

LEASE_S = 2.0
"""A phone silent for longer may be taken over from."""
GIVEN_S = 30.0
"""For so long nobody else gets a lead that was given to somebody."""


class Lease:
    """The right to lead, as sessions hold it."""

    def __init__(self) -> None:
        """Begin without a leader."""
        self.holder = ""
        """Id of the session that leads, or ""."""
        self._last = ""
        self._next, self._until = "", 0.0

    def next_of(self, now: float) -> str:
        """To whom it was given, or ""; he may not have come for it yet."""
        return self._next if now < self._until else ""

    def give(self, to: str, now: float) -> None:
        """Keep it for `to`, whoever asks next."""
        self._next, self._until = to, now + GIVEN_S

    def is_free_for(self, who: str, silent_s: float | None, now: float) -> bool:
        """Whether `who` may lead; `silent_s` of the phone that leads now, None without one."""
        is_taken = silent_s is not None and silent_s < LEASE_S
        return not is_taken and self.next_of(now) in ("", who)

    def is_of_another(self, who: str) -> bool:
        """Whether somebody else than `who` has led last, and may have left the robot in the air."""
        return self._last not in ("", who)

    def take(self, who: str) -> None:
        """`who` leads."""
        self.holder = self._last = who
        if who == self._next:
            self._next = ""

    def free(self) -> None:
        """Free the lease: who led has gone."""
        self.holder = ""

    def forget(self, who: str) -> None:
        """`who` shall not lead."""
        if self._next == who:
            self._next = ""
