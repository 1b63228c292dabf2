"""Every route and socket of the composed app, by every key and every origin, as one table says."""

from __future__ import annotations

from itertools import product
from typing import Any

import pytest
from starlette.responses import PlainTextResponse
from starlette.routing import Mount, Route, WebSocketRoute
from starlette.testclient import TestClient, WebSocketDenialResponse

from server.security.quotas import Quotas
from server.security.request_guard import Guard
from server.security.security import COOKIE
from tests.server.live_server import UNLIMITED, LiveServer

HOST = "127.0.0.1:8080"
REACHED = 299
KEYS = ("none", "forged", "operator", "supervisor")
ALL, READ = "everybody", ("GET", "HEAD")
VIEWER, OPERATOR, SUPERVISOR = "viewers", "operators", "supervisors"
MAY = {
    ALL: set(KEYS),
    VIEWER: {"operator", "supervisor"},
    OPERATOR: {"operator", "supervisor"},
    SUPERVISOR: {"supervisor"},
}
POST, BOTH = ("POST",), ("DELETE", "POST")

TABLE = {
    **dict.fromkeys(("/", "/supervisor", "/board", "/healthz", "/ca.crt"), (READ, ALL)),
    "/src": (READ, ALL),
    "/api/pair": (POST, ALL),
    "/api/whoami": (READ, OPERATOR),
    "/api/stop": (POST, OPERATOR),
    "/api/link": (READ, OPERATOR),
    "/api/rtc": (POST, OPERATOR),
    "/api/rtc/answer": (POST, OPERATOR),
    "/api/virtual-phone": (BOTH, SUPERVISOR),
    "/api/recording": (BOTH, SUPERVISOR),
    "/api/invite": (POST, SUPERVISOR),
    "/api/people/confirm": (POST, SUPERVISOR),
    "/api/people/deny": (POST, SUPERVISOR),
    "/api/people/revoke": (POST, SUPERVISOR),
    "/api/people/lead": (POST, OPERATOR),
    "/api/people/keep": (POST, OPERATOR),
    "/api/status": (READ, VIEWER),
    "/metrics": (READ, VIEWER),
    "/view": (READ, VIEWER),
    "/view/": (READ, VIEWER),
}
"""Path → methods, and who may."""
SOCKETS = {
    "/ws/phone": OPERATOR,
    "/ws/video": OPERATOR,
    "/ws/supervisor": VIEWER,
    "/view": VIEWER,
    "/view/": VIEWER,
}
ORIGINS = {
    "own": {"Origin": f"http://{HOST}", "X-Lightleash": "1"},
    "foreign": {"Origin": "https://evil.example", "X-Lightleash": "1"},
    "another port": {"Origin": "http://127.0.0.1:8081", "X-Lightleash": "1"},
    "null": {"Origin": "null", "X-Lightleash": "1"},
    "none": {"X-Lightleash": "1"},
}
HOSTS = {"own": HOST, "rebound": "evil.example:8080", "empty": ""}
SITES = [*product(ORIGINS, ["own"]), *product(["own"], HOSTS)]


async def reached(scope, receive, send):
    """The app behind the guard: nothing that a test lets through does anything."""
    if scope["type"] == "websocket":
        await send({"type": "websocket.accept"})
        await send({"type": "websocket.close", "code": 1000})
        return
    await PlainTextResponse("reached", REACHED)(scope, receive, send)


@pytest.fixture(scope="module")
def rig(tmp_path_factory):
    server: Any = LiveServer(tmp_path_factory.mktemp("routes"))
    guard = Guard(reached, server.doors, ["127.0.0.1"], quotas=Quotas(UNLIMITED))
    server.client = TestClient(guard, base_url=f"http://{HOST}", client=("127.0.0.1", 5000))
    yield server
    server.close()


def routes_of(app):
    """(http: path → methods, sockets: paths) of an app and all that is mounted in it."""
    http, sockets = {}, set()
    for route in app.routes:
        if isinstance(route, Mount):
            inner = getattr(route.app, "routes", None)
            assert not inner, f"{route.path}: mounted routes have to be walked, too"
            http[route.path] = READ
        elif isinstance(route, WebSocketRoute):
            sockets.add(route.path)
        else:
            assert isinstance(route, Route), f"{route}: of a kind that this test does not know"
            http[route.path] = tuple(sorted(route.methods))  # type: ignore[assignment]
    return http, sockets


def whose(path):
    return ALL if path.endswith((".css", ".svg")) else TABLE[path][1]


def key(rig, name):
    if name == "none":
        return {}
    if name == "forged":
        return {"Cookie": f"{COOKIE}=supervisor.x.{rig.doors.operator_token}"}
    return {"Authorization": f"Bearer {rig.token(name)}"}


def wanted(who, name, is_change, origin, host):
    """The status that the one table means."""
    if host != "own":
        return 421
    is_program = name in ("operator", "supervisor")  # no page of another site can set its header
    if is_change and origin != "own" and not is_program:
        return 403
    if name in MAY[who]:
        return REACHED
    return 401 if name in ("none", "forged") else 403


def test_the_table_has_every_route_and_no_other(rig):
    http, sockets = routes_of(rig.app)
    files = {path for path in http if path.endswith((".css", ".svg"))}
    assert {path: methods for path, methods in http.items() if path not in files} == {
        path: methods for path, (methods, _) in TABLE.items()
    }
    assert sockets == set(SOCKETS)


@pytest.mark.parametrize("name", KEYS)
def test_every_route_answers_as_the_table_says(rig, name):
    headers = key(rig, name)
    http, _ = routes_of(rig.app)
    for path, method, (origin, host) in product(http, ("GET", "POST", "DELETE", "PUT"), SITES):
        if method not in http[path] and method != "PUT":
            continue
        asked = headers | ORIGINS[origin] | {"Host": HOSTS[host]}
        where = "/src/app/main.js" if path == "/src" else path
        answer = rig.client.request(method, where, headers=asked)
        who = whose(path)
        if method == "PUT" and where.endswith((".js", ".css", ".svg")):
            who = SUPERVISOR  # files are public to read, not to write
        expected = wanted(who, name, method != "GET", origin, host)
        assert answer.status_code == expected, (method, where, name, origin, host)


@pytest.mark.parametrize("name", KEYS)
def test_every_socket_answers_as_the_table_says(rig, name):
    headers = key(rig, name)
    _, sockets = routes_of(rig.app)
    for path, (origin, host) in product(sockets, SITES):
        asked = headers | ORIGINS[origin] | {"Host": HOSTS[host]}
        try:
            with rig.client.websocket_connect(f"ws://{HOST}{path}", headers=asked):
                status = REACHED
        except WebSocketDenialResponse as refused:
            status = refused.status_code
        expected = wanted(SOCKETS[path], name, True, origin, host)
        assert status == expected, (path, name, origin, host)


def test_a_path_that_is_no_route_asks_for_a_role_before_it_is_missed(rig):
    for path in ("/api/nothing", "/.env", "/src/../server/security/tls.py", "/API/status"):
        assert rig.client.get(path).status_code in (401, 404)
