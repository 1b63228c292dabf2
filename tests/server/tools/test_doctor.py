"""Doctor: says what is broken and what to do about it."""

from __future__ import annotations

import json
import os
import signal
import socket
from multiprocessing import active_children
from multiprocessing.queues import Queue

import pytest

from hardware import camera_file
from server.security import tls
from server.tools import doctor
from server.tools.doctor import BAD, GOOD, POOR, Finding


def test_every_codec_of_the_lock_file_works():
    found = list(doctor.codecs())
    assert len(found) == 3
    assert {finding.grade for finding in found} == {GOOD}


def test_a_port_in_use_is_told_with_a_way_out():
    with socket.create_server(("127.0.0.1", 0)) as used:
        (finding,) = doctor.ports([used.getsockname()])
    assert finding.grade == POOR
    assert "--https-port" in finding.advice


def test_a_port_whose_server_has_just_ended_is_free_as_it_is_for_the_next_one():
    """For a minute the system keeps what is left of its connections."""
    with socket.create_server(("127.0.0.1", 0)) as server:
        place = server.getsockname()
        with socket.create_connection(place) as page:
            server.accept()[0].close()
            assert page.recv(1) == b""
    (finding,) = doctor.ports([place])
    assert (finding.grade, finding.found) == (GOOD, "free")


def test_calibrations_are_listed_and_a_broken_one_is_named(tmp_path, monkeypatch):
    assert {finding.grade for finding in doctor.cameras()} == {GOOD}
    (tmp_path / "broken.yaml").write_text("image_width: [")
    monkeypatch.setattr(camera_file, "CAMERAS", tmp_path)
    (finding,) = doctor.cameras()
    assert finding.grade == BAD
    assert "broken.yaml" in finding.found


def test_what_gains_lack_is_told_of_the_chosen_robot_and_breaks_nothing(monkeypatch):
    (finding,) = doctor.gains()
    assert (finding.grade, finding.what) == (POOR, "gains phone of ames")
    assert "any mass ± 30 %" in finding.found
    assert "x, y: 25.3° of phase instead of 30°" in finding.advice
    monkeypatch.setenv("LIGHTLEASH_ROBOT", "ground")
    (finding,) = doctor.gains()
    assert (finding.grade, finding.advice) == (GOOD, "")
    monkeypatch.setenv("LIGHTLEASH_ROBOT", "twister")
    assert list(doctor.gains()) == []


@pytest.mark.parametrize(
    ("name", "value", "says"),
    [("ROBOT", "amse", "did you mean"), ("GAINS", "sport", "phone, paper")],
)
def test_a_robot_or_gains_that_there_are_not_are_named(name, value, says, monkeypatch):
    monkeypatch.setenv(f"LIGHTLEASH_{name}", value)
    (finding,) = doctor.gains()
    assert finding.grade == BAD
    assert says in finding.found


def test_a_state_directory_that_cannot_be_written_is_told(monkeypatch):
    def denied(*_):
        raise PermissionError("no")

    monkeypatch.setattr(tls, "certificate", denied)
    (finding,) = doctor.certificates()
    assert finding.grade == BAD
    assert "writable" in finding.advice


def test_the_certificate_is_the_one_of_the_server_that_is_set_up(tmp_path, monkeypatch):
    """Its fingerprint is compared with what a phone shows."""
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / "else"))
    monkeypatch.setenv("LIGHTLEASH_STATE", str(tmp_path / "state"))
    served = tls.fingerprint(tls.certificate(tmp_path / "state").authority)
    made, shown = doctor.certificates()
    assert str(tmp_path / "state") in made.found
    assert shown.found == f"SHA-256 {served}"
    assert not (tmp_path / "else").exists()


@pytest.mark.parametrize(("grade", "code"), [(GOOD, 0), (POOR, 0), (BAD, 1)])
def test_only_what_is_broken_fails(monkeypatch, capsys, grade, code):
    for name in ("machine", "certificates", "codecs", "cameras", "gains"):
        monkeypatch.setattr(doctor, name, lambda: iter(()))
    monkeypatch.setattr(doctor, "ports", lambda _: iter(()))
    finding = Finding(grade, "thing", "state", "do this")
    monkeypatch.setattr(doctor, "realtime", lambda _: iter([finding]))
    assert doctor.main([]) == code
    printed = capsys.readouterr().out
    assert f"[{grade}] thing: state" in printed
    assert "do this" in printed


@pytest.mark.slow
def test_the_schedule_is_measured_in_a_process_of_its_own():
    granted, held = doctor.realtime(0.2)
    assert granted.what == "real time"
    assert "p999" in held.found


def test_a_report_for_others_holds_the_same_and_the_machine(monkeypatch, capsys):
    for check in ("machine", "certificates", "codecs", "cameras", "gains"):
        monkeypatch.setattr(doctor, check, lambda: iter(()))
    monkeypatch.setattr(doctor, "ports", lambda wanted: iter((Finding(BAD, "port 1", "taken"),)))
    monkeypatch.setattr(doctor, "realtime", lambda seconds: iter((Finding(POOR, "time", "ü"),)))
    assert doctor.main(["--json"]) == 1
    told = json.loads(capsys.readouterr().out)
    assert [(one["grade"], one["what"]) for one in told["findings"]] == [
        ("poor", "time"),
        ("broken", "port 1"),
    ]
    assert told["system"]["machine"]
    with pytest.raises(SystemExit):
        doctor.main(["--json", "--phone"])


@pytest.mark.slow
def test_an_interruption_is_heard_by_doctor_alone_and_leaves_no_process(monkeypatch):
    survived = []

    def interrupted(_queue, timeout):
        (child,) = active_children()
        os.kill(child.pid, signal.SIGINT)  # a terminal's reaches both
        child.join(0.5)
        survived.append(child.is_alive())
        raise KeyboardInterrupt

    monkeypatch.setattr(Queue, "get", interrupted)
    with pytest.raises(KeyboardInterrupt):
        next(doctor.realtime(60.0))
    assert survived == [True]
    assert active_children() == []
