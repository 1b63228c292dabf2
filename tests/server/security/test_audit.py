"""The audit log: private, bounded, one line a deed, and nobody writes a line of his own."""

from __future__ import annotations

import json
import resource

import pytest
from hypothesis import given
from hypothesis import strategies as st

from server.protocol.people_messages import Deed
from server.security import audit
from server.security.audit import (
    AUDIT_FILE,
    FILES,
    REFUSALS,
    REFUSALS_S,
    SAME_S,
    Audit,
    append,
    line_of,
)


class Clock:
    t = 10.0

    def __call__(self):
        return self.t


def lines(folder):
    return [json.loads(line) for line in (folder / AUDIT_FILE).read_text().splitlines()]


def test_a_deed_is_kept_with_who_when_whence_and_why(tmp_path):
    log = Audit(tmp_path, Clock())
    log.note("revoke", "Anna", "supervisor", "192.0.2.1", "lost phone")
    log.close()
    (line,) = lines(tmp_path)
    wall = line.pop("wall")
    assert wall.endswith("+00:00")
    assert line == {
        "t_s": 10.0,
        "what": "revoke",
        "who": "Anna",
        "role": "supervisor",
        "address": "192.0.2.1",
        "why": "lost phone",
    }


def test_the_log_is_for_its_owner_alone_and_goes_on_where_it_was(tmp_path):
    for _ in range(2):
        log = Audit(tmp_path)
        log.note("arm", "Anna")
        log.close()
    assert (tmp_path / AUDIT_FILE).stat().st_mode & 0o777 == 0o600
    assert len(lines(tmp_path)) == 2


@given(st.text(), st.text())
def test_no_name_writes_a_second_line_or_moves_a_cursor(who, why):
    line = line_of(Deed(0.0, "", "arm", who, "operator", "", why))
    assert line.isascii()
    assert line[:-1].isprintable()
    assert line.count("\n") == 1
    assert json.loads(line)["who"] == who


def test_it_takes_bounded_room(tmp_path, monkeypatch):
    monkeypatch.setattr(audit, "MAX_BYTES", 200)
    for n in range(100):
        append(tmp_path / AUDIT_FILE, f"{n:099}\n")
    files = sorted(tmp_path.iterdir())
    assert len(files) == FILES
    assert all(path.stat().st_size <= 200 for path in files)
    assert (tmp_path / AUDIT_FILE).read_text().splitlines()[-1] == f"{99:099}"
    assert all(path.stat().st_mode & 0o777 == 0o600 for path in files)


def test_a_link_in_its_place_is_not_followed(tmp_path):
    (tmp_path / AUDIT_FILE).symlink_to(tmp_path / "elsewhere")
    with pytest.raises(OSError, match="symbolic"):
        append(tmp_path / AUDIT_FILE, "{}\n")
    assert not (tmp_path / "elsewhere").exists()


def test_a_stop_that_is_said_twenty_times_a_second_is_one_deed():
    log = Audit(clock=(clock := Clock()))
    kept = []
    for _ in range(30):
        kept.append(log.note("stop", "Anna"))
        clock.t += 0.05
    assert len([one for one in kept if one is not None]) == 2
    assert log.note("stop", "Bert") is not None
    clock.t += SAME_S
    assert log.note("stop", "Anna") is not None


@pytest.mark.parametrize("what", ["revoke", "confirm", "deny", "invite", "arm", "hand-over"])
def test_deeds_that_concern_different_people_are_all_kept(what):
    log = Audit(clock=Clock())
    kept = [log.note(what, "Sue", "supervisor", "", whom) for whom in ("Anna", "Bert", "Anna")]
    assert [one is not None for one in kept] == [True, True, False]


def test_a_flood_of_refusals_leaves_a_few_lines_and_their_count():
    log = Audit(clock=(clock := Clock()))
    kept = [log.note("refusal", why=str(n)) for n in range(1000)]
    assert len([one for one in kept if one is not None]) == REFUSALS
    clock.t += REFUSALS_S
    assert "(970 more left out)" in log.note("refusal", why="next").why


def test_refusals_of_strangers_push_out_no_deed_and_use_up_no_member_s_refusals(
    tmp_path, monkeypatch
):
    monkeypatch.setattr(audit, "MAX_BYTES", 1_000)
    log = Audit(tmp_path, clock := Clock())
    log.note("revoke", "Sue", "supervisor", "", "Anna")
    for n in range(100):
        clock.t += REFUSALS_S / REFUSALS
        log.note("refusal", "", "", "192.0.2.1", str(n))
    for n in range(REFUSALS):
        log.note("refusal", "", "", "192.0.2.2", str(n))
    assert log.note("refusal", "Vera", "viewer", "192.0.2.3", "arm").why == "arm"
    log.close()
    assert [one["what"] for one in lines(tmp_path)] == ["revoke", "refusal"]
    assert len(list(tmp_path.glob("refusals*.jsonl"))) == FILES


def test_a_disk_that_takes_nothing_stops_nobody(tmp_path, caplog):
    (tmp_path / "state").write_text("a file where a folder should be")
    log = Audit(tmp_path / "state")
    assert log.note("arm", "Anna") is not None
    log.close()
    assert "can't be written" in caplog.text


def test_what_the_disk_did_not_take_is_counted_in_the_next_line_that_it_takes(tmp_path):
    (state := tmp_path / "state").write_text("a file where a folder should be")
    log = Audit(state)
    for who in ("Anna", "Bert"):
        log.note("arm", who)
    log.close()
    log.note("arm", "Carl")  # tells of two, and is lost itself
    log.close()
    state.unlink()
    log.note("arm", "Dora")
    log.close()
    (line,) = lines(state)
    assert (line["who"], line["why"].strip()) == ("Dora", "(3 more left out)")


def test_half_a_line_that_a_full_disk_takes_does_not_spoil_the_next(tmp_path):
    append(tmp_path / AUDIT_FILE, "{}\n")
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (8, hard))
    try:
        with pytest.raises(OSError, match=r"No space|too large"):
            append(tmp_path / AUDIT_FILE, '{"what": "arm"}\n')
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))
    append(tmp_path / AUDIT_FILE, "{}\n")
    assert lines(tmp_path) == [{}, {}]
