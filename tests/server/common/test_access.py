"""Where a server is: its run file says so, or tells what is wrong with it."""

import argparse
import json

import pytest

from server.common.access import (
    Access,
    PhoneClientError,
    access_of,
    add_access_arguments,
    running_server,
)
from server.common.runtime import RUN_FILE, runtime_directory
from server.common.runtime_parameters import RuntimeParameters

BAD_KNOBS = '{"http_url": "http://127.0.0.1:1", "operator_token": "t", "virtual_camera": {"x": 1}}'
KNOBS = {
    "cutoff_hz": 0.05,
    "mode": "selective",
    "adaptive_beta": 0.6,
    "max_speed_m_s": 0.0,
    "guard": False,
}


def test_run_file_tells_where_the_server_is(tmp_path):
    run = {"http_url": "http://127.0.0.1:8080", "https_url": "", "operator_token": "t", "pid": 1}
    (tmp_path / RUN_FILE).write_text(json.dumps(run | {"truth_port": 9000}))
    assert running_server(tmp_path) == Access("http://127.0.0.1:8080", "t", 9000)
    (tmp_path / RUN_FILE).write_text(json.dumps(run | {"robot": "quadrotor"}))
    assert running_server(tmp_path).robot == "quadrotor"
    (tmp_path / RUN_FILE).write_text(json.dumps(run | {"virtual_camera": KNOBS}))
    assert running_server(tmp_path).virtual_camera == RuntimeParameters(**KNOBS).config()


@pytest.mark.parametrize("text", ["", "[]", "{}", '{"http_url": 1', BAD_KNOBS])
def test_a_broken_run_file_is_named(tmp_path, text):
    (tmp_path / RUN_FILE).write_text(text)
    with pytest.raises(PhoneClientError, match=RUN_FILE):
        running_server(tmp_path)


@pytest.fixture
def here(monkeypatch, tmp_path):
    """Makes a server that runs here, by name."""
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(tmp_path))

    def make(name):
        directory = runtime_directory(name)
        directory.mkdir(parents=True, exist_ok=True)
        run = {"http_url": f"http://127.0.0.1/{name}", "operator_token": "t"}
        (directory / RUN_FILE).write_text(json.dumps(run))

    return make


def asked(*words):
    parser = argparse.ArgumentParser()
    add_access_arguments(parser)
    return access_of(parser.parse_args(words))


def test_a_name_leads_to_the_server_of_that_name(here):
    for name in ("", "left", "right"):
        here(name)
    assert asked().url == "http://127.0.0.1/"
    assert asked("--name", "left").url == "http://127.0.0.1/left"
    with pytest.raises(PhoneClientError, match="--name is of a server here"):
        asked("--name", "left", "--url", "http://x", "--token", "t")


def test_who_asks_for_a_server_that_is_not_there_reads_which_are(here):
    here("left")
    with pytest.raises(PhoneClientError, match=r"there is --name left$"):
        asked()
    here("")
    with pytest.raises(PhoneClientError, match=r"right; there is one without --name, --name left$"):
        asked("--name", "right")


def test_what_can_be_no_name_is_refused_with_what_can(capsys):
    with pytest.raises(SystemExit):
        asked("--name", "../left")
    assert "../left: allowed: up to 24 letters, digits and dashes" in capsys.readouterr().err


def test_no_run_file_says_how_to_start_a_server(tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(tmp_path))
    with pytest.raises(PhoneClientError, match="lightleash serve"):
        running_server(tmp_path)


@pytest.mark.parametrize(
    "url", ["gopher://x", "http://", "http://x:port", "http://x:99999", "http://x:0", "http://[x"]
)
def test_an_address_that_no_server_can_have_is_refused_before_it_is_asked(url):
    with pytest.raises(PhoneClientError, match=r"--url .*: allowed: http://HOST:PORT"):
        asked("--url", url, "--token", "t")
    assert asked("--url", "https://[::1]:8443", "--token", "t").url == "https://[::1]:8443"
