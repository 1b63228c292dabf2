"""Settings: four places, one model, clear words."""

from __future__ import annotations

import os
import tomllib

import pytest

from pipeline.config import VirtualCameraConfig
from server.common.runtime_parameters import RuntimeParameters
from server.common.settings import (
    PREFIX,
    Settings,
    SettingsError,
    VideoSettings,
    load,
    state_directory,
)


@pytest.fixture(autouse=True)
def own_environment(monkeypatch):
    for name in [name for name in os.environ if name.startswith(PREFIX)]:
        monkeypatch.delenv(name)


def toml(tmp_path, text):
    path = tmp_path / "settings.toml"
    path.write_text(text)
    return path


def test_the_command_line_beats_the_environment_beats_the_file_beats_the_defaults(
    tmp_path, monkeypatch
):
    file = toml(tmp_path, "https_port = 1\nhttp_port = 1\nrobot_port = 1\nsimulate = false")
    monkeypatch.setenv("LIGHTLEASH_HTTPS_PORT", "2")
    monkeypatch.setenv("LIGHTLEASH_HTTP_PORT", "2")
    settings = load(["--https-port", "3"], file)
    ports = (settings.https_port, settings.http_port, settings.robot_port)
    assert ports == (3, 2, 1)
    assert settings.robot == "ames"


def test_the_picture_is_a_table_of_its_own_everywhere(tmp_path, monkeypatch):
    file = toml(tmp_path, "[video]\nwidth = 640\nheight = 480\nframe_rate_hz = 24")
    monkeypatch.setenv("LIGHTLEASH_VIDEO__HEIGHT", "360")
    video = load(["--video.frame-rate-hz", "20"], file).video
    assert (video.width, video.height, video.frame_rate_hz) == (640, 360, 20)


def test_the_virtual_camera_defaults_to_the_pipelines():
    assert load([]).virtual_camera.knobs == RuntimeParameters.of(VirtualCameraConfig())


def test_the_virtual_camera_is_a_table_of_its_own(tmp_path, monkeypatch):
    file = toml(tmp_path, '[virtual_camera]\ncutoff_hz = 0.05\nmode = "selective"')
    monkeypatch.setenv("LIGHTLEASH_VIRTUAL_CAMERA__MAX_SPEED_M_S", "0.5")
    knobs = load(["--virtual-camera.adaptive-beta", "0.6"], file).virtual_camera.knobs
    assert knobs == RuntimeParameters(0.05, "selective", 0.6, 0.5, guard=True)
    assert not load(["--no-virtual-camera.guard"]).virtual_camera.guard


def test_what_recordings_may_take_is_a_table_of_its_own_and_without_it_none_goes(monkeypatch):
    monkeypatch.setenv("LIGHTLEASH_RECORDING__RESERVE_GIB", "2")
    recording = load(["--recording.budget-gib", "20"]).recording
    assert (recording.budget_gib, recording.reserve_gib) == (20.0, 2.0)
    assert load([]).recording.budget_gib == 0.0


def test_lists_grow_with_each_mention():
    settings = load(["--names", "robot.lan", "--names", "lab.lan", "--cameras", "/a"])
    assert settings.names == ["robot.lan", "lab.lan"]
    assert [str(path) for path in settings.cameras] == ["/a"]


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("https_prot = 1", ["https_prot", "https_port"]),
        ("[video]\nwidht = 640", ["video.widht", "video.width"]),
        ("qqq = 1", ["qqq", "https_port", "video.width"]),
        ("https_port = 70000", ["https_port", "65535", "70000"]),
        ("[recording]\nreserve_gib = 0.1", ["recording.reserve_gib", "0.25"]),
        ("[recording]\nbudget_gib = -1", ["recording.budget_gib", "0"]),
        ("[virtual_camera]\ncutoff_hz = nan", ["virtual_camera.cutoff_hz"]),
        ("[virtual_camera]\ncutoff_hz = 9.0", ["virtual_camera.cutoff_hz", "9.0"]),
        ("[virtual_camera]\nmax_speed_m_s = inf", ["virtual_camera.max_speed_m_s"]),
        ('[virtual_camera]\nmode = "some"', ["virtual_camera.mode", "selective", "some"]),
        ("[virtual_camera]\ncutof = 1.0", ["virtual_camera.cutof", "virtual_camera.cutoff_hz"]),
        ('video = "big"', ["video"]),
        ("https_port = ", ["settings.toml"]),
        ('cert = "/c.pem"', ["cert", "key"]),
        ('robot_host = "1.2.3.4"', ["robot_host", "--no-simulate"]),
        ('[rtc]\nturn_url = "turn:[2001:db8::1]:3478"', ["rtc.turn_url"]),
        ('[rtc]\nturn_url = "turn:relay:port"', ["rtc.turn_url"]),
        ('name = "left arm"', ["name: allowed: up to 24 letters", "not 'left arm'"]),
        ("simulate = false\nsimulated.battery_v = 12", ["simulated", "--no-simulate"]),
    ],
)
def test_what_can_not_be_used_is_named_with_what_is_allowed(tmp_path, text, words):
    with pytest.raises(SettingsError) as refusal:
        load([], toml(tmp_path, text))
    assert [word for word in words if word not in str(refusal.value)] == []


def test_what_is_a_named_servers_own_lies_apart_and_the_rest_is_shared(tmp_path, monkeypatch):
    unnamed = load(["--state", str(tmp_path)])
    assert unnamed.own_state == unnamed.state == tmp_path
    monkeypatch.setenv("LIGHTLEASH_NAME", "right")
    assert load(["--state", str(tmp_path)]).own_state == tmp_path / "servers" / "right"
    left = load(["--state", str(tmp_path), "--name", "left"])
    assert (left.state, left.own_state) == (tmp_path, tmp_path / "servers" / "left")


def test_a_misspelt_variable_is_not_ignored(monkeypatch):
    monkeypatch.setenv("LIGHTLEASH_HTTPS_PROT", "1")
    with pytest.raises(SettingsError, match="LIGHTLEASH_HTTPS_PORT"):
        load([])


def test_a_file_that_is_not_there_is_named(tmp_path):
    with pytest.raises(SettingsError, match="nowhere"):
        load([], tmp_path / "nowhere.toml")


def test_an_unknown_option_ends_with_the_usage(capsys):
    with pytest.raises(SystemExit) as ending:
        load(["--prot", "1"])
    assert ending.value.code == 2
    assert "usage: lightleash serve" in capsys.readouterr().err


def test_help_tells_every_setting_and_the_other_places(capsys):
    with pytest.raises(SystemExit):
        load(["--help"])
    said = capsys.readouterr().out
    for name in Settings.model_fields:
        assert f"--{name.replace('_', '-')}" in said
    for name in VideoSettings.model_fields:
        assert f"--video.{name.replace('_', '-')}" in said
    assert "--config FILE" in said
    assert PREFIX in said


def test_names_say_their_units():
    numbers = {
        name
        for model in (Settings, VideoSettings)
        for name, field in model.model_fields.items()
        if field.annotation in (int, float)
    }
    units = ("_s", "_hz", "_bps", "_port", "width", "height")
    assert [name for name in numbers if not name.endswith(units)] == []


def test_settings_survive_being_written_and_read(tmp_path):
    settings = load(["--https-port", "0", "--video.width", "640"])
    assert Settings.model_validate_json(settings.model_dump_json()) == settings
    assert tomllib.loads("https_port = 0")["https_port"] == settings.https_port


def test_state_is_where_the_user_keeps_state(monkeypatch, tmp_path):
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path))
    assert load([]).state == state_directory() == tmp_path / "lightleash"
