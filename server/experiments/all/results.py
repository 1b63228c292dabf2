"""What a part's command has left in its folder: JSON, CSV and text as blocks, pictures as data."""

from __future__ import annotations

import csv
import json
from base64 import b64encode
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import islice, pairwise
from pathlib import Path
from typing import Final

from server.experiments.all.parts import CAPTIONS
from server.experiments.all.running import ERRORS, OURS, OUTPUT
from server.experiments.all.tables import Block, Cell, Table, Text, blocks, titled

PICTURES: Final = {".png": "image/png", ".svg": "image/svg+xml"}
MOST_BYTES: Final = 8_000_000
MOST_LINES: Final = 60
"""Of a CSV file; longer ones stay files."""
MOST_TEXT: Final = 20_000  # letters
PNG: Final = b"\x89PNG\r\n\x1a\n"
WIDE: Final = 1.7
"""Width over height, from which a picture would be too small on a phone."""


@dataclass(frozen=True, slots=True)
class Figure:
    """A picture with what is seen."""

    source: str
    """As a data URI."""
    caption: str
    is_wide: bool


@dataclass(frozen=True, slots=True)
class PartResults:
    """Results of a part."""

    blocks: tuple[Block, ...] = ()
    figures: tuple[Figure, ...] = ()
    output: str = ""
    errors: str = ""
    notes: tuple[str, ...] = ()
    """What is there, but could not be shown."""
    seeds: str = ""
    """As its files say."""


def read(folder: Path, name: str, assumed: Sequence[object] = ()) -> PartResults:
    """Everything that the experiment `name` has left in a folder, but what is `assumed` of all."""
    found: list[Block] = []
    notes: list[str] = []
    seeds = ""
    files = [path for path in folder.iterdir() if path.is_file() and path.name not in OURS]
    files.sort(key=lambda path: (path.suffix != ".json", path.name))
    for path in files:
        try:
            if path.suffix == ".json":
                value = _without(json.loads(path.read_text(encoding="utf-8")), assumed)
                found += blocks(value, _own_title(titled(path.stem), name))
                seeds = seeds or _seeds(value)
            elif path.suffix in (".txt", ".csv"):
                found.append(_text(path) if path.suffix == ".txt" else _sheet(path))
        except (OSError, ValueError, RecursionError, csv.Error, UnshownError) as error:
            notes.append(f"{path.name}: {error or type(error).__name__}")
    figures, unseen = _figures(files, name)
    return PartResults(
        tuple(found),
        figures,
        _said(folder / OUTPUT),
        _said(folder / ERRORS),
        (*notes, *unseen),
        seeds,
    )


def _without(value: object, assumed: Sequence[object]) -> object:
    """Its own assumptions stay."""
    if not isinstance(value, dict) or not isinstance(value.get("assumptions"), list):
        return value
    own = [one for one in value["assumptions"] if one not in assumed]
    rest = {key: one for key, one in value.items() if key != "assumptions"}
    return {**rest, "assumptions": own} if own else rest


class UnshownError(Exception):
    """A file that does not fit into the page; says why."""


def _own_title(title: str, name: str) -> str:
    """No title that says the part's name again."""
    return "" if title == name else title


def _text(path: Path) -> Text:
    text = path.read_text(encoding="utf-8", errors="replace")
    if len(text) > MOST_TEXT:
        raise UnshownError(f"{len(text)} characters, beside this page")
    return Text(path.stem, text)


def _sheet(path: Path) -> Table:
    with path.open(encoding="utf-8", newline="") as file:
        rows = list(islice(csv.reader(file), MOST_LINES + 2))
    if len(rows) > MOST_LINES + 1 or not rows:
        raise UnshownError(f"more than {MOST_LINES} lines, beside this page" if rows else "empty")
    head, *body = rows
    if any(len(row) != len(head) for row in body):
        raise UnshownError("lines of different lengths")
    cells = tuple(tuple(map(Cell, row)) for row in body)
    return Table(path.stem, tuple(map(titled, head)), cells)


def _figures(files: list[Path], name: str) -> tuple[tuple[Figure, ...], list[str]]:
    """Every picture once, as its smaller file; and those too large."""
    by_stem: dict[str, Path] = {}
    for path in files:
        if path.suffix in PICTURES:
            other = by_stem.setdefault(path.stem, path)
            by_stem[path.stem] = min(path, other, key=lambda one: one.stat().st_size)
    shown, notes = [], []
    for stem, path in by_stem.items():
        data = path.read_bytes()
        if len(data) > MOST_BYTES:
            notes.append(f"{path.name}: {len(data)} bytes, beside this page")
            continue
        source = f"data:{PICTURES[path.suffix]};base64,{b64encode(data).decode()}"
        caption = CAPTIONS.get((name, stem), titled(stem))
        shown.append(Figure(source, caption, _is_wide(data)))
    return tuple(shown), notes


def _is_wide(data: bytes) -> bool:
    """Whether a PNG is wide, by its first chunk; others are scaled without loss."""
    if not data.startswith(PNG) or len(data) < 24:
        return False
    width, height = int.from_bytes(data[16:20]), int.from_bytes(data[20:24])
    return width > WIDE * height


def _said(path: Path) -> str:
    """The end of what a command printed."""
    try:
        text = path.read_text(encoding="utf-8", errors="replace").strip()
    except OSError:
        return ""
    return text if len(text) <= MOST_TEXT else f"… {text[-MOST_TEXT:]}"


def _seeds(value: object) -> str:
    """Seeds that a JSON file of a sweep names."""
    return spanned(sorted(set(_named(value)))) if isinstance(value, dict) else ""


def _named(value: dict[str, object]) -> Iterator[int]:
    for key, one in value.items():
        if key == "seeds" and isinstance(one, list):
            yield from (seed for seed in one if isinstance(seed, int))
        elif isinstance(one, dict):
            yield from _named(one)


def spanned(seeds: list[int]) -> str:
    """Sorted whole numbers as people write them: "1 to 10", "3, 5"."""
    if len(seeds) > 2 and seeds[-1] - seeds[0] == len(seeds) - 1:
        return f"{seeds[0]} to {seeds[-1]}"
    return ", ".join(map(str, seeds))


def seeds_of(words: list[str]) -> str:
    """Seeds that a command line names: `--seeds 3` of them from `--seed`, or from 1."""
    said = {
        word: int(value)
        for word, value in pairwise(words)
        if word in ("--seed", "--seeds") and value.isdigit()
    }
    if not said:
        return ""
    first, count = said.get("--seed", 1), min(said.get("--seeds", 1), 10_000)
    return spanned(list(range(first, first + count)))
