"""What is started, in which order it is stopped, and what is said when it can't be."""

from __future__ import annotations

import errno
import io
import json
import socket
import sys
from types import SimpleNamespace

import pytest

from hardware.link.link_key import KEY_VARIABLE, LinkKeyError, new_key, read_key, write_key
from hardware.robot_file import RobotFileError, robot_path
from server import cli
from server.common.access import PhoneClientError
from server.common.runtime import RUN_FILE, BusyError, prepare, runtime_directory
from server.common.settings import load
from server.control.process import parse
from server.process import launcher
from server.process.invite import Invitation
from server.process.launcher import SECRET_VARIABLE, Launcher, announce, children_of
from server.process.ports import listen
from server.process.robot_key import key_file

RUN = {
    "name": "",
    "http_url": "http://127.0.0.1:8080",
    "https_url": "https://192.0.2.2:8443",
    "operator_token": "O" * 22,
    "supervisor_token": "S" * 22,
    "truth_port": 5000,
}


@pytest.fixture
def sockets():
    with listen("127.0.0.1", 0) as https, listen("127.0.0.1", 0) as http:
        yield https, http


def option(child, name):
    return child.arguments[child.arguments.index(name) + 1]


def test_the_robot_comes_first_because_it_is_stopped_first(tmp_path, sockets):
    children = children_of(load([]), [], tmp_path, sockets)
    assert [child.name for child in children] == ["robot", "control", "server"]


def test_control_is_led_to_the_simulated_robot(tmp_path, sockets):
    settings = load(["--virtual-camera.cutoff-hz", "0.05"])
    robot, control, server = children_of(settings, ["--x"], tmp_path, sockets)
    assert option(robot, "--port") == option(control, "--port")
    assert option(control, "--host") == "127.0.0.1"
    options = parse(control.arguments[1:])
    assert options.virtual_camera == settings.virtual_camera.knobs
    assert option(robot, "--truth-port") in server.arguments
    assert server.arguments[-1] == "--x"


def test_a_battery_of_the_simulated_robot_is_its_own_and_there_is_none_unasked(tmp_path, sockets):
    plain = children_of(load([]), [], tmp_path, sockets)[0].arguments
    assert {"--battery-v", "--e-stop"}.isdisjoint(plain)
    settings = load(["--simulated.e-stop"])
    assert "--e-stop" in children_of(settings, [], tmp_path, sockets)[0].arguments
    settings = load(["--simulated.battery-v", "12.6", "--simulated.drain-v-min", "0.5"])
    robot = children_of(settings, [], tmp_path, sockets)[0]
    assert (option(robot, "--battery-v"), option(robot, "--drain-v-min")) == ("12.6", "0.5")


def test_a_real_robot_is_not_simulated(tmp_path, sockets):
    write_key(key_file(tmp_path, "ames"), new_key())
    words = ["--no-simulate", "--robot-host", "192.0.2.5", "--robot-port", "4000"]
    settings = load([*words, "--state", str(tmp_path)])
    control, server = children_of(settings, [], tmp_path, sockets)
    assert (control.name, server.name) == ("control", "server")
    assert option(control, "--host") == "192.0.2.5"
    assert option(control, "--port") == "4000"


def test_sockets_and_secret_outlive_the_server_process_and_go_to_it_alone(tmp_path, sockets):
    robot, control, server = children_of(load([]), [], tmp_path, sockets)
    assert server.descriptors == tuple(one.fileno() for one in sockets)
    assert robot.descriptors == control.descriptors == ()
    secret = server.environment[SECRET_VARIABLE]
    assert len(bytes.fromhex(secret)) == 32
    assert secret not in " ".join(server.arguments)
    assert secret not in (*robot.environment.values(), *control.environment.values())


def test_robot_and_control_share_a_key_of_this_run_that_nobody_else_sees(tmp_path, sockets):
    runs = [children_of(load([]), [], tmp_path, sockets) for _ in range(2)]
    keys = set()
    for robot, control, server in runs:
        key = robot.environment[KEY_VARIABLE]
        assert control.environment[KEY_VARIABLE] == key
        assert KEY_VARIABLE not in server.environment
        assert not any(key in " ".join(child.arguments) for child in (robot, control, server))
        keys.add(key)
    assert len(keys) == 2


def test_a_real_robot_has_its_own_key_and_without_one_the_command_is_named(tmp_path, sockets):
    settings = load(["--no-simulate", "--state", str(tmp_path)])
    with pytest.raises(LinkKeyError, match="lightleash robot key ames"):
        children_of(settings, [], tmp_path, sockets)
    assert cli.main(["robot", "key", "--state", str(tmp_path)]) == 0
    key = read_key(key_file(tmp_path, "ames"))
    control, _server = children_of(settings, [], tmp_path, sockets)
    assert control.environment[KEY_VARIABLE] == key.hex()
    assert option(control, "--epochs") == str(tmp_path / "robots" / "ames.epoch")
    assert "--real" in control.arguments


def test_the_key_of_a_robot_of_ones_own_is_made_by_its_file(tmp_path, sockets):
    mine = tmp_path / "robot.toml"
    mine.write_text(robot_path("ames").read_text().replace('name = "ames"', 'name = "mine"'))
    settings = load(["--no-simulate", "--robot", str(mine), "--state", str(tmp_path)])
    with pytest.raises(LinkKeyError, match=f"robot mine: .*`lightleash robot key {mine}`"):
        children_of(settings, [], tmp_path, sockets)


def test_no_such_robot_or_gains_are_refused_by_name(tmp_path, sockets):
    with pytest.raises(RobotFileError, match="ames"):
        children_of(load(["--robot", "nobody"]), [], tmp_path, sockets)
    with pytest.raises(RobotFileError, match="phone"):
        children_of(load(["--gains", "none"]), [], tmp_path, sockets)
    with pytest.raises(RobotFileError, match="none: it takes a twist"):
        children_of(load(["--robot", "twister", "--gains", "table_2"]), [], tmp_path, sockets)


def fake(name, log):
    return SimpleNamespace(
        name=name, deaths=0, revive=lambda now: "", stop=lambda: log.append(name)
    )


def test_all_are_stopped_in_order_and_the_run_file_goes(tmp_path, capsys):
    log = []
    one = Launcher([fake(n, log) for n in ("robot", "control", "server")], tmp_path / RUN_FILE)
    (tmp_path / RUN_FILE).write_text(json.dumps(RUN))
    said = []

    def stop_when_announced(now):
        said.append(capsys.readouterr().out)
        if "Supervisor" in "".join(said):
            one.stop()

    one.revive = stop_when_announced
    assert one.run() == 0
    assert log == ["robot", "control", "server"]
    assert not (tmp_path / RUN_FILE).exists()


class Gone(io.StringIO):
    """A terminal that was closed."""

    def write(self, text: str) -> int:
        raise OSError(errno.EIO, "Input/output error")


def test_whose_terminal_has_gone_stops_all_in_order_all_the_same(tmp_path, monkeypatch):
    log = []
    one = Launcher([fake(n, log) for n in ("robot", "control", "server")], tmp_path / RUN_FILE)
    (tmp_path / RUN_FILE).write_text(json.dumps(RUN))
    one.revive = lambda now: one.stop()  # SIGHUP
    for stream in ("stdout", "stderr"):
        monkeypatch.setattr(sys, stream, Gone())
    assert one.run() == 0
    assert log == ["robot", "control", "server"]
    assert not (tmp_path / RUN_FILE).exists()


def test_a_death_that_nobody_reads_of_ends_nothing(tmp_path, monkeypatch):
    child = SimpleNamespace(name="server", revive=lambda now: "The server process ended.")
    monkeypatch.setattr(sys, "stderr", Gone())
    Launcher([child], tmp_path / RUN_FILE).revive(0.0)


def test_what_never_starts_ends_the_whole_with_its_name(tmp_path, capsys, monkeypatch):
    monkeypatch.setattr(launcher, "POLL_S", 0.0)
    log = []
    broken = fake("control", log)
    broken.deaths = launcher.MAX_DEATHS
    one = Launcher([fake("robot", log), broken], tmp_path / RUN_FILE)
    assert one.run() == 1
    assert "The control process does not start" in capsys.readouterr().err
    assert log == ["robot", "control"]


def test_a_death_is_told(tmp_path, capsys):
    child = SimpleNamespace(name="server", revive=lambda now: "The server process ended.")
    Launcher([child], tmp_path / RUN_FILE).revive(0.0)
    assert "The server process ended." in capsys.readouterr().err


def at_terminal(monkeypatch):
    """A terminal, and a server that hands out links."""
    keys = {"operator": "O" * 22, "supervisor": "S" * 22}

    def invite(run, role):
        page = "/" if role == "operator" else "/supervisor"
        urls = (f"{run[f'{way}_url']}{page}#k={keys[role]}" for way in ("https", "http"))
        return Invitation(*urls, 600.0)  # type: ignore[call-arg]

    monkeypatch.setattr(launcher, "invite", invite)
    monkeypatch.setattr("sys.stdout.isatty", lambda: True, raising=False)


def test_the_newcomer_at_a_terminal_reads_both_links_and_how_to_stop(capsys, monkeypatch):
    at_terminal(monkeypatch)
    announce(RUN)
    said = capsys.readouterr().out
    assert f"https://192.0.2.2:8443/#k={'O' * 22}" in said
    assert f"http://127.0.0.1:8080/supervisor#k={'S' * 22}" in said
    assert "Ctrl-C" in said
    assert "virtual phone" in said


def test_what_is_no_terminal_gets_no_key_but_the_command_that_makes_one(capsys, monkeypatch):
    monkeypatch.setattr(launcher, "invite", lambda *_: pytest.fail("a link was made"))
    announce(RUN)
    said = capsys.readouterr().out
    assert "#k=" not in said
    assert RUN["operator_token"] not in said
    assert RUN["supervisor_token"] not in said
    assert "lightleash invite --role supervisor" in said


def test_who_has_several_servers_reads_which_one_a_command_is_for(capsys):
    announce(RUN | {"name": "left"})
    assert "`lightleash invite --name left --role supervisor`" in capsys.readouterr().out


def test_a_server_that_has_just_died_is_told_of_and_waited_for(tmp_path, capsys, monkeypatch):
    def dead(run):
        raise PhoneClientError("http://127.0.0.1:8080 gives no link")

    monkeypatch.setattr(launcher, "announce", dead)
    (tmp_path / RUN_FILE).write_text(json.dumps(RUN))
    Launcher([], tmp_path / RUN_FILE)._announce()
    assert "gives no link; `lightleash invite`" in capsys.readouterr().err


def test_nobody_is_sent_to_a_virtual_phone_that_could_not_see_the_real_robot(capsys):
    announce(RUN | {"truth_port": 0})
    assert "virtual phone" not in capsys.readouterr().out


def test_a_terminal_gets_the_code_to_scan_if_it_is_wide_enough(capsys, monkeypatch):
    at_terminal(monkeypatch)
    lines = []
    for columns in (30, 100):
        monkeypatch.setenv("COLUMNS", str(columns))
        announce(RUN)
        lines.append(len(capsys.readouterr().out.splitlines()))
    assert lines[1] > lines[0] + 15


@pytest.mark.parametrize("host", ["127.0.0.1", "::1"])
def test_port_0_takes_any_free_one(host):
    with listen(host, 0) as one, listen(host, 0) as other:
        assert one.getsockname()[1] != other.getsockname()[1]


def test_a_taken_port_is_named():
    with socket.create_server(("127.0.0.1", 0)) as taken:
        port = taken.getsockname()[1]
        with pytest.raises(OSError, match=f"127.0.0.1, port {port}"):
            listen("127.0.0.1", port)


def test_one_directory_belongs_to_one_server(tmp_path):
    directory = tmp_path / "run"
    directory.mkdir()
    (directory / RUN_FILE).write_text("of a dead server")
    with prepare(directory):
        assert directory.stat().st_mode & 0o777 == 0o700
        assert not (directory / RUN_FILE).exists()
        with pytest.raises(BusyError, match="XDG_RUNTIME_DIR"):
            prepare(directory)
    prepare(directory).close()


def test_a_directory_that_leads_elsewhere_is_not_taken(tmp_path):
    (tmp_path / "other").mkdir()
    (tmp_path / "run").symlink_to(tmp_path / "other")
    with pytest.raises(BusyError, match="somebody else"):
        prepare(tmp_path / "run")


def test_the_directory_is_the_users(monkeypatch, tmp_path):
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(tmp_path))
    assert runtime_directory() == tmp_path / "lightleash"
    monkeypatch.delenv("XDG_RUNTIME_DIR")
    assert runtime_directory().name.startswith("lightleash-")


def test_a_busy_directory_or_port_ends_serve_with_one_line(monkeypatch, tmp_path, capsys):
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(tmp_path))
    settings = load(["--https-port", "0", "--http-port", "0"])
    with prepare(runtime_directory()):
        assert launcher.main(settings, []) == 2
    assert "runs already" in capsys.readouterr().err
    with socket.create_server(("127.0.0.1", 0)) as taken:
        busy = load(["--https-port", "0", "--http-port", str(taken.getsockname()[1])])
        assert launcher.main(busy, []) == 2
    assert capsys.readouterr().err.count("\n") == 1


def test_who_waits_long_is_told_what_for(tmp_path, capsys, monkeypatch):
    monkeypatch.setattr(launcher, "REMIND_S", 0.1)
    one = Launcher([fake("control", [])], tmp_path / RUN_FILE)
    said = []

    def stop_when_reminded(now):
        said.append(capsys.readouterr().out)
        if "Still starting" in "".join(said):
            one.stop()

    one.revive = stop_when_reminded
    assert one.run() == 0


KILLED = "import os, signal; os.kill(os.getpid(), signal.SIGKILL)"


@pytest.mark.parametrize(
    ("warm", "says"),
    [("raise SystemExit('no room')", "exit code 1"), (KILLED, "SIGKILL"), ("", "")],
    ids=["with a reason", "killed", "well"],
)
def test_how_a_warm_up_failed_is_told_and_stops_nothing(warm, says, tmp_path, capfd, monkeypatch):
    (tmp_path / "server").mkdir()
    (tmp_path / "server/__init__.py").touch()
    (tmp_path / "server/__main__.py").write_text(warm)
    monkeypatch.chdir(tmp_path)  # there it is found before ours
    launcher._compile()
    said = capfd.readouterr().err
    assert ("`lightleash warm` ended by" in said) == bool(says)
    assert says in said
