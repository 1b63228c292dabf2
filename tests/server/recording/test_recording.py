"""Recordings: what was put in comes out; crashes cost the last moments only; damage is named."""

import errno
import json
import signal
import subprocess
import sys
import threading
import time
from contextlib import suppress
from pathlib import Path

import msgspec
import pytest
from mcap.reader import make_reader
from mcap.writer import Writer

from server.common import clock
from server.control.ipc import ControlStatus
from server.protocol.wire import VERSION, encode
from server.protocol.wire_records import Ping, Pong, Record, Touch
from server.recording.control import Recordings
from server.recording.folder import RecordingFolder
from server.recording.reader import before, read, recover, recover_all
from server.recording.writer import (
    CAMERA_KEY,
    CAPACITY,
    DEVICE_KEY,
    GATHER_S,
    PHONE_MESSAGES,
    PHONE_RECORDS,
    SERVER_RECORDS,
    STATUS,
    UNIX_ZERO_KEY,
    Recorder,
    RecordingError,
    finish_file,
    part_of,
    write_whole,
)

TOUCH = encode(Record(7, 5_000_000, Touch(True, True, 1, 99)))
METADATA = {"device": "a phone", "robot_file": "name = 'ames'\n"}
WRITER = """
import sys
from pathlib import Path
from server.recording.folder import RecordingFolder
from server.recording.writer import Recorder
recorder = Recorder(RecordingFolder(Path(sys.argv[1])), "killed", {"device": "a phone"})
touch = bytes.fromhex(sys.argv[2])
count, size = 0, 0
while size < 3 * 131072:
    if recorder.written > count - 1000:
        recorder.record("phone", touch, 100.0 + 0.01 * count)
        count += 1
    size = Path(recorder._file.name).stat().st_size * 20  # it compresses
print("written", flush=True)
sys.stdin.read()
"""

STEP_S, LOST_S = 0.01, 0.3
"""Between items of a recorder that is killed; what is promised to be lost at most."""
KILLED = """
import os, signal, sys, time
from pathlib import Path
from server.common import clock
from server.recording import writer
from server.recording.folder import RecordingFolder
from server.recording.writer import Recorder
writer.GATHER_S = 0.0  # of real time
t = 0.0
clock.now = lambda: t
recorder = Recorder(RecordingFolder(Path(sys.argv[1])), "killed", {"device": "a phone"})
for k in range(int(sys.argv[3])):
    t = k * float(sys.argv[4])
    recorder.record("phone", bytes.fromhex(sys.argv[2]), t)
    while recorder.written <= k:
        time.sleep(0.0)
os.kill(os.getpid(), signal.SIGKILL)
"""


def status(t):
    fields = dict.fromkeys(ControlStatus.__struct_fields__)
    samples = [(t - 0.005, 0.1, 0.2, 0.3, 0.0, 0.0, 9.8)]
    return ControlStatus(**fields | {"t": t, "pose_age": float("inf"), "body_samples": samples})


def make(directory, name="flight", touches=1):
    recorder = Recorder(RecordingFolder(directory), name, METADATA)
    for k in range(touches):
        recorder.record("phone", TOUCH, 100.0 + 0.1 * k)
    return recorder


def test_what_was_recorded_is_read_back_in_order_of_time(tmp_path):
    pong = encode(Record(8, 6_000_000, Pong(5, 99_000_000)))
    recorder = make(tmp_path)
    recorder.record("server", encode(Record(1, 99_000_000, Ping(5))), 99.0)
    recorder.record("phone", pong, 99.5)
    recorder.message("phone", '{"type":"command","what":"arm"}', 101.0)
    recorder.status(status(102.0), 102.001)
    recorder.close()
    recording = read(recorder.path)
    assert recording.metadata["robot_file"] == METADATA["robot_file"]
    assert recording.metadata["protocol_version"] == str(VERSION)
    assert list(recording.phone_records()) == [(99.5, pong), (100.0, TOUCH)]
    entries = list(recording.entries())
    assert [e.topic for e in entries] == [
        SERVER_RECORDS, PHONE_RECORDS, PHONE_RECORDS, PHONE_MESSAGES, STATUS,
    ]  # fmt: skip
    assert (recording.t_first, recording.t_last) == (99.0, 102.001)
    kept = json.loads(entries[-1].data)
    assert kept["body_samples"][0] == [pytest.approx(101.995), 0.1, 0.2, 0.3, 0.0, 0.0, 9.8]
    assert kept["pose_age"] is None
    assert (recorder.written, recorder.dropped, recorder.error) == (5, 0, "")


def test_a_recording_knows_the_day_also_when_recovered(tmp_path):
    recorder = make(tmp_path)
    recorder.close()
    zero = read(recorder.path).unix_zero_ns
    assert zero == pytest.approx(clock.unix_zero_ns(), abs=60e9)  # two clocks are read, not at once
    assert read(recover(recorder.path)).unix_zero_ns == zero


def test_a_recording_that_began_before_the_phone_knows_the_phones_first_camera(tmp_path):
    recordings = Recordings(tmp_path, METADATA)
    recordings.start()
    recordings.record("phone", TOUCH, 100.0)
    recordings.learn("a browser", "")
    recordings.learn("a browser", "its camera")
    recordings.learn("a browser", "as it is turned")
    path = Path(recordings.stop())
    assert read(path).metadata[CAMERA_KEY] == "its camera"
    recovered = read(recover(path)).metadata
    assert (recovered[DEVICE_KEY], recovered[CAMERA_KEY]) == ("a browser", "its camera")
    assert recovered["robot_file"] == METADATA["robot_file"]


def test_a_recording_that_knew_its_camera_keeps_it(tmp_path):
    recordings = Recordings(tmp_path, METADATA)
    recordings.start("a phone", "its camera")
    recordings.record("phone", TOUCH, 100.0)
    recordings.learn("a phone", "as it is turned")
    assert read(Path(recordings.stop())).metadata[CAMERA_KEY] == "its camera"


def test_older_recordings_know_no_day_and_a_wrong_one_is_named(tmp_path):
    old = read(Path(__file__).parents[2] / "data" / "chromium.mcap")
    assert old.unix_zero_ns is None
    recorder = Recorder(RecordingFolder(tmp_path), "odd", {UNIX_ZERO_KEY: "yesterday"})
    recorder.record("phone", TOUCH, 1.0)
    recorder.close()
    with pytest.raises(RecordingError, match="'yesterday'"):
        _ = read(recorder.path).unix_zero_ns


def test_capture_time_on_the_phones_clock_is_the_publish_time(tmp_path):
    from mcap.reader import make_reader

    recorder = make(tmp_path)
    recorder.record("phone", TOUCH[:8] + b"\xff" * 24, 101.0)  # not yet checked bytes
    recorder.record("phone", b"short", 102.0)
    recorder.close()
    with recorder.path.open("rb") as stream:
        published = [m.publish_time for _, _, m in make_reader(stream).iter_messages()]
    assert published == [5_000_000_000, 0, 102_000_000_000]


def test_while_open_the_file_has_another_name_and_is_locked(tmp_path):
    recorder = make(tmp_path)
    try:
        assert part_of(recorder.path).exists()
        assert not recorder.path.exists()
        assert recover_all(tmp_path) == []
        with pytest.raises(RecordingError, match="is being written"):
            recover(part_of(recorder.path))
    finally:
        recorder.close()
    assert recorder.path.exists()
    assert not part_of(recorder.path).exists()


def test_a_name_in_use_is_refused(tmp_path):
    make(tmp_path).close()
    with pytest.raises(RecordingError, match="another name"):
        make(tmp_path)


def test_after_close_everything_is_dropped_and_counted(tmp_path):
    recorder = make(tmp_path)
    recorder.close()
    recorder.record("phone", TOUCH, 101.0)
    recorder.status(status(1.0), 1.0)
    assert recorder.dropped == 2


def test_a_slow_disk_costs_items_not_time(tmp_path, monkeypatch):
    disk = threading.Event()
    taken = threading.Event()

    def slow(*_args):
        taken.set()
        disk.wait()

    monkeypatch.setattr("server.recording.writer._add", slow)
    recorder = make(tmp_path)
    taken.wait()
    for _ in range(CAPACITY + 30):
        recorder.record("phone", TOUCH, 1.0)
    assert recorder.dropped == 30
    disk.set()
    recorder.close()
    assert recorder.written == CAPACITY + 1


def test_what_comes_one_by_one_is_written_together(tmp_path):
    """To wake for each of 400 items a second cost 7 % of a core, most of it for the others."""
    recorder = make(tmp_path)
    status = Path(f"/proc/self/task/{recorder._thread.native_id}/status")
    if not status.exists():
        pytest.skip("only Linux tells how often a thread slept")
    before = slept(status)
    for _ in range(100):
        recorder.record("phone", TOUCH, 1.0)
        time.sleep(0.002)
    assert slept(status) - before < 50
    recorder.close()
    assert recorder.written > 100


def slept(status: Path) -> int:
    """How often a thread has waited for something."""
    words = status.read_text().split("\nvoluntary_ctxt_switches:")
    return int(words[1].split()[0])


def test_a_recorder_that_fails_by_whatever_it_is_says_so(tmp_path, monkeypatch):
    def failing(*_args):
        raise MemoryError("no more")

    monkeypatch.setattr("server.recording.writer._add", failing)
    recorder = make(tmp_path)
    recorder.record("phone", TOUCH, 1.0)
    recorder._thread.join(5.0)
    assert recorder.error == "MemoryError: no more"


def test_a_disk_that_takes_nothing_is_told_while_it_does_and_what_is_missing_afterwards(
    tmp_path, monkeypatch
):
    disk, taken = threading.Event(), threading.Event()

    def hanging(*_args):
        taken.set()
        disk.wait()

    monkeypatch.setattr("server.recording.writer._add", hanging)
    recorder = make(tmp_path)
    for _ in range(CAPACITY + 2):
        recorder.record("phone", TOUCH, 1.0)
    taken.wait()
    assert recorder.stuck == ""
    monkeypatch.setattr("server.recording.writer.STUCK_S", 0.0)
    assert "the disk has taken nothing for" in recorder.stuck
    disk.set()
    recorder.close()
    assert "items are missing" in recorder.lacks


def test_a_full_disk_ends_the_recording_and_says_so(tmp_path):
    recorder = Recorder(RecordingFolder(tmp_path), "flight", METADATA, max_bytes=0)
    while not recorder.error:
        recorder.record("phone", TOUCH, 1.0)
    recorder.close()
    assert "larger than" in recorder.error
    assert read(recorder.path).metadata["device"] == "a phone"


def test_a_recording_that_ends_by_itself_makes_nobody_wait_for_the_disk(tmp_path, monkeypatch):
    disk = threading.Event()

    def slow(writer, file):
        disk.wait(1.0)
        finish_file(writer, file)

    monkeypatch.setattr("server.recording.writer.finish_file", slow)
    recordings = Recordings(tmp_path, METADATA)
    recordings.start()
    recorder = recordings._recorder
    recorder._max_bytes = 0
    while not recorder.error:
        recordings.record("phone", TOUCH, 1.0)
    assert not recordings.end_if_failed()
    disk.set()
    recorder._thread.join(5.0)
    assert recordings.end_if_failed()
    assert "larger than" in recordings.failure


def test_a_killed_recording_is_refused_then_recovered(tmp_path):
    command = [sys.executable, "-c", WRITER, str(tmp_path), TOUCH.hex()]
    process = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE)
    assert process.stdout.readline() == b"written\n"
    process.kill()
    process.communicate()
    part = tmp_path / "killed.mcap.part"
    with pytest.raises(RecordingError, match=r"never closed.*--recover"):
        read(part)
    (path,) = recover_all(tmp_path)
    assert not part.exists()
    recording = read(path)
    records = list(recording.phone_records())
    assert recording.metadata["device"] == "a phone"
    assert len(records) > 1000
    assert all(data == TOUCH for _, data in records)
    assert [t for t, _ in records] == pytest.approx([100 + 0.01 * k for k in range(len(records))])


@pytest.mark.parametrize("count", [100, 112, 124])
def test_a_killed_recording_loses_no_more_than_is_promised(tmp_path, count):
    words = [str(tmp_path), TOUCH.hex(), str(count), str(STEP_S)]
    done = subprocess.run([sys.executable, "-c", KILLED, *words], check=False)
    assert done.returncode == -signal.SIGKILL
    (path,) = recover_all(tmp_path)
    times = [t for t, _ in read(path).phone_records()]
    assert times == pytest.approx([STEP_S * k for k in range(len(times))])
    assert count - len(times) <= (LOST_S - GATHER_S) / STEP_S


def test_recovering_twice_changes_nothing(tmp_path):
    recorder = make(tmp_path, touches=50)
    recorder.close()
    entries = list(read(recorder.path).entries())
    recover(recorder.path)
    assert list(read(recorder.path).entries()) == entries
    assert recover_all(tmp_path) == []


def test_a_closed_recording_that_is_damaged_is_kept_beside_what_was_rescued_of_it(tmp_path):
    recorder = make(tmp_path, touches=20_000)
    recorder.close()
    path, count = recorder.path, len(list(read(recorder.path).entries()))
    damaged = bytearray(path.read_bytes())
    with path.open("rb") as stream:
        summary = make_reader(stream).get_summary()
    assert summary is not None
    second = summary.chunk_indexes[1]
    end = second.chunk_start_offset + second.chunk_length
    damaged[end - 100 : end] = bytes(100)
    path.write_bytes(damaged)
    assert recover(path) == path
    assert 0 < len(list(read(path).entries())) < count
    assert before(path).read_bytes() == damaged
    with pytest.raises(RecordingError, match="was recovered before"):
        recover(path)
    assert before(path).read_bytes() == damaged


def finished_bytes(tmp_path):
    recorder = make(tmp_path, touches=30)
    recorder.close()
    return recorder.path.read_bytes()


def test_what_finds_no_room_to_be_recovered_stays_as_it_is_and_leaves_the_room_there_was(
    tmp_path, monkeypatch
):
    def full(*_args):
        raise OSError(errno.ENOSPC, "No space left on device")

    (folder := tmp_path / "recordings").mkdir()
    part = folder / "killed.mcap.part"
    part.write_bytes(finished_bytes(tmp_path)[:-50])
    monkeypatch.setattr("server.recording.reader.finish_file", full)
    with pytest.raises(RecordingError, match="No space left"):
        recover(part)
    assert recover_all(folder) == []
    assert list(folder.iterdir()) == [part]


@pytest.mark.parametrize(
    ("content", "what"),
    [
        (b"", "not an MCAP"),
        (b"hello, I am a film\n" * 9, "not an MCAP"),
        (b"\x89MCAP0\r\n", "never closed"),
        (b"\x89MCAP0\r\n" * 2, "be used|damaged"),
        (b"\x89MCAP0\r\n" + bytes(64) + b"\x89MCAP0\r\n", "damaged"),
    ],
)
def test_garbage_is_named(tmp_path, content, what):
    path = tmp_path / "garbage.mcap"
    path.write_bytes(content)
    with pytest.raises(RecordingError, match=what) as caught:
        read(path)
    assert caught.value.path == path


def test_a_directory_or_missing_file_is_named(tmp_path):
    for path in (tmp_path, tmp_path / "none.mcap"):
        with pytest.raises(RecordingError, match="can't be used"):
            read(path)


def test_every_flipped_byte_is_read_or_named(tmp_path):
    whole = finished_bytes(tmp_path)
    path = tmp_path / "damaged.mcap"
    for k in range(8, len(whole) - 8, 5):
        path.write_bytes(whole[:k] + bytes([whole[k] ^ 0x55]) + whole[k + 1 :])
        with suppress(RecordingError):
            assert len(list(read(path).entries())) <= 30


def test_every_cut_is_recovered_up_to_the_cut(tmp_path):
    whole = finished_bytes(tmp_path)
    part = tmp_path / "cut.mcap.part"
    counts = []
    for k in range(8, len(whole), 97):
        part.write_bytes(whole[:k])
        try:
            counts.append(len(list(read(recover(part)).entries())))
        except RecordingError:
            counts.append(0)
    assert counts == sorted(counts)
    assert counts[-1] == 30


def test_another_version_is_named(tmp_path):
    path = tmp_path / "old.mcap"
    for metadata, what in (({"protocol_version": "0"}, "version 0"), (None, "no recording of")):
        with path.open("wb") as stream:
            writer = Writer(stream)
            writer.start()
            if metadata:
                writer.add_metadata("lightleash", metadata)
            writer.finish()
        with pytest.raises(RecordingError, match=what):
            read(path)


def test_a_recording_without_a_phone_is_named(tmp_path):
    recorder = make(tmp_path, touches=0)
    recorder.status(status(1.0), 1.0)
    recorder.close()
    with pytest.raises(RecordingError, match="no stream of a phone"):
        read(recorder.path)


def test_statuses_survive_whatever_number_they_hold(tmp_path):
    recorder = make(tmp_path)
    odd = msgspec.structs.replace(status(1.0), error_m=float("nan"), lateness_ms={"p50": 1e308})
    recorder.status(odd, 3.0)
    recorder.close()
    assert recorder.written == 2


@pytest.mark.parametrize("metadata", [None, "lightleash", "other"])
def test_a_file_of_another_program_is_not_rescued_but_stays_as_it_is(tmp_path, metadata):
    """Exports for Foxglove have metadata of that name and channels of their own."""
    path = tmp_path / "theirs.mcap"
    with path.open("wb") as stream:
        writer = Writer(stream)
        writer.start()
        if metadata:
            writer.add_metadata(metadata, {"device": "a phone"})
        channel = writer.register_channel("/tf", "protobuf", schema_id=0)
        writer.add_message(channel, 1, b"not ours", 1)
        writer.finish()
    before = path.read_bytes()
    with pytest.raises(RecordingError, match="nothing of Lightleash that can be rescued"):
        recover(path)
    assert path.read_bytes() == before
    assert list(tmp_path.iterdir()) == [path]


def test_what_is_known_already_is_written_whole_or_not_at_all(tmp_path):
    def items():
        yield PHONE_RECORDS, 1.0, TOUCH
        raise OSError(errno.ENOSPC, "No space left on device")

    with pytest.raises(OSError, match="No space left"):
        write_whole(tmp_path / "film.mcap", METADATA, items())
    assert list(tmp_path.iterdir()) == []
