"""What a target is: a parser of bytes from outside, the errors it may raise, and its laws."""

import contextlib
import time
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

FOUND = Path(__file__).parent / "found"
"""Inputs that once were findings: one folder a target."""
CALLS = ".calls"
"""Beside the folder of a corpus: how often the parser was called, 8 bytes of this machine."""


class TooSlowError(Exception):
    """An input that takes more of the processor than the target allows."""


@dataclass(frozen=True)
class Target:
    """One parser. `run` raises what is neither allowed nor a law that holds: a finding."""

    name: str
    run: Callable[[bytes], int | None]
    """How often its parser was called, if an input is a sequence of pieces; None: once."""
    make_seeds: Callable[[], Iterable[bytes]]
    allowed: tuple[type[Exception], ...]
    """What the parser says that it raises of bytes which it does not take."""
    max_bytes: int
    """Of an input; where the parser itself takes less, a little more than that."""
    longest_s: float
    """Processor time for one input."""
    mutants: int
    """How many mutated seeds the plain tests try."""

    @cached_property
    def seeds(self) -> list[bytes]:
        """Good inputs, from our own encoders and from recordings."""
        return list(self.make_seeds())

    def found(self) -> list[Path]:
        """Stored inputs, each a finding that was mended."""
        return sorted(path for path in (FOUND / self.name).glob("*") if path.is_file())

    def check(self, data: bytes) -> int:
        """Run on `data`, tell how often its parser was called; raises only findings."""
        started, calls = time.process_time(), None
        with contextlib.suppress(self.allowed):
            calls = self.run(data)
        if (took := time.process_time() - started) > self.longest_s:
            raise TooSlowError(f"{took:.2f} s of processor time for {len(data)} bytes")
        return 1 if calls is None else calls


TARGETS: dict[str, Target] = {}


def target(
    name: str,
    seeds: Callable[[], Iterable[bytes]],
    allowed: tuple[type[Exception], ...] = (),
    max_bytes: int = 4096,
    longest_s: float = 2.0,
    mutants: int = 1000,
):
    """Enter a function among the targets."""

    def enter(run: Callable[[bytes], int | None]) -> Callable[[bytes], int | None]:
        TARGETS[name] = Target(name, run, seeds, allowed, max_bytes, longest_s, mutants)
        return run

    return enter
