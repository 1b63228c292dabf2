"""A C file changed in a copy of its directory, under tests that compile it from there."""

from __future__ import annotations

import shutil
import subprocess
from collections.abc import Mapping, Sequence
from pathlib import Path

import pytest

from tests.mutants.forks import run_pytest

COMPILER = ("gcc", "-std=c99", "-O1", "-w")
"""Whether a mutant is good style is no question: without warnings."""


class CTarget:
    """Tests find the copy by constants of their modules."""

    def __init__(
        self, root: Path, file: str, tests: Sequence[str], sources: str, compiler: str
    ) -> None:
        """`sources` and `compiler` are the constants that say where it is and how to compile."""
        self._path, self._tests = root / file, tests
        self._sources, self._compiler = sources, compiler

    @property
    def headers(self) -> str:
        """Beside the file."""
        return "".join(path.read_text() for path in sorted(self._path.parent.glob("*.h")))

    def compiled(self, source: str) -> bytes | None:
        """As the compiler's text for the machine; None if it is no C."""
        command = (*COMPILER, "-I", str(self._path.parent), "-x", "c", "-S", "-o", "-", "-")
        done = subprocess.run(command, input=source.encode(), capture_output=True)
        return done.stdout if done.returncode == 0 else None

    def run(self, source: str, directory: Path) -> int:
        """Pytest's exit status with another text of the file; for a process of its own."""
        copy = directory / self._path.parent.name
        shutil.copytree(self._path.parent, copy)
        (copy / self._path.name).write_text(source)
        constants = {self._sources: copy, self._compiler: COMPILER}
        return run_pytest(self._tests, [_Constants(constants)])


class _Constants:
    """In each module of tests that has them; another one's tests take its neighbour's fixture."""

    def __init__(self, constants: Mapping[str, object]) -> None:
        self._constants = constants

    def pytest_collection_modifyitems(self, items: list[pytest.Item]) -> None:
        modules = {item.module for item in items if isinstance(item, pytest.Function)}
        for name, value in self._constants.items():
            having = [module for module in modules if hasattr(module, name)]
            assert having, name
            for module in having:
                setattr(module, name, value)
