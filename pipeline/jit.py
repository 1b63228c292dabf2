"""Numba, with a cache that notices an edit of anything a kernel calls.

Numba stamps a cached kernel with the file it stands in alone: after an edit of a kernel that others
call, or an upgrade, they would go on with the old machine code inside them. Here every kernel is
stamped with the sources of all kernels and of what these import, so a change of one makes all anew;
numba's own index tells versions of numba and kinds of processor apart. Whoever compiles imports
`numba` from here. Reading those sources and keeping what was compiled is the one file access of
this package: it belongs to compiling.

Compiled kernels lie in NUMBA_CACHE_DIR if that is set, else beside their sources; where those can't
be written and nobody has compiled them there, in the user's cache directory. A folder that can't be
written serves as well, once all is in it; without any folder kernels are compiled and not kept.
Numba's own way ends in an error there. With NUMBA_CPU_NAME set, in an image for many machines, all
machines of that level take them.
"""

from __future__ import annotations

import contextlib
import os
import re
import tempfile
from collections.abc import Callable
from functools import cache
from hashlib import sha256
from itertools import chain
from typing import Any

import numba as numba
from numba.core import caching
from numba.core.registry import cpu_target

ROOT = os.path.dirname(os.path.dirname(os.path.abspath(__file__)))
PACKAGES = ("pipeline", "hardware")
BESIDE = os.path.join(ROOT, PACKAGES[0], "__pycache__")
"""Where kernels beside their sources lie, for all of them."""
MARK = "warm-"
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


def pin_processor() -> None:
    """Compile for the processor that NUMBA_CPU_NAME names, if it does, and for no more.

    Numba goes by the name, and by what this very machine can do beside it: what an image's builder
    compiled so, no other machine would find again, or it would not run there.
    """
    named = os.environ.get("NUMBA_CPU_NAME")
    if named == "":
        vars(numba.config).update(CPU_NAME=None)
    elif named is not None and "NUMBA_CPU_FEATURES" not in os.environ:
        vars(numba.config).update(CPU_FEATURES="")


def _cache_folders() -> tuple[str, ...]:
    """Where compiled kernels may lie, the best first; "" is beside each source."""
    users = os.environ.get("XDG_CACHE_HOME") or os.path.expanduser("~/.cache")
    named = os.environ.get("NUMBA_CACHE_DIR", "")
    return named, os.path.join(users, "lightleash", "kernels")


def _marked() -> str:
    """How names of files begin that say that all is compiled, of these sources by this numba."""
    made_of = f"{kernel_stamp()}\0{numba.__version__}"
    return f"{MARK}{sha256(made_of.encode()).hexdigest()[:16]}-"


def _mark_of(folder: str) -> str:
    """The file that says so of `folder` and this processor."""
    target = str(cpu_target.target_context.codegen().magic_tuple())
    name = _marked() + sha256(target.encode()).hexdigest()[:8]
    return os.path.join(folder or BESIDE, name)


@cache
def _unmark_others(folder: str) -> None:
    """Say no more that all is in `folder` of other sources: these kernels take their place there.

    Back at those, as after a look at another branch, each process would compile for itself.
    """
    folder = folder or BESIDE
    for name in os.listdir(folder):
        if name.startswith(MARK) and not name.startswith(_marked()):
            os.remove(os.path.join(folder, name))


def _is_writable(folder: str) -> bool:
    try:
        os.makedirs(folder or BESIDE, exist_ok=True)
        tempfile.TemporaryFile(dir=folder or BESIDE).close()
    except OSError:
        return False
    return True


@cache
def cache_folder() -> str | None:
    """Where this process finds and keeps compiled kernels; "": beside each source; None: nowhere.

    One that has them all goes before one that can be written.
    """
    folders = _cache_folders()
    complete = (folder for folder in folders if os.path.exists(_mark_of(folder)))
    return next(chain(complete, filter(_is_writable, folders)), None)


def are_kernels_kept() -> bool:
    """Whether somebody has compiled them all, here, for this processor."""
    folder = cache_folder()
    return folder is not None and os.path.exists(_mark_of(folder))


def note_kernels_kept() -> None:
    """Say so, for the next process.

    Raises:
        OSError: `cache_folder` can't be written, or is full: what was compiled may not be kept.
    """
    folder = cache_folder()
    if folder is not None:
        with open(_mark_of(folder), "wb"):
            pass


class KernelLocator(caching.InTreeCacheLocator):
    """Of one kernel's file in `cache_folder`."""

    def __init__(self, function: Callable[..., Any], source: str) -> None:
        """For a kernel in that source."""
        super().__init__(function, source)
        folder = cache_folder()
        if folder:
            self._cache_path = os.path.join(folder, self.get_suitable_cache_subpath(source))

    @classmethod
    def from_function(cls, function: Callable[..., Any], source: str) -> KernelLocator | None:
        """One for every function of a file: no folder is no reason not to compile."""
        return cls(function, source) if os.path.exists(source) else None

    def ensure_cache_path(self) -> None:
        """Make it if that can be: what can't be kept is not (see `Index`)."""
        with contextlib.suppress(OSError):
            os.makedirs(self._cache_path, exist_ok=True)

    def get_source_stamp(self) -> tuple[Any, str]:
        """Numba's own stamp and ours."""
        return super().get_source_stamp(), kernel_stamp()


class Index(caching.IndexDataCacheFile):
    """A kernel's index; one that can't be read, or names modules that are gone, counts as none."""

    def _load_index(self) -> dict[Any, str]:
        try:
            found: dict[Any, str] = super()._load_index()
        except (OSError, ImportError, AttributeError):
            return {}
        return found

    def save(self, key: object, data: object) -> None:
        """Keep a kernel, unless the disk is full or not ours to write."""
        with contextlib.suppress(OSError):
            _unmark_others(cache_folder() or "")
            super().save(key, data)


pin_processor()
vars(caching).update(IndexDataCacheFile=Index)
vars(numba.config).update(CACHE_LOCATOR_CLASSES=f"{__name__}.{KernelLocator.__name__}")
