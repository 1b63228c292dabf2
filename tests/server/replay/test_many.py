"""Many recordings by a cluster: the tables that one alone would have; what fails is a row."""

from __future__ import annotations

import csv
import os
import signal
import sys
from contextlib import closing
from pathlib import Path

import pytest

from server.common.cluster import workers
from server.common.cluster.workers import Failure, local_cluster
from server.common.errors import InputError
from server.recording.reader import read
from server.replay import command, many
from server.replay.many import ReplayResults, recordings_in
from server.replay.offline import run_offline

FLIGHT = Path(__file__).parents[2] / "data" / "virtual_phone.mcap"


def copies(folder: Path, *names: str) -> Path:
    folder.mkdir()
    for name in names:
        (folder / f"{name}.mcap").write_bytes(FLIGHT.read_bytes())
    return folder


def summary(folder: Path) -> list[dict[str, str]]:
    return list(csv.DictReader((folder / many.SUMMARY).read_text().splitlines()))


def inline(work, jobs, address):
    """As `workers.each`, without a cluster."""
    for job in jobs:
        yield job, work(job)


def test_a_folder_is_its_recordings_by_name_and_two_of_a_name_are_refused(tmp_path):
    left, right = copies(tmp_path / "left", "b", "a"), copies(tmp_path / "right", "c", "a")
    one = right / "c.mcap"
    assert [path.stem for path in recordings_in([left, one])] == ["a", "b", "c"]
    assert recordings_in([one, one]) == [one]
    with pytest.raises(InputError, match="same table"):
        recordings_in([left, right])
    (tmp_path / "empty").mkdir()
    with pytest.raises(InputError, match="holds no recording"):
        recordings_in([tmp_path / "empty"])


def test_a_recording_that_fails_is_a_row_with_its_error(tmp_path, monkeypatch, capsys):
    folder, out = copies(tmp_path / "records", "good"), tmp_path / "out"
    (folder / "bad.mcap").write_bytes(FLIGHT.read_bytes()[:100_000])
    monkeypatch.setattr(workers, "each", inline)
    absent = str(tmp_path / "absent.mcap")
    arguments = [str(folder), absent, "--scheduler", "tcp://127.0.0.1:9", "--out", str(out)]
    assert command.main(arguments) == 1
    bad, good, gone = summary(out)
    assert (bad["pictures"], gone["pictures"]) == ("0", "0")
    assert "was never closed" in bad["error"]
    assert "can't be used" in gone["error"]
    assert (good["pictures"], good["found"], good["error"]) == ("104", "104", "")
    assert sorted(path.name for path in out.iterdir()) == ["good.csv", many.SUMMARY]
    run_offline(read(FLIGHT), tmp_path / "alone.csv")
    assert (out / "good.csv").read_bytes() == (tmp_path / "alone.csv").read_bytes()
    assert "3 recordings, 2 failed" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (["b.mcap"], "with --scheduler alone"),
        (["--workers", "2"], "with --scheduler local alone"),
        (["--scheduler", "tcp://127.0.0.1:9", "--workers", "2"], "a cluster has its own"),
        (["--scheduler", "local", "--recover"], "not with --scheduler"),
    ],
)
def test_options_that_do_not_belong_together_are_refused_in_one_line(capsys, options, words):
    with pytest.raises(SystemExit) as ended:
        command.main(["a.mcap", *options])
    assert ended.value.code == 2
    told = capsys.readouterr().err
    assert words in told
    assert told.count("\n") == 1


def test_a_cluster_without_dask_or_address_is_refused_in_one_line(tmp_path, capsys, monkeypatch):
    given = [str(FLIGHT), "--out", str(tmp_path), "--scheduler"]
    assert command.main([*given, "bananas"]) == 1
    assert "allowed: HOST:PORT" in capsys.readouterr().err
    monkeypatch.setitem(sys.modules, "distributed", None)  # as if it were not installed
    for address in ("local", "tcp://127.0.0.1:9"):
        assert command.main([*given, address]) == 1
        assert "pip install 'lightleash[dask]'" in capsys.readouterr().err


def test_what_was_done_before_an_interruption_is_kept(tmp_path, monkeypatch):
    folder, out = copies(tmp_path / "records", "a", "b"), tmp_path / "out"

    def interrupted(work, jobs, address):
        yield next(iter(inline(work, jobs, address)))
        raise KeyboardInterrupt

    monkeypatch.setattr(workers, "each", interrupted)
    arguments = [str(folder), "--scheduler", "tcp://127.0.0.1:9", "--out", str(out)]
    assert command.main(arguments) == 130
    assert [row["pictures"] for row in summary(out)] == ["104"]
    assert (out / "a.csv").exists()


def replayed_but_by_the_dead(path: str) -> many.Replayed:
    """Recordings with a name like this end whoever replays them."""
    if Path(path).stem == "deadly":
        os.kill(os.getpid(), signal.SIGKILL)
    return many.replayed(path)


@pytest.mark.long
@pytest.mark.slow
def test_a_worker_killed_costs_no_recording_and_one_that_kills_is_a_row(tmp_path):
    names = [f"flight-{k}" for k in range(5)]
    folder = copies(tmp_path / "records", *names[:2], "deadly", *names[2:])
    (folder / "bad.mcap").write_bytes(b"no recording")
    recordings, out = recordings_in([folder]), tmp_path / "out"
    results = ReplayResults(out, recordings)
    with local_cluster(2) as address:
        jobs = map(str, recordings)
        with closing(workers.each(replayed_but_by_the_dead, jobs, address)) as outcomes:
            for path, outcome in outcomes:
                results.add(path, outcome)
    results.write()
    rows = {Path(row["recording"]).stem: row for row in summary(out)}
    assert "not an MCAP file" in rows.pop("bad")["error"]
    assert "KilledWorker" in rows.pop("deadly")["error"]
    assert {row["error"] for row in rows.values()} == {""}
    run_offline(read(FLIGHT), tmp_path / "alone.csv")
    tables = {(out / f"{name}.csv").read_bytes() for name in names}
    assert tables == {(tmp_path / "alone.csv").read_bytes()}


@pytest.mark.slow
def test_a_failure_of_a_cluster_is_a_row(tmp_path):
    results = ReplayResults(tmp_path, [FLIGHT])
    results.add(str(FLIGHT), Failure("MemoryError: too long"))
    results.write()
    assert summary(tmp_path)[0]["error"] == "MemoryError: too long"
