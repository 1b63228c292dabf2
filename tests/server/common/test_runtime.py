"""Directories of servers by their names: each its own, found by the others, nobody else's."""

from __future__ import annotations

import resource
from contextlib import contextmanager

import pytest

from server.common.runtime import (
    LAUNCH_FILE,
    LONGEST_NAME,
    BusyError,
    is_running,
    launch_of,
    prepare,
    replacement,
    runtime_directory,
    server_name,
    servers_here,
    whole_new_file,
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


@contextmanager
def full_disk(room):
    """Of which `room` bytes are left to each file."""
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (room, hard))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))


@pytest.mark.parametrize("private", [False, True])
def test_a_file_is_replaced_by_a_whole_one_or_stays(tmp_path, private):
    file = tmp_path / "robot.toml"
    with replacement(file, private=private) as part:
        part.write_text("name = 1\n")
    assert file.read_text() == "name = 1\n"
    assert not private or file.stat().st_mode & 0o077 == 0
    with full_disk(8), pytest.raises(OSError, match="too large"):  # noqa: SIM117
        with replacement(file, private=private) as part:
            part.write_text("name = 22222222222\n")
    assert [one.name for one in tmp_path.iterdir()] == [file.name]
    assert file.read_text() == "name = 1\n"


@pytest.mark.parametrize("private", [False, True])
def test_a_new_file_is_whole_or_not_there_and_never_takes_another_s_place(tmp_path, private):
    file = tmp_path / "robot.toml"
    with full_disk(8), pytest.raises(OSError, match="too large"):  # noqa: SIM117
        with whole_new_file(file, private=private) as new:
            new.write(b"name = 22222222222\n")
    assert not list(tmp_path.iterdir())
    with whole_new_file(file, private=private) as new:
        new.write(b"name = 1\n")
    assert not private or file.stat().st_mode & 0o077 == 0
    with pytest.raises(FileExistsError), whole_new_file(file, private=private):
        pass
    assert file.read_text() == "name = 1\n"
