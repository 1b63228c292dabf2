import ast
import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

from pipeline import jit
from pipeline.jit import ROOT, kernel_sources

CALLER = """
import numpy as np
from pipeline.so3_kernels import kernel, put_exp

@kernel
def corner(angle, R):
    put_exp(0.0, 0.0, angle, R)
    return R[0, 0]

print(corner(0.5, np.eye(3)), sum(corner.stats.cache_hits.values()))
"""


def said(tree: Path, **settings: str) -> list[str]:
    """The words of the caller."""
    kept = {name: value for name, value in os.environ.items() if not name.startswith("NUMBA")}
    environment = kept | {"PYTHONPATH": str(tree)} | settings
    command = [sys.executable, "-c", "import pipeline.caller"]
    done = subprocess.run(
        command, cwd=tree, env=environment, capture_output=True, text=True, check=True
    )
    return done.stdout.split()


def run(tree: Path, **settings: str) -> tuple[float, int]:
    """The caller's result, and how many of its kernels came from the cache."""
    value, hits = said(tree, **settings)
    return float(value), int(hits)


def package_in(folder):
    """A copy of what compiles kernels, for a caller beside it."""
    package = folder / "pipeline"
    package.mkdir()
    for name in ("__init__", "frames", "jit", "so3_kernels"):
        (package / f"{name}.py").write_text((Path(ROOT) / "pipeline" / f"{name}.py").read_text())
    return package


@pytest.mark.slow
def test_an_edited_kernel_changes_the_next_process_also_through_its_callers(tmp_path):
    package = package_in(tmp_path)
    (package / "caller.py").write_text(CALLER)
    first, hits = run(tmp_path)
    assert first == pytest.approx(0.8775826)
    assert hits == 0
    assert run(tmp_path) == (first, 1)
    callee = package / "so3_kernels.py"
    callee.write_text(callee.read_text().replace("1.0 - k * (v1 * v1", "2.0 - k * (v1 * v1"))
    assert run(tmp_path) == (pytest.approx(first + 1.0), 0)


ALL_KEPT = (
    CALLER.split("print")[0]
    + """
from pipeline import jit
was_kept = jit.are_kernels_kept()
corner(0.5, np.eye(3))
jit.note_kernels_kept()
print(was_kept, sum(corner.stats.cache_hits.values()))
"""
)


@pytest.mark.slow
def test_after_a_look_at_other_sources_nobody_says_that_all_is_compiled(tmp_path):
    """A process believed it, and compiled in flight what the others' had written over."""
    package = package_in(tmp_path)
    caller, callee = package / "caller.py", package / "so3_kernels.py"
    caller.write_text(ALL_KEPT)
    assert said(tmp_path) == ["False", "0"]
    assert said(tmp_path) == ["True", "1"]
    before = callee.read_text()
    callee.write_text(before + "# looked at\n")
    assert said(tmp_path) == ["False", "0"]
    callee.write_text(before)
    assert said(tmp_path) == ["False", "0"]
    assert said(tmp_path) == ["True", "1"]


def test_every_module_with_kernels_is_in_the_stamp_and_takes_numba_from_one_place():
    root = Path(ROOT)
    known = kernel_sources()
    modules = [*root.glob("pipeline/**/*.py"), *root.glob("hardware/**/*.py")]
    texts = {".".join(p.relative_to(root).with_suffix("").parts): p.read_text() for p in modules}
    compiled = {m for m, text in texts.items() if re.search(r"^@.*(jit|kernel)", text, re.M)}
    assert len(compiled) > 30
    assert compiled <= set(known)
    direct = {m for m, text in texts.items() if re.search(r"^\s*(import|from) numba", text, re.M)}
    assert direct == {"pipeline.jit"}


def test_what_only_gives_types_to_kernels_is_not_in_the_stamp():
    assert not {"pipeline.signals", "pipeline.frames"} & set(kernel_sources())


SUMMER = """
from pipeline.so3_kernels import kernel
from pipeline.{module} import Pair

@kernel
def total(pair):
    return pair.a + pair.b

print(total(Pair(0.25, 0.75)), sum(total.stats.cache_hits.values()))
"""
PAIR = """
from typing import NamedTuple

class Pair(NamedTuple):
    a: float
    b: float
"""


@pytest.mark.slow
def test_a_cached_kernel_that_names_a_module_that_is_gone_is_compiled_anew(tmp_path):
    package = package_in(tmp_path)
    (package / "before.py").write_text(PAIR)
    (package / "caller.py").write_text(SUMMER.format(module="before"))
    assert run(tmp_path) == (1.0, 0)
    (package / "before.py").rename(package / "after.py")
    (package / "caller.py").write_text(SUMMER.format(module="after"))
    assert run(tmp_path) == (1.0, 0)


@pytest.mark.slow
def test_where_the_tree_cannot_be_written_the_users_cache_is_taken_and_without_one_none(tmp_path):
    package = package_in(tmp_path)
    (package / "caller.py").write_text(CALLER)
    (package / "__pycache__").touch()  # no folder can be made here, not even by root
    users = {"XDG_CACHE_HOME": str(tmp_path / "cache")}
    first, hits = run(tmp_path, **users)
    assert hits == 0
    assert run(tmp_path, **users) == (first, 1)
    assert list((tmp_path / "cache" / "lightleash" / "kernels").rglob("*.nbc"))
    for _ in range(2):
        assert run(tmp_path, XDG_CACHE_HOME="/proc/nowhere") == (first, 0)
    # an image's own folder, of another level: the user's in place of compiling at each start
    assert run(tmp_path, NUMBA_CACHE_DIR="/proc/nowhere", **users) == (first, 1)


TARGET = """
import pipeline.jit
from numba.core.registry import cpu_target
print(cpu_target.target_context.codegen().magic_tuple()[1:])
"""


@pytest.mark.skipif(os.uname().machine != "x86_64", reason="levels are those of this processor")
def test_an_images_kernels_are_for_the_level_that_is_named_and_nothing_that_its_builder_can(
    tmp_path,
):
    def compiled_for(**settings: str) -> tuple[str, str]:
        environment = {"PATH": os.environ["PATH"], "PYTHONPATH": ROOT} | settings
        command = [sys.executable, "-c", TARGET]
        said = subprocess.run(command, env=environment, capture_output=True, text=True, check=True)
        name, features = ast.literal_eval(said.stdout)
        return name, features

    own = compiled_for()
    assert "+" in own[1]
    assert compiled_for(NUMBA_CPU_NAME="") == own
    assert compiled_for(NUMBA_CPU_NAME="x86-64-v3") == ("x86-64-v3", "")
    assert compiled_for(NUMBA_CPU_NAME="x86-64", NUMBA_CPU_FEATURES="+avx")[1] == "+avx"


def test_a_folder_with_all_kernels_goes_before_one_that_can_be_written(tmp_path, monkeypatch):
    shipped, own = str(tmp_path / "shipped"), str(tmp_path / "own")
    monkeypatch.setattr(jit, "_cache_folders", lambda: (own, shipped))
    folder = jit.cache_folder.__wrapped__
    assert folder() == own
    Path(shipped).mkdir()
    monkeypatch.setattr(jit, "_is_writable", lambda folder: folder == own)
    Path(jit._mark_of(shipped)).touch()
    assert folder() == shipped
    monkeypatch.setattr(jit, "kernel_stamp", lambda: "after an edit")
    assert folder() == own
    monkeypatch.setattr(jit, "_is_writable", lambda folder: False)
    assert folder() is None
