"""Who may come in: every route, every origin, every forged credential."""

from __future__ import annotations

import asyncio
import re

import pytest
from starlette.requests import Request
from starlette.routing import Mount, Route, WebSocketRoute
from starlette.testclient import TestClient, WebSocketDenialResponse

from server import app
from server.security import COOKIE, PAIR_TRIES, PUBLIC_PATHS, Doors, Guard
from tests.server.live_server import LiveServer

BASE = "http://127.0.0.1:8080"
WS = "ws://127.0.0.1:8080"
OWN = {"Origin": BASE, "X-Lightleash": "1"}
METHODS = ("GET", "HEAD", "POST", "PUT", "DELETE", "PATCH", "OPTIONS")
STYLES = ("style", "phone", "supervisor", "calibration", "lens", "board")
PICTURES = ("icon", "lead", "board")
FILES = {*(f"/{name}.css" for name in STYLES), *(f"/{name}.svg" for name in PICTURES)}


@pytest.fixture
def rig(tmp_path):
    server = LiveServer(tmp_path)
    server.client = TestClient(server.guard, base_url=BASE, client=("127.0.0.1", 50_000))
    yield server
    server.close()


def bearer(rig, role):
    return {"Authorization": f"Bearer {rig.token(role)}"}


def pair(rig, role, **headers):
    return rig.client.post("/api/pair", json={"token": rig.token(role)}, headers=OWN | headers)


def refused_socket(rig, path, headers):
    with (
        pytest.raises(WebSocketDenialResponse) as refusal,
        rig.client.websocket_connect(WS + path, headers=dict(headers)),
    ):
        pass
    return refusal.value.status_code


def http_paths(rig):
    return [route.path for route in rig.app.routes if isinstance(route, Route)]


def socket_paths(rig):
    return [route.path for route in rig.app.routes if isinstance(route, WebSocketRoute)]


def test_nothing_but_pages_their_files_and_pairing_opens_without_a_role(rig):
    opened = {
        (method, path)
        for path in http_paths(rig)
        for method in METHODS
        if rig.client.request(method, path, headers=OWN).status_code not in (401, 403, 404, 405)
    }
    public = {"/", "/supervisor", "/board", "/healthz", *FILES}
    readable = {(method, path) for path in public for method in ("GET", "HEAD")}
    assert opened == readable | {("POST", "/api/pair")}  # which answers 400: no token


def test_every_route_is_known_to_this_test(rig):
    mounts = [route.path for route in rig.app.routes if isinstance(route, Mount)]
    assert mounts == ["/src"]
    assert set(socket_paths(rig)) >= {"/ws/phone", "/ws/video", "/ws/supervisor", "/view", "/view/"}
    assert set(http_paths(rig)) >= PUBLIC_PATHS | FILES


def test_every_websocket_asks_for_a_role(rig):
    assert [refused_socket(rig, path, OWN) for path in socket_paths(rig)] == [401] * 5


@pytest.mark.parametrize("path", ["/src/main.js", "/src/dashboard/main.js", "/style.css"])
def test_scripts_and_styles_of_the_pages_are_public(rig, path):
    assert rig.client.get(path).status_code == 200


@pytest.mark.parametrize(
    "path",
    [
        "/package.json",
        "/node_modules/typescript/lib/tsc.js",
        "/tests/session.test.js",
        "/src/",
        "/src/../package.json",
        "/src/%2e%2e/package.json",
        "/src/..%2fpackage.json",
        "/api/status.js",
        "/metrics/.css",
    ],
)
def test_nothing_else_of_the_disk_is_served(rig, path):
    assert rig.client.get(path).status_code in (401, 404)
    assert rig.client.get(path, headers=bearer(rig, "supervisor")).status_code == 404


@pytest.mark.parametrize("path", ["/api/status", "/metrics", "/api/invite", "/view/"])
def test_an_operator_does_not_reach_what_is_the_supervisors(rig, path):
    assert rig.client.get(path, headers=bearer(rig, "operator")).status_code == 403
    assert rig.client.get(path, headers=bearer(rig, "supervisor")).status_code == 200


def test_an_operator_can_neither_record_nor_start_phones_nor_watch(rig):
    headers = OWN | bearer(rig, "operator")
    for path in ("/api/recording", "/api/virtual-phone"):
        for method in ("POST", "DELETE"):
            assert rig.client.request(method, path, headers=headers).status_code == 403
    assert refused_socket(rig, "/ws/supervisor", headers) == 403
    assert refused_socket(rig, "/view", headers) == 403


FOREIGN = [
    {"Origin": "https://evil.example", "X-Lightleash": "1"},
    {"Origin": "null", "X-Lightleash": "1"},
    {"Origin": BASE + "0", "X-Lightleash": "1"},
    {"Origin": BASE.replace("http:", "https:"), "X-Lightleash": "1"},
    {"Origin": BASE + ".evil.example", "X-Lightleash": "1"},
    {"X-Lightleash": "1"},
]


@pytest.mark.parametrize("foreign", FOREIGN, ids=lambda headers: headers.get("Origin", "none"))
def test_a_foreign_page_with_our_cookie_changes_nothing(rig, foreign):
    assert pair(rig, "supervisor").status_code == 200
    for path in ("/api/stop", "/api/recording", "/api/virtual-phone", "/api/pair"):
        assert rig.client.post(path, headers=foreign).status_code == 403
    for path in socket_paths(rig):
        assert refused_socket(rig, path, foreign) == 403


def test_our_own_page_must_set_the_header_that_forms_can_not_set(rig):
    pair(rig, "supervisor")
    assert rig.client.post("/api/stop", headers={"Origin": BASE}).status_code == 403
    assert rig.client.post("/api/stop", headers=OWN).status_code == 202


@pytest.mark.parametrize(
    "host", ["evil.example", "127.0.0.1.evil.example", "127.0.0.2:8080", "", "[::2]:8080", "::1"]
)
def test_another_name_for_this_server_is_misdirected(rig, host):
    headers = bearer(rig, "supervisor") | {"Host": host}
    assert rig.client.get("/", headers=headers).status_code == 421
    assert refused_socket(rig, "/ws/phone", headers) == 421


@pytest.mark.parametrize(
    "host", ["robot.lan", "ROBOT.LAN:8080", "127.0.0.1", "[::1]", "[::1]:8443", "robot.lan:8443"]
)
def test_every_name_of_our_own_is_answered(rig, host):
    assert rig.client.get("/", headers={"Host": host}).status_code == 200


def test_pairing_gives_a_cookie_that_scripts_and_other_sites_do_not_get(rig):
    response = pair(rig, "operator")
    assert response.json() == {"role": "operator"}
    cookie = response.headers["set-cookie"].lower()
    assert "httponly" in cookie
    assert "samesite=strict" in cookie
    assert rig.client.get("/api/whoami").json() == {"role": "operator"}


def test_over_tls_the_cookie_is_for_this_host_and_tls_alone(rig):
    client = TestClient(rig.guard, base_url="https://robot.lan")
    own = {"Origin": "https://robot.lan", "X-Lightleash": "1"}
    response = client.post("/api/pair", json={"token": rig.token("operator")}, headers=own)
    cookie = response.headers["set-cookie"]
    assert cookie.startswith(f"__Host-{COOKIE}=")
    assert "Secure" in cookie
    assert "Path=/" in cookie
    assert client.get("/api/whoami").json() == {"role": "operator"}


def test_cookies_of_other_programs_on_this_host_do_not_hide_ours(rig):
    value = rig.doors.pair(rig.token("operator"))[1]
    others = 'theme={"a": [1, "x"]}; =; ;; broken"; ' + f"{COOKIE}={value}; z=1"
    assert rig.client.get("/api/whoami", headers={"Cookie": others}).status_code == 200


def test_a_body_that_never_comes_does_not_hold_its_connection(monkeypatch):
    monkeypatch.setattr(app, "BODY_S", 0.01)

    async def never():
        await asyncio.Event().wait()

    request = Request({"type": "http", "method": "POST", "headers": []}, receive=never)
    assert asyncio.run(app.body_of(request)) == b""


def test_a_token_of_half_a_character_is_simply_wrong(rig):
    response = rig.client.post("/api/pair", content=rb'{"token": "\ud800"}', headers=OWN)
    assert response.status_code in (400, 401)


def test_tokens_can_not_be_tried_out(rig):
    wrong = {"json": {"token": "x"}, "headers": OWN}
    codes = [rig.client.post("/api/pair", **wrong).status_code for _ in range(PAIR_TRIES + 2)]
    assert codes == [401] * PAIR_TRIES + [429] * 2


def test_pages_forbid_what_they_do_not_need(rig):
    for path in ("/", "/supervisor", "/src/main.js", "/healthz"):
        headers = rig.client.get(path).headers
        policy = headers["content-security-policy"]
        assert "default-src 'none'" in policy
        assert "unsafe" not in policy
        assert re.search(r"connect-src 'self' ws://127\.0\.0\.1:8080;", policy)
        assert "frame-ancestors 'none'" in policy
        assert headers["x-content-type-options"] == "nosniff"
        assert headers["referrer-policy"] == "no-referrer"
        assert "camera=(self)" in headers["permissions-policy"]


def test_the_3d_view_has_a_policy_of_its_own_and_only_that(rig):
    headers = rig.client.get("/view/", headers=bearer(rig, "supervisor")).headers
    policies = headers.get_list("content-security-policy")
    assert len(policies) == 1
    assert "wasm-unsafe-eval" in policies[0]


def test_a_guard_refuses_before_the_app_is_asked():
    asked = []

    async def app(scope, receive, send):
        asked.append(scope["path"])

    client = TestClient(Guard(app, Doors(), ["127.0.0.1"]), base_url=BASE)
    assert client.get("/anything").status_code == 401
    assert client.post("/api/pair").status_code == 403
    assert asked == []
