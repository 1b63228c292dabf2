"""Recordings stay within their limits: the oldest go, never one that is kept or being written."""

from __future__ import annotations

import os
from collections.abc import Iterator
from pathlib import Path
from tempfile import TemporaryDirectory
from types import SimpleNamespace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from server.protocol.wire import encode
from server.protocol.wire_records import Record, Touch
from server.recording import folder as module
from server.recording.control import Recordings
from server.recording.folder import DiskLimits, RecordingFolder
from server.recording.reader import read
from server.recording.writer import Recorder, RecordingError, part_of

KB = 1 << 10
TOUCH = encode(Record(7, 5_000_000, Touch(True, True, 1, 99)))


def old(folder: Path, name: str, size: int, t: int, *, keep: bool = False) -> Path:
    """A recording that ended at `t` [s]."""
    path = folder / f"{name}.mcap"
    path.write_bytes(bytes(size))
    os.utime(path, (t, t))
    if keep:
        path.chmod(0o400)
    return path


def names(folder: Path) -> set[str]:
    return {path.stem for path in folder.glob("*.mcap")}


@pytest.fixture
def disk(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[SimpleNamespace]:
    """Small, with nothing else on it than recordings and `others` bytes."""
    one = SimpleNamespace(size=100 * KB, others=0)

    def usage(_path: Path) -> SimpleNamespace:
        taken = sum(path.stat().st_size for path in tmp_path.iterdir())
        return SimpleNamespace(free=one.size - one.others - taken)

    monkeypatch.setattr(module, "shutil", SimpleNamespace(disk_usage=usage))
    return one


def test_the_oldest_go_by_when_they_ended_and_no_more_than_must(tmp_path: Path) -> None:
    for name, t in (("b", 3), ("a", 4), ("d", 1), ("c", 2)):
        old(tmp_path, name, 10 * KB, t)
    one = RecordingFolder(tmp_path, DiskLimits(40 * KB, 0))
    assert one.make_room() == ""
    assert names(tmp_path) == {"a", "b", "c", "d"}
    assert one.make_room(tmp_path / "new.mcap", 11 * KB) == ""
    assert names(tmp_path) == {"a", "b"}
    count, said = one.removed()
    assert count == 2
    assert "the 2 oldest recordings were removed: d to c, 0.00 GB" in said
    assert one.removed() == (0, "")
    assert one.taken() == 20 * KB


def test_one_that_is_write_protected_stays_and_when_nothing_else_is_left_it_is_said(
    tmp_path: Path,
) -> None:
    old(tmp_path, "kept", 30 * KB, 1, keep=True)
    old(tmp_path, "new", 10 * KB, 2)
    one = RecordingFolder(tmp_path, DiskLimits(35 * KB, 0))
    assert one.full() == ""
    assert one.make_room() == ""
    assert names(tmp_path) == {"kept"}
    assert "take 2.000 GiB, of 0.000" in one.make_room(tmp_path / "now.mcap", 2 << 30)
    assert names(tmp_path) == {"kept"}


def test_without_a_budget_none_goes_whatever_the_disk_has(
    tmp_path: Path, disk: SimpleNamespace
) -> None:
    old(tmp_path, "a", 10 * KB, 1)
    one = RecordingFolder(tmp_path, DiskLimits(0, 95 * KB))
    assert "left on the disk" in one.full()
    assert "left on the disk" in one.make_room()
    assert names(tmp_path) == {"a"}


def test_with_a_budget_the_oldest_go_for_the_reserve_too(
    tmp_path: Path, disk: SimpleNamespace
) -> None:
    for k in range(3):
        old(tmp_path, str(k), 20 * KB, k)
    one = RecordingFolder(tmp_path, DiskLimits(100 * KB, 50 * KB))
    assert one.full() == ""
    assert one.make_room() == ""
    assert names(tmp_path) == {"1", "2"}
    disk.others = 60 * KB  # even without any there is too little
    assert "left on the disk" in one.full()


@given(
    st.lists(st.tuples(st.integers(0, 9), st.integers(0, 5), st.booleans()), max_size=8),
    st.integers(1, 30),
    st.integers(0, 12),
)
def test_within_the_budget_or_nothing_is_left_to_go_and_who_stays_is_newer_or_kept(
    found: list[tuple[int, int, bool]], budget: int, size: int
) -> None:
    with TemporaryDirectory() as directory:
        there = Path(directory)
        told = {
            str(k): (kb * KB, t, keep)
            for k, (kb, t, keep) in enumerate(found)
            if old(there, str(k), kb * KB, t, keep=keep)
        }
        one = RecordingFolder(there, DiskLimits(budget * KB, 0))
        one.make_room()
        why = one.make_room(there / "new.mcap", size * KB)
        left = names(there)
        gone = set(told) - left
        fits = sum(told[name][0] for name in left) + size * KB <= budget * KB
        assert fits == (why == "")
        assert fits or all(told[name][2] for name in left)
        assert not any(told[name][2] for name in gone)
        loose = [told[name][1] for name in left if not told[name][2]]
        assert not gone or not loose or max(told[name][1] for name in gone) <= min(loose)


def test_while_it_is_written_a_recording_takes_the_place_of_older_ones(tmp_path: Path) -> None:
    for k in range(3):
        old(tmp_path, str(k), 100 * KB, k)
    recorder = Recorder(RecordingFolder(tmp_path, DiskLimits(301 * KB, 0)), "now", {})
    recorder.record("phone", TOUCH, 1.0)
    for _ in range(8):
        recorder.record("server", os.urandom(16 * KB), 1.0)
    while "1" in names(tmp_path) and recorder._thread.is_alive():
        recorder._thread.join(0.01)
    assert part_of(recorder.path).exists()
    recorder.close()
    assert recorder.error == ""
    assert names(tmp_path) == {"2", "now"}
    assert list(read(recorder.path).phone_records()) == [(1.0, TOUCH)]


def test_where_those_that_are_kept_take_all_no_recording_begins_and_it_is_said(
    tmp_path: Path,
) -> None:
    old(tmp_path, "kept", 3 << 20, 1, keep=True)
    recordings = Recordings(tmp_path, {}, DiskLimits(2 << 20, 0))
    assert recordings.why_not() == "recordings take 0.003 GiB, of 0.002 that they may"
    with pytest.raises(RecordingError, match=r"take 0\.003 GiB"):
        recordings.start()


def test_where_none_may_go_nobody_looks_through_them_to_say_that_there_is_room(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(RecordingFolder, "_finished", lambda _self: pytest.fail("looked"))
    assert RecordingFolder(tmp_path).full() == ""
