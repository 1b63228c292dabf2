"""Mutants of a Python module: found in its syntax tree, made in its text."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator, Mapping, Sequence

from tests.mutants.mutant import Mutant

COMPARISONS: Mapping[type[ast.cmpop], tuple[str, tuple[str, ...]]] = {
    ast.Lt: ("<", ("<=", ">=")),
    ast.LtE: ("<=", ("<", ">")),
    ast.Gt: (">", (">=", "<=")),
    ast.GtE: (">=", (">", "<")),
    ast.Eq: ("==", ("!=",)),
    ast.NotEq: ("!=", ("==",)),
    ast.Is: ("is", ("is not",)),
    ast.IsNot: ("is not", ("is",)),
    ast.In: ("in", ("not in",)),
    ast.NotIn: ("not in", ("in",)),
}
ARITHMETIC: Mapping[type[ast.operator], tuple[str, str]] = {
    ast.Add: ("+", "-"),
    ast.Sub: ("-", "+"),
    ast.Mult: ("*", "/"),
    ast.Div: ("/", "*"),
}
CALLS = {"min": "max", "max": "min", "any": "all", "all": "any"}
SMALL = 10
"""Integers up to it are shifted by one, larger ones and floats doubled."""

Change = tuple[str, int, int, str]
"""Operator, start, end, new text."""


def python_mutants(
    file: str, source: str, enums: Mapping[str, Sequence[str]] | None = None
) -> list[Mutant]:
    """All mutants of a module; `enums` are the members of those it names, in order."""
    changes = dict.fromkeys(_Changes(source, enums or {}).all())
    return [Mutant(file, operator, source, *change) for operator, *change in changes]


class _Changes:
    def __init__(self, source: str, enums: Mapping[str, Sequence[str]]) -> None:
        self._source, self._enums = source, enums
        self._starts = [0]
        for line in source.splitlines(keepends=True):
            self._starts.append(self._starts[-1] + len(line))
        self._lines = source.splitlines()

    def all(self) -> Iterator[Change]:
        yield from self._below(ast.parse(self._source), "")

    def _below(self, node: ast.AST, function: str) -> Iterator[Change]:
        if isinstance(node, ast.FunctionDef):
            function = node.name
        yield from self._of(node, function)
        for name, value in ast.iter_fields(node):
            if name in ("annotation", "returns", "decorator_list"):
                continue
            for child in value if isinstance(value, list) else [value]:
                # Up to Python 3.11 what stands in an f-string has no place of its own.
                if isinstance(child, ast.AST) and not isinstance(child, ast.JoinedStr):
                    yield from self._below(child, function)

    def _of(self, node: ast.AST, function: str) -> Iterator[Change]:
        match node:
            case ast.Compare():
                operands = (node.left, *node.comparators)
                for op, left, right in zip(node.ops, operands, operands[1:], strict=False):
                    old, others = COMPARISONS[type(op)]
                    for new in others:
                        yield self._between("comparison", left, right, old, new)
            case ast.BoolOp():
                old, new = ("and", "or") if isinstance(node.op, ast.And) else ("or", "and")
                for left, right in zip(node.values, node.values[1:], strict=False):
                    yield self._between("and/or", left, right, old, new)
            case ast.UnaryOp(op=ast.Not()):
                yield self._instead("not", node, f"({self._text(node.operand)})")
            case ast.If() | ast.IfExp() | ast.While():
                yield self._instead("branch", node.test, f"not ({self._text(node.test)})")
            case ast.BinOp() if type(node.op) in ARITHMETIC:
                old, new = ARITHMETIC[type(node.op)]
                yield self._between("arithmetic", node.left, node.right, old, new)
            case ast.Constant():
                for new in _other_values(node.value):
                    yield self._instead("constant", node, new)
            case ast.Call(func=ast.Name(id=name)) if name in CALLS:
                yield self._instead("call", node.func, CALLS[name])
            case ast.Attribute(value=ast.Name(id=enum)) if node.attr in self._enums.get(enum, ()):
                members = self._enums[enum]
                other = members[(members.index(node.attr) + 1) % len(members)]
                yield self._instead("enum", node, f"{enum}.{other}")
            case ast.Return(value=ast.expr()) if not _is_none(node.value):
                yield self._instead("return", node, "return None")
            case ast.Assign() if function != "__init__" and any(map(_is_state, node.targets)):
                yield self._instead("deletion", node, "pass")
            case ast.AugAssign() | ast.Expr(value=ast.Call()):
                yield self._instead("deletion", node, "pass")

    def _span(self, node: ast.AST) -> tuple[int, int]:
        assert isinstance(node, ast.expr | ast.stmt)
        assert node.end_lineno is not None
        assert node.end_col_offset is not None
        return (
            self._at(node.lineno, node.col_offset),
            self._at(node.end_lineno, node.end_col_offset),
        )

    def _at(self, line: int, column_bytes: int) -> int:
        before = self._lines[line - 1].encode()[:column_bytes]
        return self._starts[line - 1] + len(before.decode())

    def _text(self, node: ast.AST) -> str:
        start, end = self._span(node)
        return self._source[start:end]

    def _instead(self, operator: str, node: ast.AST, new: str) -> Change:
        return (operator, *self._span(node), new)

    def _between(self, operator: str, left: ast.AST, right: ast.AST, old: str, new: str) -> Change:
        start, end = self._span(left)[1], self._span(right)[0]
        found = re.search(re.escape(old).replace(r"\ ", r"\s+"), self._source[start:end])
        assert found is not None
        return operator, start + found.start(), start + found.end(), new


def _other_values(value: object) -> tuple[str, ...]:
    if isinstance(value, bool):
        return (str(not value),)
    if isinstance(value, int):
        return (repr(value + 1), repr(value - 1)) if value <= SMALL else (repr(2 * value),)
    if isinstance(value, float):
        return (repr(2.0 * value) if value else "1.0",)
    return ()


def _is_none(node: ast.expr | None) -> bool:
    return isinstance(node, ast.Constant) and node.value is None


def _is_state(target: ast.expr) -> bool:
    """Not a local name: without it nothing would run."""
    if isinstance(target, ast.Tuple):
        return any(map(_is_state, target.elts))
    return isinstance(target, ast.Attribute | ast.Subscript)
