"""Every route and socket of the composed app, by every key and every origin, as one table says."""

from __future__ import annotations

import asyncio
from itertools import product
from typing import Any

import pytest
from fastapi import Depends
from fastapi.routing import APIRoute, APIWebSocketRoute
from starlette.requests import HTTPConnection
from starlette.responses import PlainTextResponse
from starlette.routing import Mount, Route, WebSocketRoute
from starlette.testclient import TestClient, WebSocketDenialResponse

from server.common.roles import is_enough
from server.diagnostics.link_log import KEPT_S
from server.security.least_role import (
    PUBLIC,
    PUBLIC_FILES,
    PUBLIC_FOLDER,
    LeastRole,
    RefusedRequest,
    operator,
    roles_of,
    supervisor,
    viewer,
)
from server.security.pairings import of_this_machine
from server.security.quotas import Quotas
from server.security.request_guard import Guard
from server.security.security import cookie_name
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
GET, POST, BOTH = ("GET",), ("POST",), ("DELETE", "POST")

TABLE = {
    **dict.fromkeys(("/", "/supervisor", "/board", "/screen", "/fleet", "/check"), (READ, ALL)),
    **dict.fromkeys(("/healthz", "/ca.crt"), (READ, ALL)),
    "/src": (READ, ALL),
    "/api/pair": (POST, ALL),
    "/api/whoami": (GET, OPERATOR),
    "/api/stop": (POST, OPERATOR),
    "/api/link": (GET, OPERATOR),
    "/api/check": (GET, VIEWER),
    "/api/fleet": (GET, VIEWER),
    "/api/rtc": (POST, OPERATOR),
    "/api/rtc/answer": (POST, OPERATOR),
    "/api/virtual-phone": (BOTH, SUPERVISOR),
    "/api/recording": (BOTH, SUPERVISOR),
    "/api/task": (POST, SUPERVISOR),
    "/api/episode": (POST, SUPERVISOR),
    "/api/invite": (POST, SUPERVISOR),
    "/api/people/confirm": (POST, SUPERVISOR),
    "/api/people/deny": (POST, SUPERVISOR),
    "/api/people/revoke": (POST, SUPERVISOR),
    "/api/people/lead": (POST, OPERATOR),
    "/api/people/keep": (POST, OPERATOR),
    "/api/status": (GET, VIEWER),
    "/api/openapi.json": (GET, SUPERVISOR),
    "/metrics": (GET, VIEWER),
    "/view": (GET, VIEWER),
    "/view/": (GET, VIEWER),
}
"""Path → methods, and who may."""
SOCKETS = {
    "/ws/phone": OPERATOR,
    "/ws/video": OPERATOR,
    "/ws/screen": VIEWER,
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
    quotas = Quotas(UNLIMITED)
    guard = Guard(reached, server.doors, ["127.0.0.1"], quotas=quotas, roles=server.roles)
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
            http[route.path] = tuple(sorted({*http.get(route.path, ()), *route.methods}))
    return http, sockets


def whose(path):
    return ALL if path.endswith((".css", ".svg")) else TABLE[path][1]


def key(rig, name):
    if name == "none":
        return {}
    if name == "forged":
        name = cookie_name(False, "127.0.0.1:8080")
        return {"Cookie": f"{name}=supervisor.x.{rig.doors.operator_token}"}
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


def test_every_route_declares_one_role_or_stands_on_the_short_list_of_public_ones(rig):
    for route in rig.app.routes:
        dependant = getattr(route, "dependant", None)
        calls = [one.call for one in dependant.dependencies] if dependant else []
        declared = [call for call in calls if isinstance(call, LeastRole)]
        is_file = route.path == PUBLIC_FOLDER or route.path.endswith(PUBLIC_FILES)
        assert len(declared) + (route.path in PUBLIC) + is_file == 1, route.path
    assert {route.path for route in rig.app.routes} >= PUBLIC, "nothing is listed that is not there"


async def nothing():
    """An endpoint."""


@pytest.mark.parametrize(
    "routes",
    [
        [APIRoute("/api/forgotten", nothing)],
        [APIWebSocketRoute("/ws/forgotten", nothing)],
        [Mount("/folder", PlainTextResponse("all of it"))],
        [Route("/plain", nothing)],
        [APIRoute("/healthz", nothing, dependencies=[Depends(viewer)])],
        [APIRoute("/api/two", nothing, dependencies=[Depends(viewer), Depends(operator)])],
        [
            APIRoute("/api/both", nothing, dependencies=[Depends(viewer)]),
            APIRoute("/api/both", nothing, methods=["POST"], dependencies=[Depends(operator)]),
        ],
    ],
)
def test_no_server_starts_with_a_route_that_says_not_clearly_whom_it_is_for(routes):
    with pytest.raises(ValueError, match="one role"):
        roles_of(routes)


@pytest.mark.parametrize("least", ["viewer", "operator", "supervisor"])
@pytest.mark.parametrize("role", [None, "viewer", "operator", "supervisor"])
def test_a_dependency_asks_for_its_role_whatever_the_guard_let_through(rig, role, least):
    member = of_this_machine(role) if role is not None else None
    connection = HTTPConnection({"type": "http", "member": member, "doors": rig.doors})
    asking = {"viewer": viewer, "operator": operator, "supervisor": supervisor}[least](connection)
    if role is not None and is_enough(role, least):
        assert asyncio.run(asking) is member
        return
    with pytest.raises(RefusedRequest) as refused:
        asyncio.run(asking)
    assert refused.value.status_code == (401 if role is None else 403)


@pytest.mark.parametrize("path", sorted(SOCKETS))
def test_a_socket_that_the_guard_forgot_is_refused_by_its_route(rig, path):
    async def unguarded(scope, receive, send):
        await rig.app({**scope, "member": None, "doors": rig.doors}, receive, send)

    with (
        pytest.raises(WebSocketDenialResponse) as refused,
        TestClient(unguarded).websocket_connect(f"ws://{HOST}{path}"),
    ):
        pass
    assert refused.value.status_code == 401
    assert refused.value.json()["field"] == "role"


def test_requests_and_answers_are_described_to_the_supervisor_alone(rig):
    def asked(role):
        client = TestClient(rig.guard, base_url=f"http://{HOST}")
        return client.get("/api/openapi.json", headers=key(rig, role))

    assert [asked(role).status_code for role in KEYS] == [401, 401, 403, 200]
    paths = asked("supervisor").json()["paths"]
    http, _ = routes_of(rig.app)
    described = {path for path in http if path.startswith("/api/")} | {"/metrics"}
    assert set(paths) == described
    invite = paths["/api/invite"]["post"]
    body = invite["requestBody"]["content"]["application/json"]["schema"]
    assert body["properties"]["role"]["enum"] == ["operator", "supervisor", "viewer"]
    answer = invite["responses"]["200"]["content"]["application/json"]["schema"]
    assert set(answer["required"]) >= {"url", "here", "qr_svg"}
    assert invite["security"] == [{"supervisor": []}]
    status = paths["/api/status"]["get"]["responses"]["200"]["content"]["application/json"]
    assert "streams" in status["schema"]["properties"]
    seconds = paths["/api/link"]["get"]["parameters"][0]["schema"]
    assert (seconds["exclusiveMinimum"], seconds["maximum"]) == (0.0, KEPT_S)


def test_there_is_no_public_description_and_no_page_that_asks_another_host(rig):
    client = TestClient(rig.guard, base_url=f"http://{HOST}", headers=key(rig, "supervisor"))
    for path in ("/docs", "/redoc", "/openapi.json", "/docs/oauth2-redirect"):
        assert client.get(path).status_code == 404


def test_nothing_is_told_to_a_collector_that_the_environment_names(monkeypatch, tmp_path):
    monkeypatch.setenv("FASTAPI_OTEL_AUTO_CONFIGURE", "true")
    monkeypatch.setenv("OTEL_EXPORTER_OTLP_ENDPOINT", "http://collector.example")
    server = LiveServer(tmp_path)
    wanted = dict.fromkeys(("tracing", "metrics", "logs", "auto_configure"), False)
    assert server.app._telemetry.items() >= wanted.items()
    server.close()
