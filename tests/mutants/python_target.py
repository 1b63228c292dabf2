"""A Python module changed in memory, under tests that import it anew."""

from __future__ import annotations

import ast
import importlib
import importlib.abc
import importlib.util
import resource
import sys
from collections.abc import Sequence
from enum import Enum
from importlib.machinery import ModuleSpec
from pathlib import Path
from types import ModuleType

from tests.mutants.forks import run_pytest

MEMORY_BYTES = 8 << 30
"""What Python may take with a mutant; C has none to take, and sanitizers reserve far more."""


class PythonTarget:
    """Whatever does not depend on the module is imported before, once for all its mutants."""

    def __init__(self, root: Path, file: str, tests: Sequence[str]) -> None:
        self._path, self._tests = root / file, tests
        self._name = file.removesuffix(".py").replace("/", ".")
        module = importlib.import_module(self._name)
        self.enums = {
            name: [member.name for member in value]
            for name, value in vars(module).items()
            if isinstance(value, type) and issubclass(value, Enum)
        }
        for test in tests:
            for name in _imports((root / test.partition("::")[0]).read_text()):
                _import_if_any(name)
        for name in _dependents(self._name, root):
            _forget(name)

    def run(self, source: str) -> int:
        """Pytest's exit status with another text of the module; for a process of its own."""
        resource.setrlimit(resource.RLIMIT_AS, (MEMORY_BYTES, MEMORY_BYTES))
        sys.meta_path.insert(0, _Instead(self._name, source, str(self._path)))
        return run_pytest(self._tests)


class _Instead(importlib.abc.MetaPathFinder, importlib.abc.Loader):
    def __init__(self, name: str, source: str, path: str) -> None:
        self._name, self._source, self._path = name, source, path

    def find_spec(
        self, fullname: str, path: object = None, target: ModuleType | None = None
    ) -> ModuleSpec | None:
        if fullname != self._name:
            return None
        return importlib.util.spec_from_loader(fullname, self, origin=self._path)

    def exec_module(self, module: ModuleType) -> None:
        module.__file__ = self._path
        exec(compile(self._source, self._path, "exec"), module.__dict__)


def _imports(source: str) -> set[str]:
    """Modules that a text names in imports; of `from a import b` both a and a.b."""
    names: set[str] = set()
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.Import):
            names |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom) and node.module and not node.level:
            names |= {node.module, *(f"{node.module}.{alias.name}" for alias in node.names)}
    return names


def _import_if_any(name: str) -> None:
    try:
        found = importlib.util.find_spec(name) is not None
    except ModuleNotFoundError:  # of `from a import b` where a is no package
        found = False
    if found:
        importlib.import_module(name)


def _dependents(name: str, root: Path) -> set[str]:
    """The module, whatever imports it by however many steps, and all tests."""
    uses = {
        other: _imports(path.read_text())
        for other, module in list(sys.modules.items())
        if (path := Path(getattr(module, "__file__", None) or "/")).suffix == ".py"
        and path.is_relative_to(root)
        and not {".venv", "mutants"} & set(path.parts[len(root.parts) :])
    }
    found = {name, *(other for other in uses if other.startswith("tests."))}
    while more := {other for other, used in uses.items() if used & found} - found:
        found |= more
    return found


def _forget(name: str) -> None:
    sys.modules.pop(name, None)
    package, _, last = name.rpartition(".")
    parent = sys.modules.get(package)
    if parent is not None and last in vars(parent):
        delattr(parent, last)  # or `from package import last` would still find it
