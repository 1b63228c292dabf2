"""CSV tables, as a spreadsheet reads them."""

import csv
from datetime import UTC, datetime, timedelta

import pytest

from server.export.command import main
from tests.server.export.recordings import (
    FLIGHT,
    TWIST_IN_B,
    ZERO_NS,
    film,
    on_a_known_day,
    told_a_twist,
    with_a_battery,
)

ZERO = datetime(1970, 1, 1, tzinfo=UTC) + timedelta(microseconds=ZERO_NS // 1000)


def tables(source, folder, *arguments):
    assert main([str(source), "--to", "csv", "--out", str(folder), *arguments]) == 0
    return {
        path.stem: list(csv.DictReader(path.read_text().splitlines()))
        for path in (folder / f"{source.stem}.csv").glob("*.csv")
    }


@pytest.fixture(scope="module")
def flight(tmp_path_factory):
    folder = tmp_path_factory.mktemp("flight")
    return tables(on_a_known_day(folder), folder / "out")


def test_every_table_is_there_with_as_many_rows_as_were_recorded(flight):
    counts = {name: len(rows) for name, rows in flight.items()}
    assert counts.pop("log") == 5
    assert counts == {
        "pictures": 107, "phone_imu": 328, "robot_imu": 1098, "touches": 156,
        "states": 275, "episodes": 1,
    }  # fmt: skip


def test_the_calendar_and_the_servers_clock_agree_in_every_row(flight):
    for rows in flight.values():
        for row in rows:
            since = datetime.fromisoformat(row["utc"]) - ZERO
            assert since.total_seconds() == pytest.approx(float(row["t_s"]), abs=3e-6)


def test_numbers_are_bare_and_what_nobody_knew_is_empty(flight):
    first, last = flight["states"][0], flight["states"][-1]
    assert (first["x_m"], first["sigma_position_m"]) == ("", "")
    assert 1.5 < float(last["x_m"]) < 3.5
    assert float(last["qw"]) > 0.9
    assert [name for name in last if name.startswith("thrust_")] == [
        f"thrust_{k}_n" for k in range(8)
    ]
    assert float(last["thrust_0_n"]) != 0.0
    assert float(flight["phone_imu"][0]["az_m_s2"]) == pytest.approx(9.8, abs=1.0)


def test_of_a_robot_that_takes_a_twist_the_states_end_with_what_it_was_told(tmp_path):
    states = tables(told_a_twist(tmp_path), tmp_path / "out")["states"]
    assert list(states[0])[-6:] == [
        "told_vx_m_s", "told_vy_m_s", "told_vz_m_s",
        "told_wx_rad_s", "told_wy_rad_s", "told_wz_rad_s",
    ]  # fmt: skip
    assert tuple(float(cell) for cell in list(states[-1].values())[-6:]) == TWIST_IN_B


def test_the_battery_is_in_the_states_while_it_is_told(tmp_path):
    states = tables(with_a_battery(tmp_path), tmp_path / "out")["states"]
    assert [row["battery_v"] for row in states] == 137 * [""] + 138 * ["10.25"]


def test_without_a_day_the_calendar_is_empty(tmp_path):
    assert {row["utc"] for row in tables(FLIGHT, tmp_path)["states"]} == {""}


def test_presses_are_episodes_and_some_are_discarded(tmp_path):
    touches = [
        (100.0, False, 0), (100.1, True, 1), (100.2, True, 1), (100.3, False, 1),
        (100.4, True, 2), (100.5, True, 3), (100.6, True, 3),
    ]  # fmt: skip
    source = film(tmp_path, "jpeg", touches=touches)
    found = tables(source, tmp_path / "out", "--discard", "1", "--task", "plug in")
    rows = [(float(r["t_s"]), float(r["end_s"]), r["keep"]) for r in found["episodes"]]
    assert rows == [
        (pytest.approx(100.1, abs=2e-6), pytest.approx(100.3, abs=2e-6), "1"),
        (pytest.approx(100.4, abs=2e-6), pytest.approx(100.5, abs=2e-6), "0"),
        (pytest.approx(100.5, abs=2e-6), pytest.approx(100.6, abs=2e-6), "1"),
    ]
    assert {row["task"] for row in found["episodes"]} == {"plug in"}
    assert {row["sigma_s"] for row in found["pictures"]} == {"0.0538516481"}  # nobody was asked


@pytest.mark.parametrize("words", [["none.mcap"], [str(FLIGHT.with_suffix(".md"))]])
def test_what_is_no_recording_is_named_and_nothing_is_made(tmp_path, capsys, words):
    assert main([*words, "--out", str(tmp_path / "out")]) == 1
    assert "lightleash export:" in capsys.readouterr().err
    assert not (tmp_path / "out").exists()


def test_a_missing_extra_is_named(tmp_path, capsys, monkeypatch):
    import sys

    monkeypatch.setitem(sys.modules, "server.export.foxglove", None)
    monkeypatch.setitem(sys.modules, "foxglove_schemas_protobuf", None)
    assert main([str(FLIGHT), "--out", str(tmp_path)]) == 1
    assert "extra `export`" in capsys.readouterr().err
