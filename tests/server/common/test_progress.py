import io

from server.common.progress import Progress


class Terminal(io.StringIO):
    def isatty(self):
        return True


def shown(stream, total, n=40):
    """What is written about `n` things that take 1/16 s each."""
    now = iter(k / 16 for k in range(100_000))
    progress = Progress(total, stream, lambda: next(now))
    for k in range(n):
        progress.advance(f"found {k}")
    progress.close()
    return stream.getvalue()


def test_a_terminal_shows_one_line_that_changes_ten_times_a_second():
    text = shown(Terminal(), 40)
    assert text.count("\n") == 1
    assert text.count("\r") == 21
    assert text.endswith("100 % ██████████████████████████████ 16/s, 0 s left  found 39\n")


def test_elsewhere_a_line_is_written_every_tenth():
    lines = shown(io.StringIO(), 40).splitlines()
    assert [line.split("  ")[0] for line in lines] == [f"{k} %" for k in range(10, 101, 10)]


def test_less_than_ten_things_are_told_of_too():
    assert shown(io.StringIO(), 3, 3).splitlines()[-1] == "100 %  found 2"


def test_how_many_need_not_be_known():
    assert shown(Terminal(), None).endswith("40 frames, 16/s  found 39\n")
    assert shown(io.StringIO(), None) == ""


def test_more_than_were_promised_do_no_harm():
    assert "100 % " in shown(Terminal(), 10, 15)
