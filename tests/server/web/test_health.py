"""Health: silent control, a recording that ended by itself, a full disk; and who is told."""

import os
import shutil
from types import SimpleNamespace

import pytest

from server.common import clock
from server.common.clock import now
from server.recording import folder
from server.recording.folder import DiskLimits, RecordingFolder
from server.recording.writer import RecordingError
from server.web.health import problems
from server.web.metrics import exposition
from tests.server.house import control_status, house_in

SILENT_S = 1.0


@pytest.fixture
def manager(tmp_path):
    with house_in(tmp_path) as house:
        house.manager.status = control_status()
        house.manager.control_meter.tick(now(), now())
        yield house.manager


def test_a_second_of_silence_of_control_is_a_problem(manager):
    assert problems(manager, manager.status.t) == []
    assert problems(manager, now() + SILENT_S) == ["The control process does not answer."]


def fill_the_disk(monkeypatch):
    usage = SimpleNamespace(free=folder.RESERVE_BYTES - 1)
    monkeypatch.setattr(folder, "shutil", SimpleNamespace(disk_usage=lambda path: usage))


def test_on_a_full_disk_nothing_is_begun_and_it_is_said_why(manager, monkeypatch):
    fill_the_disk(monkeypatch)
    with pytest.raises(RecordingError, match="only 255 MB are left on the disk"):
        manager.start_recording()
    assert "only 255 MB" in problems(manager, manager.status.t)[0]


def test_a_disk_that_fills_up_ends_the_recording_which_is_readable_and_people_are_told(
    manager, monkeypatch, tmp_path
):
    names = iter(("first", "second"))  # two of one second would be called the same
    monkeypatch.setattr(clock, "file_stamp", lambda: next(names))
    name = manager.start_recording()
    recorder = manager.recordings._recorder
    fill_the_disk(monkeypatch)
    recorder._thread.join(5.0)
    manager._tick()
    assert manager.recordings.name == ""
    assert any("only 255 MB are left" in event.text for event in manager.events)
    assert next(tmp_path.rglob(f"{name}.mcap")).stat().st_size > 0
    monkeypatch.setattr(folder, "shutil", shutil)
    heard = manager.status.t
    assert "only 255 MB" in problems(manager, heard)[0]  # until somebody has looked after it
    manager.start_recording()
    assert problems(manager, heard) == []
    manager.recordings.stop()


def test_what_went_to_make_room_is_an_event_and_counted(manager, tmp_path):
    there = tmp_path / "recordings"
    there.mkdir()
    for name in ("first", "second"):
        (there / f"{name}.mcap").write_bytes(bytes(2000))
    os.utime(there / "first.mcap", (1, 1))
    manager.recordings.folder = RecordingFolder(there, DiskLimits(3000, 0))
    manager.recordings.folder.make_room()
    manager._tick()
    (said,) = [event.text for event in manager.events if "make room" in event.text]
    assert "the oldest recording was removed: first" in said
    told = exposition(manager).decode()
    assert "lightleash_recordings_removed_total 1.0" in told
    assert "lightleash_recordings_bytes 2000.0" in told
