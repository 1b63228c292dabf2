"""Numba, with a cache that notices an edit of anything a kernel calls.

Numba stamps a cached kernel with the file it stands in alone: after an edit of a kernel that others
call, or an upgrade, they would go on with the old machine code inside them. Here every kernel is
stamped with the sources of all kernels and of what these import, so a change of one makes all anew;
numba's own index tells versions of numba and kinds of processor apart. Whoever compiles imports
`numba` from here. Reading those sources is the one file access of this package: it belongs to
compiling.
"""

from __future__ import annotations

import os
import re
from functools import cache
from hashlib import sha256
from typing import Any

import numba as numba
from numba.core import caching

ROOT = os.path.dirname(os.path.dirname(os.path.abspath(__file__)))
PACKAGES = ("pipeline", "hardware")
_IS_COMPILED = re.compile(r"^@(?:kernel|numba\.njit)\b", re.MULTILINE)
_IMPORTS = re.compile(r"^from ((?:pipeline|hardware)[\w.]*) import (\([^)]*\)|.*)", re.MULTILINE)
_COMPILES_IN = re.compile(r"\b(?:[a-z_]\w*|[A-Z][A-Z0-9_]+)\b")
"""Functions and constants."""


def kernel_sources(root: str = ROOT) -> dict[str, str]:
    """Text of every module below `root` with kernels, or with functions and constants they use.

    By the modules' names. A class means nothing to a kernel, unless it is a named tuple.
    """
    texts: dict[str, str] = {}
    for package in PACKAGES:
        for folder, _, files in os.walk(os.path.join(root, package)):
            for file in (name for name in files if name.endswith(".py")):
                path = os.path.join(folder, file)
                with open(path, encoding="utf-8") as source:
                    texts[_module(os.path.relpath(path, root))] = source.read()
    found: set[str] = set()
    new = [module for module, text in texts.items() if _IS_COMPILED.search(text)]
    while new:
        module = new.pop()
        if module in texts and module not in found:
            found.add(module)
            new += (
                other
                for other, names in _IMPORTS.findall(texts[module])
                if _COMPILES_IN.search(names) or "NamedTuple" in texts.get(other, "")
            )
    return {module: texts[module] for module in sorted(found)}


def _module(path: str) -> str:
    return path.removesuffix(".py").replace(os.sep, ".").removesuffix(".__init__")


@cache
def kernel_stamp() -> str:
    """SHA-256 of `kernel_sources`: another one, and no cached kernel is taken."""
    digest = sha256()
    for module, text in kernel_sources().items():
        digest.update(f"{module}\0{text}\0".encode())
    return digest.hexdigest()


class UserProvided(caching.UserProvidedCacheLocator):
    """In NUMBA_CACHE_DIR, where that is set."""

    def get_source_stamp(self) -> tuple[Any, str]:
        """Numba's own stamp and ours."""
        return super().get_source_stamp(), kernel_stamp()


class InTree(caching.InTreeCacheLocator):
    """In the cache folder beside the source, where that can be written."""

    def get_source_stamp(self) -> tuple[Any, str]:
        """Numba's own stamp and ours."""
        return super().get_source_stamp(), kernel_stamp()


class UserWide(caching.UserWideCacheLocator):
    """In the user's cache directory."""

    def get_source_stamp(self) -> tuple[Any, str]:
        """Numba's own stamp and ours."""
        return super().get_source_stamp(), kernel_stamp()


class Index(caching.IndexDataCacheFile):
    """A kernel's index; one that names modules that are gone, after an upgrade, counts as none."""

    def _load_index(self) -> dict[Any, str]:
        try:
            found: dict[Any, str] = super()._load_index()
        except (ImportError, AttributeError):
            return {}
        return found


vars(caching).update(IndexDataCacheFile=Index)
vars(numba.config).update(
    CACHE_LOCATOR_CLASSES=",".join(
        f"{__name__}.{locator.__name__}" for locator in (UserProvided, InTree, UserWide)
    )
)
