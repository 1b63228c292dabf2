"""Tables of `experiments all`: any JSON of an experiment becomes what people can read."""

from __future__ import annotations

import json
from math import inf, nan
from pathlib import Path

import pytest

from server.experiments.all.results import read, seeds_of
from server.experiments.all.show import table_of
from server.experiments.all.tables import GOAL_COLUMN, Lines, Statements, Table, blocks, titled


def texts(table: Table) -> list[list[str]]:
    return [[cell.text for cell in row] for row in table.rows]


def test_paper_ours_and_ratio_adjoin_and_are_judged_in_words() -> None:
    rows = [
        {"axis": "x", "paper": 4.0, "unit": "mm", "ours": 5.0, "ratio": 1.25},
        {"axis": "y", "paper": 4.0, "unit": "mm", "ours": 5.1, "ratio": None},
        {"axis": "z", "paper": None, "unit": "mm", "ours": 1.0, "ratio": None},
    ]
    (table,) = blocks(rows)
    assert isinstance(table, Table)
    assert table.columns == ("axis", "paper", "ours", "ratio", GOAL_COLUMN, "unit")
    assert [row[4].text for row in table.rows] == ["✓ within", "✗ out", "–"]
    assert [row[4].kind for row in table.rows] == ["within", "out", "text"]
    assert texts(table)[0][1:4] == ["4", "5.0", "1.250"]


def test_an_experiments_objects_become_tables_statements_and_lines() -> None:
    told = {
        "source": "paper",
        "table_3": {
            "title": "Table III",
            "cells": [{"a": 1, "b": {"deep": 1}, "c": ""}],
            "holds": {"x": False},
        },
        "arming": ["yes", "no"],
        "versions": {"numpy": "told elsewhere"},
    }
    lines, source, table, statements = blocks(told)
    assert lines == Lines("", ("yes", "no"))
    assert isinstance(source, Table)
    assert texts(source) == [["source", "paper"]]
    assert isinstance(table, Table)
    assert (table.title, table.columns) == ("Table III", ("a",))
    assert statements == Statements("", {"x": False})


@pytest.mark.parametrize("odd", [nan, inf, -inf, 10**400, None, [], {}, True, "x" * 10_000])
def test_any_value_can_stand_in_a_table(odd: object) -> None:
    (table,) = blocks([{"name": "first", "value": odd}, {"name": "second", "value": 2.0}])
    assert isinstance(table, Table)
    assert texts(table)[1] == ["second", "2"]
    assert len(texts(table)[0][1]) < 500


def test_a_column_has_the_decimals_that_its_largest_number_asks_for() -> None:
    (table,) = blocks([{"n": 123.45, "m": 0.0421, "k": 3}, {"n": 1.0, "m": 0.00042, "k": 20}])
    assert isinstance(table, Table)
    assert texts(table) == [["123.5", "0.04210", "3"], ["1.0", "0.00042", "20"]]


def test_numbers_of_very_different_sizes_have_their_own_digits() -> None:
    (table,) = blocks([{"n": 512345.6}, {"n": 5.234}, {"n": 0.0}])
    assert isinstance(table, Table)
    assert texts(table) == [["512346"], ["5.234"], ["0"]]


def test_a_table_that_has_no_rows_yet_has_its_heads() -> None:
    assert str(table_of(Table("t", ("session", "seed"), ()))).count("<th") == 3  # and the thead


def test_units_are_told_as_people_write_them() -> None:
    assert titled("estimate_rms_mm") == "estimate RMS [mm]"
    assert titled("band_m_s2") == "band [m/s²]"
    assert titled("saturated_pct") == "saturated [%]"


def test_seeds_are_those_of_the_command_or_of_the_sweep(tmp_path: Path) -> None:
    assert seeds_of(["paper", "--seeds", "3", "--only", "x"]) == "1 to 3"
    assert seeds_of(["estimators", "--seeds", "2", "--seed", "1000"]) == "1000, 1001"
    assert seeds_of(["sweep", "latency"]) == ""
    told = {"sweep": {"seeds": [1, 2, 3]}, "summary": []}
    (tmp_path / "sweep.json").write_text(json.dumps(told))
    assert read(tmp_path, "sweep").seeds == "1 to 3"


def test_what_cannot_be_shown_is_named(tmp_path: Path) -> None:
    (tmp_path / "long.csv").write_text("a\n" + 100 * "1\n")
    (tmp_path / "deep.json").write_text(100_000 * "[")
    (tmp_path / "list.json").write_text('{"a": ' * 900 + "1" + "}" * 900)
    (tmp_path / "ragged.csv").write_text("a,b\n1\n")
    (tmp_path / "short.csv").write_text("rms_mm,b\n1,2\n")
    found = read(tmp_path, "any")
    assert [note.split(":")[0] for note in found.notes][:1] == ["deep.json"]
    assert {"long.csv", "ragged.csv"} <= {note.split(":")[0] for note in found.notes}
    tables = [block for block in found.blocks if isinstance(block, Table)]
    assert ("RMS [mm]", "b") in [table.columns for table in tables]


def test_only_a_parts_own_assumptions_are_shown_with_it(tmp_path: Path) -> None:
    common, own = {"what": "mass", "value": "5"}, {"what": "wall", "value": "stiff"}
    (tmp_path / "a.json").write_text(json.dumps({"assumptions": [common, own]}))
    (tmp_path / "b.json").write_text(json.dumps({"assumptions": [common]}))
    (table,) = read(tmp_path, "any", [common]).blocks
    assert isinstance(table, Table)
    assert texts(table) == [["wall", "stiff"]]


def test_of_two_pictures_of_one_name_the_smaller_file_is_shown(tmp_path: Path) -> None:
    (tmp_path / "a.png").write_bytes(b"\x89PNG\r\n\x1a\n" + bytes(100))
    (tmp_path / "a.svg").write_text("<svg xmlns='http://www.w3.org/2000/svg'/>")
    (figure,) = read(tmp_path, "any").figures
    assert figure.source.startswith("data:image/svg+xml;base64,")
    assert figure.caption == "a"
