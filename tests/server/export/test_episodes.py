"""Episodes by press and release, with what was said of them while they were recorded."""

from __future__ import annotations

import pytest

from server.export.decoded import DatedNote, DatedTouch, DecodedRecording
from server.export.episodes import episodes
from server.recording.episodes import TaskNote, VerdictNote
from server.recording.reader import read
from tests.server.export.recordings import FLIGHT, on_a_known_day


def touch(t, held, press=1, visible=True):
    return DatedTouch(t, held, visible, press)


def task(t, text):
    return DatedNote(t, TaskNote(text))


def verdict(t, press, keep=False):
    return DatedNote(t, VerdictNote(press, keep))


def told(*items, **options):
    return [(one.task, one.keep) for one in episodes(items, **options)]


def test_an_episode_lasts_from_press_to_release_or_to_the_next_press():
    items = [touch(1.0, True), touch(2.0, False), touch(3.0, True, 2), touch(4.0, True, 3)]
    items += [touch(5.0, True, 3), touch(6.0, True, 3, visible=False), touch(7.0, False, 3)]
    found = episodes(items)
    assert [(one.number, one.t_begin, one.t_end) for one in found] == [
        (0, 1.0, 2.0),
        (1, 3.0, 4.0),
        (2, 4.0, 6.0),
    ]
    assert episodes(items[:1])[0].t_end == 1.0


def test_a_task_counts_from_the_next_press_on():
    items = [task(0.0, "fetch"), touch(1.0, True), task(1.5, "put back"), touch(2.0, False)]
    items += [touch(3.0, True, 2), touch(4.0, False, 2), task(4.5, ""), touch(5.0, True, 3)]
    assert told(*items) == [("fetch", True), ("put back", True), ("", True)]
    assert told(*items, task="follow")[2] == ("follow", True)


def test_the_last_verdict_of_the_newest_press_of_that_number_counts():
    """Another phone, or the same one come anew, counts from 1 again."""
    two = [touch(1.0, True), touch(2.0, False)], [touch(3.0, True), touch(4.0, False)]
    assert [keep for _, keep in told(*two[0], *two[1], verdict(5.0, 1))] == [True, False]
    assert [keep for _, keep in told(*two[0], verdict(2.5, 1), *two[1])] == [False, True]
    assert [keep for _, keep in told(*two[0], verdict(2.2, 1), verdict(2.5, 1, keep=True))] == [
        True
    ]
    assert told(verdict(0.5, 1), *two[0]) == [("", True)]  # of one before the recording
    assert told(*two[0], verdict(2.5, 7)) == [("", True)]


def test_what_is_discarded_when_it_is_exported_stays_so():
    items = [touch(1.0, True), touch(2.0, False), verdict(3.0, 1, keep=True)]
    assert told(*items, discard=frozenset({0})) == [("", False)]


def test_a_recording_of_before_has_none_and_a_note_of_a_later_version_is_passed_over(tmp_path):
    recording = DecodedRecording(read(on_a_known_day(tmp_path, FLIGHT)))
    assert not any(isinstance(item, DatedNote) for item in recording.items())
    [one] = episodes(recording.items(), "follow")
    assert (one.task, one.keep) == ("follow", True)
    notes = [(0.0, b'{"type":"mood"}'), (0.0, b'{"type":"task","text":"fetch"}')]
    (tmp_path / "said").mkdir()
    later = DecodedRecording(read(on_a_known_day(tmp_path / "said", FLIGHT, notes=notes)))
    assert [item.note for item in later.items() if isinstance(item, DatedNote)] == [
        TaskNote("fetch")
    ]
    assert episodes(later.items(), "follow")[0].task == "fetch"


@pytest.mark.parametrize(
    "told_of", [b"\xff", b"[" * 9999, b'{"type":"verdict","press":-1,"keep":true}']
)
def test_a_note_that_makes_no_sense_is_passed_over(tmp_path, told_of):
    odd = DecodedRecording(read(on_a_known_day(tmp_path, FLIGHT, notes=[(0.0, told_of)])))
    assert not any(isinstance(item, DatedNote) for item in odd.items())
