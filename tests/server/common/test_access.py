"""Where a server is: its run file says so, or tells what is wrong with it."""

import json

import pytest

from server.common.access import Access, PhoneClientError, running_server
from server.common.runtime import RUN_FILE
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


def test_no_run_file_says_how_to_start_a_server(tmp_path):
    with pytest.raises(PhoneClientError, match="lightleash serve"):
        running_server(tmp_path)
