"""Replays: a recorded phone is re-timed and answered as a living one; offline it repeats itself."""

import asyncio
import csv
import itertools
import json
from pathlib import Path

import msgspec
import numpy as np
import pytest

from pipeline.signals import PhoneImu, TouchState
from server.phone.ingest import EncodedFrame, Ingest
from server.protocol.messages import encode_message
from server.protocol.wire import decode, encode
from server.protocol.wire_records import Credit, Motion, Picture, Ping, Pong, Record, Touch
from server.recording.folder import RecordingFolder
from server.recording.reader import Recording, device_of, read
from server.recording.writer import PHONE_RECORDS, STATUS, Recorder, RecordingError
from server.replay import command
from server.replay.command import Replay, play
from server.replay.dates import timed
from server.replay.offline import Offline, run_offline
from server.replay.setting import body_samples, recorded_robot
from server.replay.table import COLUMNS
from tests.data.record_flight import record_flight
from tests.server.export.recordings import TWIST_IN_B, told_a_twist
from tests.server.page_server import WELCOME, PageServer, status

FLIGHT = Path(__file__).parents[2] / "data" / "virtual_phone.mcap"
ONE_KEY = FLIGHT.with_name("chromium.mcap")
AT_REST = Motion((0.0, 0.0, 0.0), (9.8, 0.0, 0.0), None, 90)


@pytest.fixture(scope="module")
def flight(tmp_path_factory):
    """Flown by what is held against it: a filter of another day was sure at another moment."""
    return read(record_flight(tmp_path_factory.mktemp("flight")))


@pytest.fixture(scope="module")
def offline_rows(flight, tmp_path_factory):
    out = tmp_path_factory.mktemp("offline") / "run.csv"
    run_offline(flight, out)
    return list(csv.DictReader(out.read_text().splitlines())), out.read_bytes()


def test_recorded_latencies_are_those_of_the_virtual_phone(flight):
    """Pictures 60-120 ms, motion 15-40 ms, as it was made; ingest works in periods of 5 ms."""
    kinds = {}
    for recorded in timed(flight):
        kinds.setdefault(type(recorded.record.body).__name__, []).append(recorded.latency_s)
    assert 0.055 < min(kinds["Picture"]) < 0.07
    assert 0.11 < max(kinds["Picture"]) < 0.13
    assert 0.013 < min(kinds["Motion"]) < 0.025
    assert 0.035 < max(kinds["Motion"]) < 0.048
    assert max(kinds["Touch"]) < 0.02


def test_without_pongs_the_quickest_record_took_no_time(tmp_path):
    recorder = Recorder(RecordingFolder(tmp_path), "old", {})
    for k, latency in enumerate((0.03, 0.01, 0.05)):
        t_us = round(1e6 * (777.0 + k - latency))
        recorder.record("phone", encode(Record(k, t_us, AT_REST)), 100.0 + k)
    recorder.record("phone", b"what the server refused", 103.0)
    recorder.close()
    latencies = [recorded.latency_s for recorded in timed(read(recorder.path))]
    assert latencies == pytest.approx([0.02, 0.0, 0.04], abs=1e-6)


def living_server(played):
    """A fresh ingest that has asked `played` for its clock until it is known."""
    ingest = Ingest(itertools.count(1000).__next__)
    for k in range(20):
        t = 50.0 + k / 20.0
        ping = ingest.ping(t)
        pong = played.pong(ping.body.nonce, ping.t_us, t + 0.002)
        ingest.record(decode(encode(pong)), t + 0.004)
    return ingest


@pytest.mark.parametrize("speed", [0.5, 1.0, 4.0])
def test_latencies_are_the_recorded_ones_at_the_speed_of_the_replay(flight, speed):
    records = timed(flight)
    played = Replay(records, speed)
    ingest = living_server(played)
    latencies, kinds = [], set()
    due = list(played.due(51.0))
    for t, recorded in due:
        signal = ingest.record(decode(encode(played.retimed(t, recorded))), t)
        if isinstance(signal, PhoneImu | EncodedFrame):
            latencies.append((t - signal.t, recorded.latency_s / speed))
        kinds.add(type(signal))
    assert kinds == {PhoneImu, EncodedFrame, TouchState}
    now, then = np.array(latencies).T
    assert np.abs(now - then).max() < 1e-3
    phone = [r for r in records if not isinstance(r.record.body, Pong)]
    assert due[-1][0] - due[0][0] == pytest.approx((phone[-1].t - phone[0].t) / speed)


def test_touch_echoes_the_living_servers_nonce_and_old_pongs_are_not_sent(flight):
    played = Replay(timed(flight))
    played.pong(4711, 1, 50.0)
    sent = [played.retimed(t, recorded).body for t, recorded in played.due(51.0)]
    assert {body.nonce for body in sent if isinstance(body, Touch)} == {4711}
    assert any(body.held for body in sent if isinstance(body, Touch))
    assert not any(isinstance(body, Pong) for body in sent)


def test_offline_twice_gives_the_same_bytes(flight, offline_rows, tmp_path):
    words = run_offline(flight, tmp_path / "again.csv")
    assert (tmp_path / "again.csv").read_bytes() == offline_rows[1]
    assert f"{len(offline_rows[0])} pictures" in words


def test_offline_finds_the_robot_and_flies_the_same_modes(offline_rows):
    rows, _ = offline_rows
    assert tuple(rows[0]) == COLUMNS
    assert [name for name, _ in itertools.groupby(row["mode"] for row in rows)] == [
        "DISARMED", "ARMED", "TRACK",
    ]  # fmt: skip
    tracked = [row for row in rows if row["mode"] == "TRACK"]
    assert all(row["found"] == "1" and row["leds"] == "5" for row in tracked)
    assert max(float(row["reprojection_px"]) for row in tracked) < 0.5


def test_offline_estimates_are_those_of_the_flight(flight, offline_rows):
    """What control said then, against what the replay says now, some milliseconds apart."""
    rows, _ = offline_rows
    then = [json.loads(entry.data) for entry in flight.entries(STATUS)]
    then = [s for s in then if s["p_bc_in_c"] is not None]
    times = np.array([s["t"] for s in then])
    errors = []
    for row in rows:
        if row["mode"] == "TRACK":
            s = then[int(np.argmin(np.abs(times - float(row["t_s"]))))]
            now = [float(row[f"fused_{axis}_m"]) for axis in "xyz"]
            errors.append(np.linalg.norm(np.subtract(now, s["p_bc_in_c"])))
    assert len(errors) > 30
    assert np.median(errors) < 0.003
    assert np.max(errors) < 0.02


def test_a_robot_that_takes_a_twist_is_replayed_with_what_it_measured(tmp_path):
    flight = read(FLIGHT)
    recording = read(told_a_twist(tmp_path))
    assert recorded_robot(recording).robot.twist is not None
    samples = body_samples(recording)
    assert len(samples) == len(body_samples(flight))
    assert {tuple(sample.twist_m_bf_in_b) for sample in samples} == {TWIST_IN_B}
    assert body_samples(flight)[0].twist_m_bf_in_b is None
    assert next(Offline(recording).rows())["found"] == "1"


class Unanswered(Recording):
    """The phone says nothing of its clock in the first half second."""

    def entries(self, *topics):
        for entry in super().entries(*topics):
            is_record = entry.topic == PHONE_RECORDS and entry.t < self.t_first + 0.5
            if not (is_record and isinstance(decode(entry.data).body, Pong)):
                yield entry


def test_offline_the_key_picture_may_come_before_the_phones_clock_is_known(flight, offline_rows):
    rows = list(
        Offline(Unanswered(flight.path, flight.metadata, flight.t_first, flight.t_last)).rows()
    )
    assert len(rows) < len(offline_rows[0])
    assert {row["found"] for row in rows} == {"1"}


def test_offline_without_a_known_camera_says_so(tmp_path):
    recorder = Recorder(RecordingFolder(tmp_path), "stranger", {"device": "a stranger's phone"})
    recorder.record("phone", encode(Record(1, 5, AT_REST)), 1.0)
    recorder.close()
    with pytest.raises(RecordingError, match="no picture"):
        run_offline(read(recorder.path), tmp_path / "run.csv")


def test_a_recording_begun_before_the_phone_came_knows_it_from_the_statuses(tmp_path):
    recorder = Recorder(RecordingFolder(tmp_path), "early", {"device": ""})
    recorder.record("phone", encode(Record(1, 5, AT_REST)), 1.0)
    recorder.message("server", "not a message", 1.0)
    shown = status("ARMED")
    for k, name in enumerate(("", "a phone", "another")):
        recorder.message("server", encode_message(msgspec.structs.replace(shown, operator=name)), k)
    recorder.close()
    assert device_of(read(recorder.path)) == "a phone"


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["none.mcap", "--offline"], "can't be used"),
        ([str(FLIGHT), "--url", "http://127.0.0.1:9"], "go together"),
        ([str(FLIGHT), "--url", "gopher://x", "--token", "t"], "http"),
    ],
)
def test_command_names_what_it_cannot_do(capsys, arguments, words):
    assert command.main(arguments) == 1
    assert words in capsys.readouterr().err


def test_command_writes_the_csv_beside_the_recording(tmp_path, capsys):
    path = tmp_path / "flight.mcap"
    path.write_bytes(FLIGHT.read_bytes())
    assert command.main([str(path), "--offline"]) == 0
    assert (tmp_path / "flight.csv").exists()
    assert "pictures" in capsys.readouterr().out


def test_the_csv_does_not_take_the_place_of_the_recording(tmp_path, capsys):
    path = tmp_path / "flight.mcap"
    path.write_bytes(FLIGHT.read_bytes())
    assert command.main([str(path), "--offline", "--out", str(path)]) == 1
    assert "is the recording itself" in capsys.readouterr().err
    assert path.read_bytes() == FLIGHT.read_bytes()


class ReplayServer(PageServer):
    """Pings a replayed page until its clock is known, then says it is LOST."""

    async def __call__(self, socket):
        if socket.request.path == "/ws/phone":
            pings = [encode(Record(k, k, Ping(100 + k))) for k in range(10)]
            self.after_hello = [encode_message(WELCOME), *pings, encode_message(status("LOST"))]
        await super().__call__(socket)


@pytest.mark.e2e
def test_replay_over_real_sockets_sends_the_stream_in_order(flight):
    server = ReplayServer([])

    async def talk(access):
        return await play(flight, access, 20.0)

    played = asyncio.run(server.serve(talk))
    heard = [(path, decode(data)) for path, data in server.heard]
    bodies = [record.body for _, record in heard if not isinstance(record.body, Pong)]
    recorded = [r for r in timed(flight) if not isinstance(r.record.body, Pong)]
    assert played.records == len(bodies)
    assert played.records + played.pictures_dropped == len(recorded)
    assert played.modes == {"LOST": 1}
    assert {path for path, _ in heard} == {"/ws/phone", "/ws/video"}
    motions = [b for b in bodies if isinstance(b, Motion)]
    assert motions == [r.record.body for r in recorded if isinstance(r.record.body, Motion)]
    assert {b.nonce for b in bodies if isinstance(b, Touch)} == {109}


class BusyServer(ReplayServer):
    """Gives no credit at first, as long as some pictures of the recording take to come due."""

    BUSY_S = 0.3

    async def __call__(self, socket):
        if socket.request.path == "/ws/video":
            self.credit, self.video = False, socket
        await super().__call__(socket)

    def pictures(self):
        return [decode(data) for path, data in self.heard if path == "/ws/video"]

    async def answer(self):
        while not self.pictures():
            await asyncio.sleep(0.02)
        await asyncio.sleep(self.BUSY_S)
        self.credit = True
        await self.video.send(encode(Record(1, 1, Credit(self.pictures()[-1].sequence))))


@pytest.mark.e2e
def test_a_picture_waits_for_credit_since_none_after_it_can_be_decoded_without_it():
    """The browser made one key, as it began: one picture lost was all of them lost."""
    recording = read(ONE_KEY)
    recorded = [r.record.body for r in timed(recording) if isinstance(r.record.body, Picture)]
    server = BusyServer([])

    async def talk(access):
        played, _ = await asyncio.gather(play(recording, access, 5.0), server.answer())
        return played

    played = asyncio.run(server.serve(talk))
    assert [picture.body for picture in server.pictures()] == recorded
    assert played.pictures_dropped == 0
    assert played.late_s > BusyServer.BUSY_S / 2
