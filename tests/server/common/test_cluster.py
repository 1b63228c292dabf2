"""Workers of a cluster: what must be fast is compiled by one of a machine."""

from __future__ import annotations

import subprocess
import sys
import threading

import pytest

from server.common.cluster import kernels


@pytest.fixture
def compiled(tmp_path, monkeypatch):
    """A file that gets a letter each time that somebody compiles."""
    file = tmp_path / "compiled"
    writes = f"open({str(file)!r}, 'a').write('x')"
    monkeypatch.setattr(kernels, "cache_folder", lambda: str(tmp_path))
    monkeypatch.setattr(kernels, "are_kernels_kept", file.exists)
    monkeypatch.setattr(kernels, "COMMAND", (sys.executable, "-c", writes))
    return file


def test_of_those_that_start_at_once_one_compiles(compiled, monkeypatch):
    """The lock is of files: it parts threads as it parts processes."""
    all_have_looked, looks = threading.Barrier(3, timeout=30.0), threading.local()

    def are_kept():
        answer = compiled.exists()
        if not hasattr(looks, "first"):
            looks.first = all_have_looked.wait()
        return answer

    monkeypatch.setattr(kernels, "are_kernels_kept", are_kept)
    threads = [threading.Thread(target=kernels.compile_once) for _ in range(3)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert compiled.read_text() == "x"


def test_where_all_or_nothing_is_kept_nothing_is_compiled_ahead(compiled, monkeypatch):
    monkeypatch.setattr(kernels, "are_kernels_kept", lambda: True)
    kernels.compile_once()
    monkeypatch.setattr(kernels, "are_kernels_kept", lambda: False)
    monkeypatch.setattr(kernels, "cache_folder", lambda: None)
    kernels.compile_once()
    assert not compiled.exists()


def test_the_command_is_the_one_that_compiles():
    words = [*kernels.COMMAND, "--help"]
    told = subprocess.run(words, capture_output=True, text=True, check=True).stdout
    assert told.startswith("usage: lightleash warm")
