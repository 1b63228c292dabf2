"""The HTTP side: what each request does, and which files of the web client are served."""

from __future__ import annotations

import json
import subprocess
from pathlib import Path
from threading import current_thread

import pytest
from starlette.testclient import TestClient

from pipeline.signals import Mode
from server.common.clock import now
from server.recording.writer import RecordingError
from server.web.app import Api
from server.web.page_files import CLIENT
from tests.server.house import control_status, house_in, is_request

BASE = "http://127.0.0.1:8080"


@pytest.fixture
def house(tmp_path):
    with house_in(tmp_path) as made:
        yield made


@pytest.fixture
def client(house):
    headers = {"Authorization": f"Bearer {house.doors.supervisor_token}"}
    return TestClient(house.app, base_url=BASE, headers=headers)


def test_every_file_a_page_needs_is_served_as_what_it_is(client):
    kinds = {".js": "text/javascript", ".css": "text/css", ".svg": "image/svg+xml"}
    files = [p for p in CLIENT.rglob("*") if p.suffix in kinds and "tests" not in p.parts]
    files = [p for p in files if "node_modules" not in p.parts]
    assert len(files) > 20
    for path in files:
        answer = client.get(f"/{path.relative_to(CLIENT)}", headers={"Authorization": ""})
        assert answer.status_code == 200, path
        assert answer.headers["content-type"].split(";")[0] == kinds[path.suffix]
        assert answer.content == path.read_bytes()


@pytest.mark.parametrize("path", ["/", "/supervisor"])
def test_pages_are_html_in_utf8(client, path):
    answer = client.get(path, headers={"Authorization": ""})
    assert answer.headers["content-type"] == "text/html; charset=utf-8"


@pytest.mark.parametrize(
    "path",
    [
        "/package.json",
        "/package-lock.json",
        "/tsconfig.json",
        "/tsconfig.tests.json",
        "/tests/fakes.js",
        "/node_modules/typescript/package.json",
        "/node_modules/typescript/lib/typescript.js",
        "/.npmrc",
        "/src/",
        "/src/../package.json",
        "/src/%2e%2e/tests/fakes.js",
        "/../server/web/app.py",
        "/src/..%2f..%2fserver%2fapp.py",
    ],
)
def test_nothing_else_of_its_folder_is_served(client, path):
    assert client.get(path).status_code == 404


@pytest.mark.parametrize("role", ["operator", "supervisor"])
def test_a_stop_reaches_control_from_either_role(house, client, role):
    token = {"operator": house.doors.operator_token, "supervisor": house.doors.supervisor_token}
    answer = client.post("/api/stop", headers={"Authorization": f"Bearer {token[role]}"})
    assert answer.status_code == 202
    assert any(map(is_request("stop"), house.control.inputs()))
    assert [event.text for event in house.manager.events] == [f"local program ({role}): stop"]


def test_a_stop_by_request_is_told_what_the_robot_does(house, client):
    assert client.post("/api/stop").json()["mode"] == "LOST"
    for mode in (Mode.TRACK, Mode.STOPPED):
        house.manager.status = control_status(mode=int(mode))
        house.manager.control_meter.tick(now(), now())
        assert client.post("/api/stop").json()["mode"] == mode.name


@pytest.mark.parametrize(
    ("body", "status"),
    [
        ('{"type":"command","what":"stop","age_ms":400}', 202),
        ('{"type":"command","what":"stop","age_ms":3600}', 409),
        ('{"type":"command","what":"stop","age_ms":0,"server_ms":0}', 409),
        ('{"type":"command","what":"arm"}', 400),
        ("stop!", 400),
    ],
)
def test_a_stop_that_was_held_back_for_too_long_does_not_end_anybodys_flight(
    house, client, body, status
):
    assert client.post("/api/stop", content=body).status_code == status
    assert any(map(is_request("stop"), house.control.inputs())) == (status == 202)


@pytest.mark.parametrize(
    ("role", "page"), [("operator", "/"), ("viewer", "/supervisor"), ("supervisor", "/supervisor")]
)
def test_the_invitation_holds_a_fresh_link_and_its_code(client, role, page):
    one, other = (client.post("/api/invite", json={"role": role}).json() for _ in range(2))
    assert one["url"].startswith(f"https://robot.lan:8443{page}#k=")
    assert one["here"].startswith(f"http://here{page}#k=")
    assert len(one["url"].partition("#k=")[2]) == 22
    assert one["url"] != other["url"]
    assert one["qr_svg"].startswith("<svg")


def test_health_is_told_to_everyone_with_a_code_that_machines_read(client, house):
    before = client.get("/healthz", headers={"Authorization": ""})
    assert before.status_code == 503
    reasons = ["The control process is starting: some seconds."]
    assert before.json() == {"ok": False, "reasons": reasons}
    house.manager.status = control_status()
    house.manager.control_meter.tick(now(), now())
    after = client.get("/healthz", headers={"Authorization": ""})
    assert (after.status_code, after.json()) == (200, {"ok": True, "reasons": []})


def test_the_certificate_of_our_authority_is_given_and_a_foreign_one_is_not(house, tmp_path):
    certificate = tmp_path / "ca.pem"
    certificate.write_text("PEM")
    own = Api(house.manager, certificate).routes()
    house.inner.router.routes[:0] = [r for r in own if getattr(r, "path", "") == "/ca.crt"]
    answer = TestClient(house.app, base_url=BASE).get("/ca.crt")
    assert answer.headers["content-type"] == "application/x-x509-ca-cert"
    assert answer.content == b"PEM"
    del house.inner.router.routes[0]
    assert TestClient(house.app, base_url=BASE).get("/ca.crt").status_code == 404


def test_the_status_is_there_for_terminals_and_machines(house, client):
    house.control.send(control_status())
    house.manager._receive_status()
    house.manager._tick()
    assert client.get("/api/status").json()["mode"] == "DISARMED"
    assert 'lightleash_mode{mode="DISARMED"} 1.0' in client.get("/metrics").text


def test_a_recording_is_started_named_and_ended(house, client):
    name = client.post("/api/recording").json()["name"]
    assert client.post("/api/recording").json()["name"] == name
    assert house.manager.recordings.name == name
    path = Path(client.delete("/api/recording").json()["path"])
    assert path.stat().st_size > 0
    assert client.delete("/api/recording").json() == {"path": ""}


def test_a_recording_is_ended_beside_the_loop_that_flies(house, client, monkeypatch):
    client.post("/api/recording")
    recorder, threads = house.manager.recordings._recorder, []
    close = recorder.close
    monkeypatch.setattr(recorder, "close", lambda: (threads.append(current_thread()), close()))
    monkeypatch.setattr(recorder, "dropped", 3)
    client.delete("/api/recording")
    assert threads[0].name.startswith("asyncio_")
    assert house.manager.events[0].text.endswith("; 3 items are missing, the disk was too slow.")


def test_a_recording_that_cannot_be_made_says_why(house, client, monkeypatch):
    def full() -> str:
        raise RecordingError(Path("disk"), "is full", "make room")

    monkeypatch.setattr(house.manager, "start_recording", full)
    answer = client.post("/api/recording")
    assert answer.status_code == 507
    assert answer.json()["allowed"] == "disk: is full; make room"


def test_a_virtual_phone_is_one_process_that_can_be_ended(house, client, monkeypatch):
    command = ["sleep", "60"]
    started: list[list[str]] = []
    popen = subprocess.Popen

    def stub(arguments, **options):
        started.append(arguments)
        return popen(command, **options)

    monkeypatch.setattr(subprocess, "Popen", stub)
    for _ in range(2):
        assert client.post("/api/virtual-phone").json() == {"running": True}
    assert len(started) == 1
    assert started[0][1:3] == ["-m", "server.virtual_phone.command"]
    client.delete("/api/virtual-phone")
    house.api.phone._process.wait(5.0)
    assert not house.api.phone.running


@pytest.mark.parametrize(
    "body", [b"", b"[]", b"{}", b'{"token": 1}', b"\xff", b'{"token": "\xff"}', b"[" * 4000]
)
def test_a_pairing_that_is_none_is_refused_by_name(client, body):
    headers = {"Origin": BASE, "X-Lightleash": "1", "Authorization": ""}
    answer = client.post("/api/pair", content=body, headers=headers)
    assert answer.status_code == 400
    assert answer.json()["field"] == "token"


@pytest.mark.parametrize(
    ("path", "body", "field", "allowed"),
    [
        ("invite", b'{"role": "boss"}', "role", '"operator" or "supervisor" or "viewer"'),
        ("invite", b'{"roles": "viewer"}', "roles", '{"role": '),
        ("people/confirm", b'{"code": "BCDF"}', "id", '{"id": "…", "code": "…"}'),
        ("people/lead", b'{"id": 7}', "id", '"id": '),
        ("pair", b'{"token": "x", "replace": 1}', "replace", '"replace": true or false'),
        ("people/deny", b'{"id": "' + bytes(5000), "body", "up to 4096 bytes"),
        ("stop", b'{"type": "command", "what": "arm"}', "command.what", "stop"),
        (
            "stop",
            b'{"type": "command", "what": "stop", "age_ms": -1}',
            "age_ms",
            '"age_ms": a number',
        ),
    ],
)
def test_a_body_that_cannot_be_taken_is_refused_by_its_field_and_what_it_may_be(
    house, client, path, body, field, allowed
):
    answer = client.post(f"/api/{path}", content=body)
    assert (answer.status_code, answer.json()["field"]) == (400, field)
    assert allowed in answer.json()["allowed"]
    assert not house.control.inputs()


@pytest.mark.parametrize("seconds", ["0", "-1", "61", "nan", "inf", "a minute", ""])
def test_a_link_is_judged_over_no_time_that_is_not_kept(client, seconds):
    answer = client.get(f"/api/link?seconds={seconds}")
    assert (answer.status_code, answer.json()["field"]) == (400, "seconds")


def test_a_link_is_judged_while_a_phone_leads(client):
    answer = client.get("/api/link?seconds=60")
    assert (answer.status_code, answer.json()["field"]) == (409, "phone")


@pytest.mark.parametrize("seconds", ["0", "-1", "301", "nan", "inf", "five", ""])
def test_a_phone_is_checked_over_no_time_that_is_not_kept(client, seconds):
    answer = client.get(f"/api/check?seconds={seconds}")
    assert (answer.status_code, answer.json()["field"]) == (400, "seconds")


def test_a_phone_is_checked_while_one_leads_and_nobody_can_change_a_check(client):
    answer = client.get("/api/check?seconds=300")
    assert (answer.status_code, answer.json()["field"]) == (409, "phone")
    for method in ("POST", "PUT", "DELETE"):
        assert client.request(method, "/api/check").status_code == 405


def test_every_refusal_is_json_that_names_what_is_allowed(client):
    for path in ("/api/status", "/metrics"):
        answer = client.get(path, headers={"Authorization": ""})
        assert set(json.loads(answer.content)) == {"code", "field", "allowed"}
