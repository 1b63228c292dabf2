"""A person who holds the button through gaps, and lets go only when told that it does not count."""

from __future__ import annotations

from typing import Final

from server.virtual_phone.phone_script import VirtualOperator

NOTICES_S: Final = 1.0
"""In HOLD, until the person has read that the button must be pressed anew."""
LIFTED_S: Final = 0.3
HOLDS_S: Final = 1.2
"""A press that changed nothing is given up after this."""
PRESSES_S: Final = 0.3
"""After ARMED is shown."""


class Holder(VirtualOperator):
    """Keeps the button down whatever the link does."""

    lifted = False
    """Set it to have the finger off the button, whatever is shown."""

    def _wants_to_hold(self, t: float) -> bool:
        if self.leaving or self.lifted or self.mode == "LOST":
            return False
        waited = t - self._since
        match self.mode:
            case "TRACK" | "COAST":
                return self._held
            case "ARMED":
                waited -= PRESSES_S
            case "HOLD":
                if waited < NOTICES_S:
                    return self._held
                waited -= NOTICES_S + LIFTED_S
            case _:
                return False
        return waited >= 0.0 and waited % (HOLDS_S + LIFTED_S) < HOLDS_S
