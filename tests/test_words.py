"""Words: a class's name stands for one thing, and a name in back-ticks is one that exists."""

from __future__ import annotations

import ast
import builtins
import re
from collections import defaultdict
from collections.abc import Iterator
from functools import cache
from pathlib import Path

from tests.sources import parsed, texts

DOCUMENTED = (ast.Module, ast.ClassDef, ast.FunctionDef, ast.AsyncFunctionDef)
NAME = re.compile(r"`([A-Za-z_]\w*(?:\.[A-Za-z_]\w*)*)(?:\(\))?`")


def modules() -> Iterator[tuple[Path, ast.Module]]:
    """The product's modules."""
    return ((path, parsed(text)) for path, text in texts().items())


def defined(tree: ast.Module) -> Iterator[str]:
    """Every name that a module gives to something or imports, strings without spaces included."""
    for node in ast.walk(tree):
        match node:
            case ast.ClassDef() | ast.FunctionDef() | ast.AsyncFunctionDef():
                yield node.name
            case ast.arg(arg=name) | ast.keyword(arg=str(name)):
                yield name
            case ast.Name(id=name, ctx=ast.Store()) | ast.Attribute(attr=name):
                yield name
            case ast.alias(name=name, asname=asname):
                yield from (asname or name).split(".")
            case ast.ImportFrom(module=str(name)):
                yield from name.split(".")
            case ast.Constant(value=str(text)) if " " not in text:
                yield text
            case ast.Constant(value=bytes(octets)):
                yield octets.decode("latin-1")


@cache
def names() -> frozenset[str]:
    """All of them, modules, folders and builtins included."""
    found: set[str] = set()
    for path, tree in modules():
        found.update(path.parts, (path.stem,), defined(tree))
    return frozenset(found | set(dir(builtins)))


def docstrings(tree: ast.Module) -> Iterator[tuple[int, str]]:
    """Line and text of each docstring, those of fields and constants included."""
    for node in ast.walk(tree):
        if isinstance(node, DOCUMENTED):
            for statement in node.body:
                match statement:
                    case ast.Expr(value=ast.Constant(value=str(text))):
                        yield statement.lineno, text


def test_a_class_name_stands_for_one_thing() -> None:
    homes = defaultdict(list)
    for path, tree in modules():
        for node in ast.walk(tree):
            if isinstance(node, ast.ClassDef):
                homes[node.name].append(f"{path}:{node.lineno}")
    assert {name: where for name, where in homes.items() if len(where) > 1} == {}


def test_names_in_back_ticks_exist() -> None:
    missing = [
        f"{path}:{line}: `{name}`"
        for path, tree in modules()
        for line, text in docstrings(tree)
        for name in NAME.findall(text)
        if name not in names() and not names().issuperset(name.split("."))
    ]
    assert missing == []
