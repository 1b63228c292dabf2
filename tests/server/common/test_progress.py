import io
import sys
import threading

import pytest
from tqdm import tqdm

from server.common.progress import progress_bar


class Terminal(io.StringIO):
    def isatty(self):
        return True


@pytest.fixture
def now(monkeypatch):
    """The clock of the bars, in a list [s]."""
    t = [100.0]
    monkeypatch.setattr(tqdm, "__init__", with_clock(tqdm.__init__, t))
    return t


def with_clock(init, t):
    def started(self, *args, **options):
        init(self, *args, **options)
        self._time = lambda: t[0]
        self.start_t = self.last_print_t = t[0]

    return started


def shown(monkeypatch, now, stream, total, n=40, step_s=1 / 16, **options):
    """What is written about `n` things that take `step_s` each."""
    monkeypatch.setattr(sys, "stderr", stream)
    with progress_bar(total, "frame", **options) as bar:
        for _ in range(n):
            now[0] += step_s
            bar.update()
    return stream.getvalue()


def test_a_terminal_shows_one_line_that_changes(monkeypatch, now):
    text = shown(monkeypatch, now, Terminal(), 40)
    assert text.count("\n") == 1
    assert 15 < text.count("\r") < 42
    assert "100%" in text
    assert "40/40" in text


def test_elsewhere_it_is_told_of_seldom(monkeypatch, now):
    text = shown(monkeypatch, now, io.StringIO(), 40, step_s=1.0)
    assert 3 <= text.count("/40") <= 6
    assert text.endswith("\n")


def test_work_that_is_over_at_once_shows_nothing(monkeypatch, now):
    assert shown(monkeypatch, now, io.StringIO(), 3, 3) == ""


def test_how_many_need_not_be_known(monkeypatch, now):
    assert "40 frame" in shown(monkeypatch, now, Terminal(), None)


def test_what_was_done_before_is_counted(monkeypatch, now):
    assert "40/40" in shown(monkeypatch, now, Terminal(), 40, 10, done=30)


def test_more_than_were_promised_do_no_harm(monkeypatch, now):
    assert "15" in shown(monkeypatch, now, Terminal(), 10, 15)


def test_no_thread_is_left_that_a_fork_would_copy(monkeypatch, now):
    before = threading.active_count()
    shown(monkeypatch, now, Terminal(), 40)
    assert threading.active_count() == before
