"""A real robot has one server; a simulated one is nobody else's."""

from __future__ import annotations

import pytest

from server.common.runtime import BusyError
from server.common.settings import load
from server.process import launcher
from server.process.robot_claim import claimed


def test_a_second_server_of_a_real_robot_is_refused_and_told_who_has_it(tmp_path):
    state = ["--state", str(tmp_path)]
    left, right = (load(["--name", name, "--no-simulate", *state]) for name in ("left", "right"))
    with claimed(left):
        with pytest.raises(BusyError, match=r"robot ames: the server 'left' commands it"):
            claimed(right).__enter__()
        with claimed(load(["--robot", "quadrotor", "--no-simulate", *state])), claimed(load(state)):
            pass
    with claimed(right), pytest.raises(BusyError, match="'right'"):
        claimed(left).__enter__()


@pytest.mark.usefixtures("runtime_base")
def test_serve_ends_in_one_line_before_anything_starts(tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(launcher, "children_of", lambda *_: pytest.fail("something starts"))
    words = ["--no-simulate", "--state", str(tmp_path), "--https-port", "0", "--http-port", "0"]
    with claimed(load(words)):
        assert launcher.main(load([*words, "--name", "left"]), []) == 2
    said = capsys.readouterr().err
    assert "robot ames: the server without a name commands it" in said
    assert said.count("\n") == 1
