"""Epochs grow, whatever the wall clock does and whichever of clock and file is lost."""

from itertools import pairwise

from hypothesis import given, settings
from hypothesis import strategies as st

from server.robot_epoch import next_epoch


@settings(max_examples=30)
@given(st.lists(st.integers(0, 2**45), min_size=2, max_size=8))
def test_each_epoch_is_later_than_the_one_before(tmp_path_factory, times):
    file = tmp_path_factory.mktemp("epoch") / "robots" / "ames.epoch"
    epochs = [next_epoch(file, t) for t in times]
    assert epochs[0] >= 1
    assert all(b > a for a, b in pairwise(epochs))


def test_it_is_the_wall_clock_where_that_goes_on(tmp_path):
    file = tmp_path / "ames.epoch"
    assert [next_epoch(file, t) for t in (1000, 2000)] == [1000, 2000]
    file.unlink()
    assert next_epoch(file, 3000) == 3000


def test_a_file_that_is_spoilt_leaves_the_wall_clock(tmp_path):
    file = tmp_path / "ames.epoch"
    file.write_text("what?")
    assert next_epoch(file, 3000) == 3000
