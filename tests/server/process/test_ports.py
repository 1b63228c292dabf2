"""Ports of several servers: one nobody asked for gives way to a server of ours, to nobody else."""

from __future__ import annotations

import socket
from contextlib import contextmanager

import pytest

from server.common.runtime import launch_of, prepare, runtime_directory, servers_here
from server.common.settings import load
from server.process import ports
from server.process.ports import listen, listening

pytestmark = pytest.mark.usefixtures("runtime_base")


@pytest.fixture
def usual():
    """Free ports, to be those that are wished unless somebody says otherwise."""
    with listen("127.0.0.1", 0) as https, listen("127.0.0.1", 0) as http:
        return [one.getsockname()[1] for one in (https, http)]


@contextmanager
def server(usual, *words):
    """Its ports, while it runs."""
    settings = load(["--host", "127.0.0.1", *words])
    unsaid = {"https_port": usual[0], "http_port": usual[1]}
    for name in settings.model_fields_set & set(unsaid):
        del unsaid[name]
    settings = settings.model_copy(update=unsaid)
    settings.model_fields_set.difference_update(unsaid)  # as if they were the defaults
    directory = runtime_directory(settings.name)
    with prepare(directory, runtime_directory()), listening(settings, print) as sockets:
        yield [one.getsockname()[1] for one in sockets]


def test_the_second_server_takes_the_next_ports_and_says_whose_the_wished_are(usual, capsys):
    with server(usual) as first, server(usual, "--name", "left") as second:
        assert first == usual
        assert not set(first) & set(second)
        said = capsys.readouterr().out.splitlines()
        assert [line.split(":")[0] for line in said] == [
            f"Port {port} is taken by the server without a name" for port in usual
        ]
        assert all(f"here it is {port} " in line for port, line in zip(second, said, strict=True))
        launch = launch_of(runtime_directory("left"))
        assert launch is not None
        assert [launch.https_port, launch.http_port] == second
    assert [launch_of(one) for one in servers_here().values()] == [None, None]


def test_a_port_that_was_asked_for_gives_way_to_nobody(usual, capsys):
    with (
        server(usual, "--name", "left") as taken,
        pytest.raises(OSError, match="the server 'left' has it"),
        server(usual, "--https-port", str(taken[0])),
    ):
        pass
    assert capsys.readouterr().out == ""


def test_a_port_of_any_other_program_ends_the_start_and_leaves_the_other_port_free(usual):
    with socket.create_server(("127.0.0.1", usual[1])):
        with pytest.raises(OSError, match=f"port {usual[1]}.*choose another one"), server(usual):
            pass
        listen("127.0.0.1", usual[0]).close()


def test_what_a_killed_server_left_behind_takes_no_port(usual, monkeypatch):
    with monkeypatch.context() as patch, server(usual, "--name", "left") as held:
        patch.setattr(ports, "is_running", lambda directory: False)
        with pytest.raises(OSError, match=f"port {held[0]}: Address already in use"), server(usual):
            pass
