"""Directories of servers by their names: each its own, found by the others, nobody else's."""

from __future__ import annotations

import pytest

from server.common.runtime import (
    LAUNCH_FILE,
    LONGEST_NAME,
    BusyError,
    is_running,
    launch_of,
    prepare,
    runtime_directory,
    server_name,
    servers_here,
)


@pytest.fixture(autouse=True)
def base(runtime_base):
    return runtime_base / "lightleash"


@pytest.mark.parametrize("name", ["", "left", "7", "arm-2", "L" * LONGEST_NAME])
def test_a_name_is_letters_digits_and_dashes(name):
    assert server_name(name) == name


@pytest.mark.parametrize(
    "name", ["-", "left-", "-left", "a b", "../up", ".", "a_b", "ä", "left\n", "x" * 25]
)
def test_any_other_name_is_refused_with_what_is_allowed(name):
    with pytest.raises(ValueError, match="letters, digits and dashes"):
        server_name(name)


def test_servers_with_names_of_their_own_run_beside_each_other(base):
    with prepare(base, base), prepare(runtime_directory("left"), base):
        assert list(servers_here()) == ["", "left"]
        assert all(map(is_running, servers_here().values()))
        with pytest.raises(BusyError, match="another --name"):
            prepare(runtime_directory("left"), base)
    assert not any(map(is_running, servers_here().values()))
    assert all(one.stat().st_mode & 0o777 == 0o700 for one in (base, base / "servers"))


def test_who_looks_whether_a_server_runs_keeps_none_from_starting(base):
    directory = runtime_directory("left")
    for _ in range(50):
        assert not is_running(directory)
        with prepare(directory, base):
            assert is_running(directory)


def test_a_directory_that_leads_elsewhere_is_no_server_here(base):
    prepare(runtime_directory("left"), base).close()
    other = base.parent / "other"
    prepare(other).close()
    (base / "servers" / "right").symlink_to(other)
    (base / "servers" / "not a name").mkdir()
    assert list(servers_here()) == ["", "left"]
    with pytest.raises(BusyError, match="somebody else"):
        prepare(runtime_directory("right"), base)


def test_a_base_that_leads_elsewhere_is_not_taken_for_a_server_in_it(base):
    (base.parent / "other").mkdir()
    base.symlink_to(base.parent / "other")
    with pytest.raises(BusyError, match="somebody else"):
        prepare(runtime_directory("left"), base)


def test_a_path_too_long_for_a_socket_is_refused_before_anything_starts(tmp_path):
    with pytest.raises(BusyError, match="too long for sockets"):
        prepare(tmp_path / ("x" * 100))


def test_a_launch_file_that_makes_no_sense_tells_nothing(base):
    prepare(base).close()
    for text in ("", "{}", '{"name": "", "robot": "ames", "https_port": "x", "http_port": 1}'):
        (base / LAUNCH_FILE).write_text(text)
        assert launch_of(base) is None
