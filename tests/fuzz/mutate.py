"""Mutated inputs without coverage: what the plain tests try, the same for a seed."""

import random
from collections.abc import Iterator, Sequence

CORNERS = (0, 1, 0x7F, 0x80, 0xFE, 0xFF)
WIDTHS = (1, 2, 4, 8)
MOST_STEPS = 4
LONGEST_RUN = 64


def mutants(seeds: Sequence[bytes], count: int, seed: int, max_bytes: int) -> Iterator[bytes]:
    """Seeds, each changed in a few places."""
    rng = random.Random(seed)
    for _ in range(count):
        data = bytearray(rng.choice(seeds))
        for _ in range(rng.randint(1, MOST_STEPS)):
            rng.choice(STEPS)(rng, data, seeds)
        yield bytes(data[:max_bytes])


def _place(rng, data):
    return rng.randint(0, len(data))


def _flip(rng, data, _seeds):
    if data:
        data[rng.randrange(len(data))] ^= 1 << rng.randrange(8)


def _corner(rng, data, _seeds):
    """A number at its limit."""
    width, at = rng.choice(WIDTHS), _place(rng, data)
    number = bytes([rng.choice(CORNERS)]) + bytes([rng.choice((0, 0xFF))]) * (width - 1)
    data[at : at + width] = number if rng.random() < 0.5 else number[::-1]


def _insert(rng, data, _seeds):
    at = _place(rng, data)
    data[at:at] = rng.randbytes(rng.randint(1, 8))


def _remove(rng, data, _seeds):
    at = _place(rng, data)
    del data[at : at + rng.randint(1, LONGEST_RUN)]


def _cut(rng, data, _seeds):
    del data[_place(rng, data) :]


def _repeat(rng, data, _seeds):
    at = _place(rng, data)
    data[at:at] = data[at : at + rng.randint(1, LONGEST_RUN)] * rng.randint(1, 8)


def _splice(rng, data, seeds):
    """The rest of another seed."""
    other = rng.choice(seeds)
    data[_place(rng, data) :] = other[_place(rng, other) :]


STEPS = (_flip, _corner, _insert, _remove, _cut, _repeat, _splice)
