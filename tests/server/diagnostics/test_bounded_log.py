"""The log says what happens, and no more than so many bytes, whatever happens."""

from __future__ import annotations

import logging

from hypothesis import given
from hypothesis import strategies as st

from server.diagnostics.bounded_log import SAME_AT_ONCE, SAME_HZ, Bounded, escaped

MB = 1_000_000
formatter = logging.Formatter("%(asctime)s %(name)s %(levelname)s %(message)s")


class Log:
    """What a bounded log wrote, in virtual time."""

    def __init__(self):
        self.filter, self.lines = Bounded(), []

    def say(self, t, message, *args, level=logging.WARNING, exc_info=None):
        record = logging.LogRecord("lightleash", level, "x.py", 1, message, args, exc_info)
        record.created = t
        if self.filter.filter(record):
            self.lines.append(formatter.format(record))

    @property
    def size(self):
        return sum(len(line) + 1 for line in self.lines)


def test_an_hour_of_one_stranger_who_never_tires_is_little():
    log = Log()
    for n in range(36_000):
        log.say(0.1 * n, "too many connections from %s", f"198.51.100.{n % 250}")
    assert len(log.lines) <= SAME_AT_ONCE + SAME_HZ * 3600.0
    assert log.size < 0.2 * MB


def test_an_hour_of_lines_that_are_all_different_stays_below_a_megabyte():
    log = Log()
    for n in range(100_000):
        level = logging.ERROR if n % 3 else logging.WARNING
        log.say(0.036 * n, f"{n} went wrong\n" + "a line of a traceback\n" * 40, level=level)
    assert 0.1 * MB < log.size < MB


def test_what_was_kept_back_is_counted_with_the_next_line():
    log = Log()
    for n in range(100):
        log.say(0.001 * n, "refused: %d", n)
    log.say(10.0, "refused: %d", 100)
    assert len(log.lines) == SAME_AT_ONCE + 1
    assert "refused: 9" in log.lines[-2]
    assert "refused: 100 (90 more like it)" in log.lines[-1]


def test_one_flood_does_not_hide_another_message():
    log = Log()
    for n in range(10_000):
        log.say(0.0001 * n, "flood %d", n)
    log.say(1.0, "STOP by %s", "supervisor", level=logging.INFO)
    assert "STOP by supervisor" in log.lines[-1]


def test_a_flood_of_different_warnings_does_not_drown_an_error():
    log = Log()
    for n in range(5_000):
        log.say(0.0001 * n, f"{n} " + "x" * 200)
    log.say(1.0, "control is silent", level=logging.ERROR)
    assert "control is silent" in log.lines[-1]


def test_what_is_remembered_is_bounded():
    log = Log()
    for n in range(20_000):
        log.say(0.0, f"{n} is new")
    assert len(log.filter._kinds) <= 256
    assert len(log.filter._kept_back) <= 256


@given(st.text())
def test_no_text_speaks_to_the_terminal(text):
    assert not set(escaped(text)) & {chr(n) for n in (*range(9), *range(10, 32), *range(127, 160))}


def test_plain_text_stays_as_it_is_and_a_line_stays_one_line():
    assert escaped("größer als 5 µm\tx") == "größer als 5 µm\tx"
    assert escaped("\x1b[2J\r\nforged") == "\\x1b[2J\\r\\nforged"
