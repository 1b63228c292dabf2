"""Who may come in: every route, every origin, every forged credential."""

from __future__ import annotations

import asyncio
import json
import re
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import pytest
from starlette.requests import Request
from starlette.routing import Mount, Route, WebSocketRoute
from starlette.testclient import TestClient, WebSocketDenialResponse

from server.common.clock import now
from server.common.roles import RANKS, is_enough
from server.security.audit import STRANGERS_FILE, Audit
from server.security.least_role import RefusedRequest
from server.security.quotas import Quotas
from server.security.request_guard import Guard
from server.security.security import PAIR_TRIES, Doors, cookie_name
from server.web import typed_routes
from tests.server.live_server import UNLIMITED, LiveServer

BASE = "http://127.0.0.1:8080"
WS = "ws://127.0.0.1:8080"
COOKIE = cookie_name(False, "127.0.0.1:8080")
OWN = {"Origin": BASE, "X-Lightleash": "1"}
METHODS = ("GET", "HEAD", "POST", "PUT", "DELETE", "PATCH", "OPTIONS")
STYLES = (
    *("style", "phone", "supervisor", "calibration", "lens", "board"),
    *("people", "screen", "link", "sight", "trust", "fleet", "check", "dark", "tool"),
)
PICTURES = ("icon", "lead", "board")
FILES = {*(f"/{name}.css" for name in STYLES), *(f"/{name}.svg" for name in PICTURES)}


@pytest.fixture
def rig(tmp_path):
    server: Any = LiveServer(tmp_path, Quotas(UNLIMITED))
    server.client = TestClient(server.guard, base_url=BASE, client=("127.0.0.1", 50_000))
    yield server
    server.close()


def bearer(rig, role):
    return {"Authorization": f"Bearer {rig.token(role)}"}


def pair(rig, role, client=None, name=""):
    """Exchange a fresh link, as a page does."""
    key = rig.doors.pairings.invite(role, now())
    asked = {"token": key, "name": name}
    return (client or rig.client).post("/api/pair", json=asked, headers=OWN)


def confirm(rig):
    """Let in whoever waits, as a supervisor's page does."""
    waiting = [one for one in rig.manager.people.present() if one.state == "waiting"]
    for one in waiting:
        body = {"id": one.id, "code": one.code}
        answer = rig.client.post(
            "/api/people/confirm", json=body, headers=bearer(rig, "supervisor")
        )
        assert answer.status_code == 200
    return [one.id for one in waiting]


def member(rig, role):
    """A browser that is in."""
    client = TestClient(rig.guard, base_url=BASE, headers=OWN)
    assert pair(rig, role, client).status_code == 200
    confirm(rig)
    assert client.get("/api/whoami").json()["state"] == "in"
    return client


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
    public = {"/", "/supervisor", "/board", "/screen", "/fleet", "/check", "/healthz", *FILES}
    readable = {(method, path) for path in public for method in ("GET", "HEAD")}
    assert opened == readable | {("POST", "/api/pair")}  # which answers 400: no link


def test_every_route_is_known_to_this_test(rig):
    mounts = [route.path for route in rig.app.routes if isinstance(route, Mount)]
    assert mounts == ["/src"]
    assert set(socket_paths(rig)) >= {"/ws/phone", "/ws/video", "/ws/supervisor", "/view", "/view/"}
    assert {*http_paths(rig), *socket_paths(rig)} == set(rig.roles.least) | FILES


def test_every_websocket_asks_for_a_role(rig):
    assert [refused_socket(rig, path, OWN) for path in socket_paths(rig)] == [401] * 6


@pytest.mark.parametrize("path", ["/src/app/main.js", "/src/dashboard/main.js", "/style.css"])
def test_scripts_and_styles_of_the_pages_are_public(rig, path):
    assert rig.client.get(path).status_code == 200


@pytest.mark.parametrize(
    "path",
    [
        "/package.json",
        "/node_modules/typescript/lib/tsc.js",
        "/tests/ui/session.test.js",
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


def every_request(rig):
    """(method, path) of each route that asks for a role."""
    for route in rig.app.routes:
        if isinstance(route, (Route, WebSocketRoute)) and route.path in rig.roles.least:
            is_socket = isinstance(route, WebSocketRoute)
            for method in ["socket"] if is_socket else sorted(set(route.methods) - {"HEAD"}):
                yield method, route.path


def open_to_all(rig):
    """Paths that take no role."""
    return {path for path, least in rig.roles.least.items() if RANKS[least] < RANKS["viewer"]}


def turned_away(client, method, path):
    """The guard's own refusal of a browser: status and field; None if it was let through."""
    try:
        if method == "socket":
            with client.websocket_connect(WS + path, headers=OWN):
                return None
        answer = client.request(method, path, headers=OWN)
    except WebSocketDenialResponse as denied:
        answer = denied
    told = answer.json() if "json" in answer.headers.get("content-type", "") else {}
    is_guards = answer.status_code in (401, 403) and told.get("field") in ("role", "pairing")
    return (answer.status_code, told["field"]) if is_guards else None


@pytest.fixture
def quiet(rig, monkeypatch):
    """Neither the virtual phone nor a recording is started."""
    monkeypatch.setattr(rig.api.phone, "start", lambda: None)
    monkeypatch.setattr(rig.manager, "start_recording", lambda: "none")
    return rig


@pytest.mark.parametrize("role", ["viewer", "operator", "supervisor"])
def test_each_role_reaches_what_it_may_and_nothing_else_on_every_route_and_socket(quiet, role):
    client = member(quiet, role)
    wrong = []
    for method, path in every_request(quiet):
        least = quiet.roles.least[path]
        may = least in ("anyone", "known") or is_enough(role, least)
        told = turned_away(client, method, path)
        if (told is None) != may:
            wrong.append((method, path, told))
    assert wrong == []


def test_a_phone_that_waits_learns_its_code_and_reaches_nothing(quiet):
    told = pair(quiet, "operator", name="Anna").json()
    assert (told["state"], told["name"]) == ("waiting", "Anna")
    assert re.fullmatch("[B-Z]{4}", told["code"])
    assert quiet.client.get("/api/whoami").json() == told
    assert turned_away(quiet.client, "socket", "/ws/phone") == (403, "pairing")
    reached = {
        (method, path)
        for method, path in every_request(quiet)
        if turned_away(quiet.client, method, path) is None
    }
    assert {path for _, path in reached} == open_to_all(quiet)


def test_a_revoked_cookie_opens_no_route_and_no_socket(quiet):
    client = member(quiet, "supervisor")
    (one,) = quiet.manager.people.present()
    body = {"id": one.id}
    revoking = bearer(quiet, "supervisor")
    assert quiet.client.post("/api/people/revoke", json=body, headers=revoking).status_code == 200
    reached = {
        path for method, path in every_request(quiet) if turned_away(client, method, path) is None
    }
    assert reached == open_to_all(quiet)
    told = client.get("/api/whoami").json()
    assert (told["state"], told["why"]) == ("revoked", "A supervisor has ended this pairing.")


@pytest.mark.parametrize("deed", ["invite", "people/confirm", "people/revoke", "people/lead"])
def test_who_is_revoked_while_a_body_is_on_the_way_does_nothing_by_it(rig, deed):
    client = member(rig, "supervisor")
    (sue,) = rig.manager.people.present()
    pair(rig, "operator")
    before = rig.manager.people.present()[1:]

    def body():
        yield b'{"role": "viewer"}' if deed == "invite" else b'{"id": '
        rig.doors.pairings.revoke(sue.id, "lost")
        yield (
            b" " if deed == "invite" else f'"{before[0].id}", "code": "{before[0].code}"}}'.encode()
        )

    assert client.post(f"/api/{deed}", content=body()).status_code == 401
    assert [(one.id, one.state) for one in rig.manager.people.present()] == [
        (before[0].id, "waiting")
    ]
    assert all(link.used for link in rig.doors.pairings.book.links.values())


def test_no_route_acts_for_who_is_shut_out_while_its_body_is_on_the_way(quiet):
    client, reading = member(quiet, "supervisor"), set()
    for method, path in [(m, p) for m, p in every_request(quiet) if m in ("POST", "DELETE")]:
        (me,) = quiet.manager.people.present()
        people = dict(quiet.doors.pairings.book.members)

        def body(path=path, me=me):
            yield b"{"
            reading.add(path)
            quiet.doors.pairings.revoke(me.id, "lost")
            yield b"}"

        answer = client.request(method, path, content=body())
        if path in reading - {"/api/stop", "/api/pair"}:
            assert (answer.status_code, answer.json()["field"]) == (401, "role"), path
        quiet.doors.pairings.book.members.update(people)
    acts_at_once = {"/api/recording", "/api/virtual-phone"}
    assert reading == {p for m, p in every_request(quiet) if m == "POST"} - acts_at_once


def test_a_link_made_by_a_page_goes_when_that_page_is_revoked(rig):
    client = member(rig, "supervisor")
    (sue,) = rig.manager.people.present()
    url = client.post("/api/invite", json={"role": "viewer"}).json()["url"]
    answer = rig.client.post(
        "/api/people/revoke", json={"id": sue.id}, headers=bearer(rig, "supervisor")
    )
    assert answer.status_code == 200
    asked = {"token": url.partition("#k=")[2]}
    assert rig.client.post("/api/pair", json=asked, headers=OWN).status_code == 401


def test_a_wrong_link_is_written_down_with_the_address_it_came_from(rig, tmp_path):
    rig.doors.audit = Audit(tmp_path)
    rig.client.post("/api/pair", json={"token": "guess"}, headers=OWN)
    rig.doors.audit.close()
    (line,) = (tmp_path / STRANGERS_FILE).read_text().splitlines()
    assert {"what": "refusal", "address": "127.0.0.1"}.items() <= json.loads(line).items()


def test_an_operator_can_neither_let_in_nor_shut_out_nor_invite(rig):
    client = member(rig, "operator")
    for deed in ("confirm", "deny", "revoke"):
        answer = client.post(f"/api/people/{deed}", json={"id": "x", "code": "BCDF"})
        assert answer.status_code == 403
    assert client.post("/api/invite", json={"role": "viewer"}).status_code == 403


def test_a_supervisors_page_can_not_make_supervisors(rig):
    client = member(rig, "supervisor")
    assert client.post("/api/invite", json={"role": "supervisor"}).status_code == 403
    assert client.post("/api/invite", json={"role": "viewer"}).status_code == 200


def test_a_wrong_match_code_lets_nobody_in(rig):
    pair(rig, "operator")
    (one,) = rig.manager.people.present()
    headers = bearer(rig, "supervisor")
    for code in ("", "BBBB" if one.code != "BBBB" else "CCCC", one.code.lower(), one.code[:3]):
        body = {"id": one.id, "code": code}
        answer = rig.client.post("/api/people/confirm", json=body, headers=headers)
        assert answer.status_code == 409
    assert rig.client.get("/api/whoami").json()["state"] == "waiting"


def test_who_is_denied_is_told_and_stays_out(rig):
    pair(rig, "operator")
    (one,) = rig.manager.people.present()
    headers, body = bearer(rig, "supervisor"), {"id": one.id}
    assert rig.client.post("/api/people/deny", json=body, headers=headers).status_code == 200
    told = rig.client.get("/api/whoami").json()
    assert told["state"] == "denied"
    assert "supervisor" in told["why"]
    body |= {"code": one.code}
    assert rig.client.post("/api/people/confirm", json=body, headers=headers).status_code == 409


def test_of_two_pages_that_race_for_one_link_one_is_let_in(rig):
    key = rig.doors.pairings.invite("viewer", now())
    clients = [TestClient(rig.guard, base_url=BASE, headers=OWN) for _ in range(2)]
    with ThreadPoolExecutor(2) as pool:
        codes = list(
            pool.map(lambda c: c.post("/api/pair", json={"token": key}).status_code, clients)
        )
    assert sorted(codes) == [200, 401]
    assert sorted(c.get("/api/whoami").status_code for c in clients) == [200, 401]


def test_pairing_never_takes_up_a_cookie_that_was_planted(rig):
    planted = "A" * 22
    rig.client.cookies.set(COOKIE, planted)
    answer = pair(rig, "viewer")
    assert planted not in answer.headers["set-cookie"]
    stranger = TestClient(rig.guard, base_url=BASE, cookies={COOKIE: planted})
    assert stranger.get("/api/whoami").status_code == 401


def test_a_browser_is_paired_with_the_servers_of_two_ports_of_one_host(rig, tmp_path):
    pair(rig, "viewer")
    kept = dict(rig.client.cookies)
    other = TestClient(rig.guard, base_url="http://127.0.0.1:8090", cookies=kept)
    other.headers = {"Origin": "http://127.0.0.1:8090", "X-Lightleash": "1"}
    assert other.get("/api/whoami").status_code == 401
    pair(rig, "supervisor", other)
    again = TestClient(rig.guard, base_url=BASE, cookies=dict(other.cookies))
    assert again.get("/api/whoami").json()["role"] == "viewer"


def test_over_tls_a_cookie_counts_only_if_nobody_between_could_have_planted_it(rig):
    attacker = TestClient(rig.guard, base_url=BASE)
    pair(rig, "viewer", attacker)
    planted = attacker.cookies[COOKIE]
    cookies = {cookie_name(False, host): planted for host in ("robot.lan", "robot.lan:8080")}
    victim = TestClient(rig.guard, base_url="https://robot.lan", cookies=cookies)
    assert victim.get("/api/whoami").status_code == 401
    assert attacker.get("/api/whoami").status_code == 200


def test_a_browser_that_pairs_anew_leaves_who_it_was(rig):
    pair(rig, "viewer")
    old = rig.client.cookies[COOKIE]
    pair(rig, "supervisor")
    assert rig.client.get("/api/whoami").json()["role"] == "supervisor"
    former = TestClient(rig.guard, base_url=BASE, cookies={COOKIE: old})
    assert former.get("/api/whoami").json()["state"] == "revoked"
    assert len(rig.manager.people.present()) == 1


@pytest.mark.parametrize(
    ("held", "offered", "waits"),
    [
        ("supervisor", "operator", True),
        ("supervisor", "viewer", False),
        ("operator", "viewer", False),
        ("operator", "operator", True),
    ],
)
def test_no_link_takes_from_a_browser_what_it_may_unless_it_says_so(rig, held, offered, waits):
    browser = member(rig, held)
    key = rig.doors.pairings.invite(offered, now())
    refused = browser.post("/api/pair", json={"token": key, "name": "Anna"})
    assert refused.status_code == 409
    told = {name: refused.json()[name] for name in ("held", "offered", "waits")}
    assert told == {"held": held, "offered": offered, "waits": waits}
    standing = browser.get("/api/whoami").json()
    assert (standing["role"], standing["state"]) == (held, "in")
    taken = browser.post("/api/pair", json={"token": key, "name": "Anna", "replace": True})
    assert taken.status_code == 200, "the link was not used up by the question"
    standing = browser.get("/api/whoami").json()
    assert (standing["role"], standing["state"]) == (offered, "waiting" if waits else "in")


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
    for path in (p for p in http_paths(rig) if p.startswith("/api/")):
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


@pytest.mark.parametrize("written", ["fd00::7", "FD00::7", "fd00:0:0:0:0:0:0:7"])
def test_an_ipv6_address_is_our_own_however_the_settings_write_it(written):
    client = TestClient(Guard(pytest.fail, Doors(), [written]), base_url="http://[fd00::7]:8080")
    assert client.get("/").status_code == 401  # and not 421


def test_pairing_gives_a_cookie_that_scripts_and_other_sites_do_not_get(rig):
    response = pair(rig, "viewer")
    cookie = response.headers["set-cookie"].lower()
    assert "httponly" in cookie
    assert "samesite=strict" in cookie
    assert rig.client.get("/api/whoami").json()["role"] == "viewer"


def test_over_tls_the_cookie_is_for_this_host_and_tls_alone(rig):
    client = TestClient(rig.guard, base_url="https://robot.lan")
    own = {"Origin": "https://robot.lan", "X-Lightleash": "1"}
    key = rig.doors.pairings.invite("viewer", now())
    cookie = client.post("/api/pair", json={"token": key}, headers=own).headers["set-cookie"]
    assert cookie.startswith("__Host-lightleash=")
    assert "Secure" in cookie
    assert "Path=/" in cookie
    assert client.get("/api/whoami").json()["role"] == "viewer"


def test_cookies_of_other_programs_on_this_host_do_not_hide_ours(rig):
    pair(rig, "viewer")
    value = rig.client.cookies[COOKIE]
    rig.client.cookies.clear()
    others = 'theme={"a": [1, "x"]}; =; ;; broken"; ' + f"{COOKIE}={value}; z=1"
    assert rig.client.get("/api/whoami", headers={"Cookie": others}).status_code == 200


@pytest.mark.parametrize("role", ["operator", "supervisor"])
def test_a_key_of_the_run_is_no_link(rig, role):
    asked = {"token": rig.token(role)}
    assert rig.client.post("/api/pair", json=asked, headers=OWN).status_code == 401


def test_a_body_that_never_comes_does_not_hold_its_connection(monkeypatch):
    monkeypatch.setattr(typed_routes, "BODY_S", 0.01)

    async def never():
        await asyncio.Event().wait()

    request = Request({"type": "http", "method": "POST", "headers": []}, receive=never)
    with pytest.raises(RefusedRequest, match="within"):
        asyncio.run(typed_routes.body_of(request))


def test_a_token_of_half_a_character_is_simply_wrong(rig):
    response = rig.client.post("/api/pair", content=rb'{"token": "\ud800"}', headers=OWN)
    assert response.status_code in (400, 401)


def test_links_can_not_be_tried_out(rig):
    wrong = {"json": {"token": "x"}, "headers": OWN}
    codes = [rig.client.post("/api/pair", **wrong).status_code for _ in range(PAIR_TRIES + 2)]
    assert codes == [401] * PAIR_TRIES + [429] * 2


def test_good_links_are_not_counted_as_tries(rig):
    codes = {pair(rig, "viewer").status_code for _ in range(PAIR_TRIES + 2)}
    assert codes == {200}


def test_pages_forbid_what_they_do_not_need(rig):
    for path in ("/", "/supervisor", "/src/app/main.js", "/healthz"):
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
