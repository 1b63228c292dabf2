"""Mutants of a C file: found by its tokens."""

from __future__ import annotations

import re
from collections.abc import Iterator

from tests.mutants.mutant import Mutant

NO_CODE = re.compile(r'/\*.*?\*/|//[^\n]*|^\s*#[^\n]*|"(?:\\.|[^"\\])*"', re.DOTALL | re.MULTILINE)
TOKENS: tuple[tuple[str, str, tuple[str, ...]], ...] = (
    ("comparison", r"(?<=\s)<(?=\s)", ("<=", ">=")),
    ("comparison", r"(?<=\s)<=(?=\s)", ("<", ">")),
    ("comparison", r"(?<=\s)>(?=\s)", (">=", "<=")),
    ("comparison", r"(?<=\s)>=(?=\s)", (">", "<")),
    ("comparison", r"==", ("!=",)),
    ("comparison", r"!=", ("==",)),
    ("and/or", r"&&", ("||",)),
    ("and/or", r"\|\|", ("&&",)),
    ("not", r"!(?!=)", ("",)),
    ("arithmetic", r"(?<=\s)\+(?=\s)", ("-",)),
    ("arithmetic", r"(?<=\s)-(?=\s)", ("+",)),
    ("arithmetic", r"(?<=\w\s)\*(?=\s)", ("/",)),
    ("constant", r"\btrue\b", ("false",)),
    ("constant", r"\bfalse\b", ("true",)),
    ("call", r"\bfmin\b", ("fmax",)),
    ("call", r"\bfmax\b", ("fmin",)),
)
INTEGER = re.compile(r"(?<![\w.])(?<!e-)(\d+)(u?)(?![\w.])")
IF = re.compile(r"\bif \(")
ENUM = re.compile(r"typedef enum \{(.*?)\}", re.DOTALL)
STATEMENT = re.compile(r"^[ \t]+((?!return\b|for\b|if\b|else\b)[^;{}\n]*;)$", re.MULTILINE)
DECLARATION = re.compile(r"(?:const |static )*[a-z]\w* \*?\w+(?:\[\w+\])?(?: =|,|;)")
BODY = re.compile(r"\n\{\n.*?\n\}\n", re.DOTALL)


def c_mutants(file: str, source: str, header: str = "") -> list[Mutant]:
    """All mutants of the bodies of its functions; `header` has the enums that it uses."""
    code = NO_CODE.sub(lambda found: re.sub(r"[^\n]", " ", found[0]), source)
    enums = [re.findall(r"\bLL_\w+", body) for body in ENUM.findall(NO_CODE.sub("", header))]
    changes = dict.fromkeys(
        change
        for body in BODY.finditer(code)
        for change in _changes(code, body.start(), body.end(), enums)
    )
    return [Mutant(file, operator, source, *change) for operator, *change in changes]


def _changes(
    code: str, first: int, last: int, enums: list[list[str]]
) -> Iterator[tuple[str, int, int, str]]:
    for operator, token, others in TOKENS:
        for found in re.compile(token).finditer(code, first, last):
            for new in others:
                yield operator, *found.span(), new
    for found in INTEGER.finditer(code, first, last):
        for value in (int(found[1]) + 1, int(found[1]) - 1):
            if value >= 0:
                yield "constant", *found.span(), f"{value}{found[2]}"
    for found in IF.finditer(code, first, last):
        end = _closed(code, found.end())
        yield "branch", found.end(), end, f"!({code[found.end() : end]})"
    for members in enums:
        for i, name in enumerate(members):
            for found in re.compile(rf"\b{name}\b").finditer(code, first, last):
                yield "enum", *found.span(), members[(i + 1) % len(members)]
    for found in STATEMENT.finditer(code, first, last):
        begins = code[: found.start()].rstrip().endswith((";", "{", "}", ")", "else"))
        if begins and not DECLARATION.match(found[1]):
            yield "deletion", *found.span(1), ";"


def _closed(code: str, at: int) -> int:
    """Where the parenthesis that opened before `at` closes."""
    depth = 1
    while depth:
        depth += {"(": 1, ")": -1}.get(code[at], 0)
        at += 1
    return at - 1
