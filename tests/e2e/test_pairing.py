"""People come in by a real browser: four letters, a click, and out again; no secret is written."""

from __future__ import annotations

import json
import os
import pty
import re
import select
import signal
import socket
import subprocess
import sys
import time
import urllib.error
import urllib.request
from collections.abc import Iterator
from pathlib import Path

import pytest
from playwright.sync_api import expect

from server.common.runtime import RUN_FILE
from tests.e2e.chromium_phone import browser
from tests.e2e.serving import START_S, Serving, serving
from tests.e2e.test_serve import mode, processes, until

pytestmark = [pytest.mark.e2e, pytest.mark.page]
SCREEN = {"viewport": {"width": 1280, "height": 720}}
OTHER_PAGES = ("supervisor", "board", "screen", "fleet", "check")
CAME_OFTEN = 28
"""Of the 32 connections that a stranger may make at once."""


@pytest.fixture(scope="module")
def server(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Serving]:
    folder = tmp_path_factory.mktemp("pairing")
    with serving(folder, "--pairing.confirm", "supervisor") as running:
        yield running


def post(
    server: Serving, path: str, body: object, cookie: str = ""
) -> tuple[int, dict[str, object], str]:
    """As a page on this machine does it; status, JSON, and the cookie that was set."""
    headers = {"Origin": server.http_url, "X-Lightleash": "1", "Cookie": cookie}
    data = json.dumps(body).encode()
    request = urllib.request.Request(server.http_url + path, data, headers, method="POST")
    try:
        with urllib.request.urlopen(request, timeout=5.0) as answer:
            set_cookie = str(answer.headers.get("set-cookie", "")).partition(";")[0]
            return answer.status, json.loads(answer.read()), set_cookie
    except urllib.error.HTTPError as error:
        return error.code, json.loads(error.read()), ""


def ids(server: Serving) -> dict[str, str]:
    """Of those in the list, by name."""
    people = server.request("GET", "/api/status")["people"]
    assert isinstance(people, list)
    return {str(one["name"]): str(one["id"]) for one in people}


def test_a_phone_is_let_in_by_one_click_beside_its_letters_and_shut_out_by_two(
    chromium: str, server: Serving
) -> None:
    with browser(chromium, **SCREEN) as context:
        board, phone = context.new_page(), context.new_page()
        board.goto(f"{server.http_url}/supervisor{server.link('supervisor')}")
        expect(board.locator("#people li")).to_have_count(1)
        link = server.link()
        phone.goto(f"{server.local_https}/{link}")
        phone.fill("#name", "Anna")
        phone.click("#start")
        letters = phone.locator("#match")
        expect(letters).to_have_text(board.locator(".asking .match").inner_text())
        assert link[3:] not in phone.url
        board.click(".asking .confirm")
        row = board.locator("#people li", has_text="Anna")
        expect(row).to_be_visible()
        expect(phone.locator("#pairing")).to_be_hidden()
        row.locator(".revoke").click()
        expect(row.locator(".revoke")).to_have_text("Really?")
        row.locator(".revoke").click()
        expect(row).to_have_count(0)
        phone.reload()
        expect(phone.locator("#problem-title")).to_have_text("This browser is not let in")


def test_a_page_that_is_shut_out_or_too_old_keeps_stop_and_says_what_became_of_it(
    chromium: str, server: Serving
) -> None:
    with browser(chromium, **SCREEN) as context:
        phone = context.new_page()
        refuse = {"type": "refused", "code": "version", "field": "version", "allowed": "3"}
        phone.route_web_socket(
            re.compile("/ws/phone"), lambda ws: ws.send(json.dumps({**refuse, "fatal": True}))
        )
        phone.goto(f"{server.local_https}/{server.link('supervisor')}")
        expect(phone.locator("#last-stop")).to_be_hidden()
        phone.fill("#name", "Olga")
        phone.click("#start")
        expect(phone.locator("#problem-title")).to_have_text("The server has been updated")
        phone.click("#last-stop-button")
        words = phone.locator("#last-stop-words")
        expect(words).to_contain_text("STOPPED")
        until(lambda: mode(server) == "STOPPED", 5.0, "STOPPED")  # a status is 100 ms old
        server.request("POST", "/api/people/revoke", {"id": ids(server)["Olga"]})
        phone.click("#last-stop-button")
        expect(words).to_contain_text("STOP was refused")
        expect(words).to_contain_text("A supervisor has ended this pairing")
        with phone.expect_request("**/api/stop"):
            phone.click("#last-stop-button")


def test_a_supervisors_browser_that_opens_a_lesser_link_is_asked_and_may_keep_what_it_is(
    chromium: str, server: Serving
) -> None:
    with browser(chromium, **SCREEN) as context:
        page = context.new_page()
        page.goto(f"{server.http_url}/supervisor{server.link('supervisor')}")
        expect(page.locator("#people li")).not_to_have_count(0)
        for answer, role in (("keep", "supervisor"), ("take", "viewer")):
            other = context.new_page()
            other.goto(f"{server.http_url}/supervisor{server.link('viewer')}")
            expect(other.locator("#choice-title")).to_contain_text("it supervises")
            other.click(f"#choice-{answer}")
            expect(other.locator("body")).to_have_attribute("data-role", role)


def test_a_screen_that_was_left_while_it_waited_takes_no_place_when_it_is_let_in(
    chromium: str, server: Serving
) -> None:
    with browser(chromium, **SCREEN) as context:
        screen, opened = context.new_page(), list[str]()
        screen.on("websocket", lambda socket: opened.append(socket.url))
        screen.goto(f"{server.local_https}/screen{server.link()}")
        screen.click("#start")
        expect(screen.locator("#why")).to_contain_text("Waiting to be let in")
        screen.evaluate("document.exitFullscreen()")
        expect(screen.locator("#setup")).to_be_visible()
        people = server.request("GET", "/api/status")["people"]
        assert isinstance(people, list)
        [waiting] = [one for one in people if one["state"] == "waiting"]
        told = {"id": waiting["id"], "code": waiting["code"]}
        server.request("POST", "/api/people/confirm", told)
        screen.wait_for_timeout(3e3)  # it asks each second
        assert not opened
        with screen.expect_websocket():
            screen.click("#start")


def test_a_viewers_page_shows_all_and_offers_stop_alone(chromium: str, server: Serving) -> None:
    with browser(chromium, **SCREEN) as context:
        page = context.new_page()
        page.goto(f"{server.http_url}/supervisor{server.link('viewer')}")
        expect(page.locator("#people li")).not_to_have_count(0)
        buttons = page.locator("button:visible")
        assert [one.strip() for one in buttons.all_inner_texts()] == ["STOP"]


def test_a_phones_page_comes_whole_though_its_address_has_come_too_often(
    chromium: str, server: Serving
) -> None:
    host, port = server.https_url.removeprefix("https://").rsplit(":", 1)
    with browser(chromium) as context:
        page, failed = context.new_page(), list[str]()
        page.on("requestfailed", lambda request: failed.append(request.url))
        for _ in range(CAME_OFTEN):  # one after the other: its place is free again once it is ended
            with socket.create_connection((host, int(port)), 5.0) as one:
                one.shutdown(socket.SHUT_WR)
                assert one.recv(1) == b""
        page.goto(f"{server.https_url}/{server.link()}")
        expect(page.locator("#start")).to_be_visible()
        assert failed == []


def test_a_phones_page_that_lacks_a_file_says_so_and_a_whole_one_does_not(
    chromium: str, server: Serving
) -> None:
    with browser(chromium) as context:
        whole, lacking = context.new_page(), context.new_page()
        lacking.route("**/src/ui/view.js", lambda route: route.abort())
        for page in (whole, lacking):
            page.goto(f"{server.local_https}/")
            page.wait_for_load_state("load")
        expect(lacking.locator("#step span")).not_to_be_visible()
        expect(lacking.locator("#step span")).to_be_visible()
        expect(lacking.locator("#step")).to_contain_text("load it again")
        expect(whole.locator("#problem")).to_be_visible()
        expect(whole.locator("#step span")).to_have_count(0)


def test_each_other_page_that_lacks_its_scripts_says_so(chromium: str, server: Serving) -> None:
    with browser(chromium) as context:
        context.route("**/src/**", lambda route: route.abort())
        pages = {name: context.new_page() for name in OTHER_PAGES}
        for name, page in pages.items():
            page.goto(f"{server.http_url}/{name}")
            expect(page.locator(".late")).not_to_be_visible()
        for page in pages.values():
            expect(page.locator(".late")).to_be_visible()
            expect(page.locator(".late")).to_contain_text("load it again")


def test_a_server_killed_knows_who_was_in_and_who_was_shut_out(server: Serving) -> None:
    stays, goes = (
        post(server, "/api/pair", {"token": server.link("viewer")[3:], "name": name})
        for name in ("Stays", "Goes")
    )
    until(lambda: "Goes" in ids(server), 10.0, "the newcomer in the list")
    server.request("POST", "/api/people/revoke", {"id": ids(server)["Goes"]})
    former = processes(server.process.pid)["server"]
    os.kill(former, signal.SIGKILL)
    until(
        lambda: processes(server.process.pid).get("server") not in (None, former), 20.0, "another"
    )
    until(lambda: mode(server) != "", 120.0, "an answer")
    assert post(server, "/api/stop", {"type": "command", "what": "stop"}, stays[2])[0] == 202
    assert post(server, "/api/stop", {"type": "command", "what": "stop"}, goes[2])[0] == 401


def test_no_secret_is_in_anything_that_was_written(server: Serving, tmp_path: Path) -> None:
    server.request("POST", "/api/recording")
    secrets = {server.operator_token, server.supervisor_token}
    for role in ("viewer", "operator", "supervisor"):
        key = server.link(role)[3:]
        status, told, cookie = post(server, "/api/pair", {"token": key, "name": role})
        assert status == 200
        assert post(server, "/api/pair", {"token": key})[0] == 401
        secrets |= {key, cookie.partition("=")[2]}
        assert key not in json.dumps(told)
    environment = Path(f"/proc/{processes(server.process.pid)['server']}/environ").read_bytes()
    (secret,) = [
        one.partition(b"=")[2].decode()
        for one in environment.split(b"\0")
        if one.startswith(b"_LIGHTLEASH_SECRET")
    ]
    secrets |= {secret, bytes.fromhex(secret).decode("latin-1")}
    server.request("DELETE", "/api/recording")
    time.sleep(1.0)
    root = server.runtime.parent.parent
    written = [path for path in root.rglob("*") if path.is_file() and path.name != RUN_FILE]
    names = {path.name for path in written}
    assert {"serve.log", "audit.jsonl", "members.json"} <= names
    assert any(path.suffix == ".mcap" for path in written)
    assert len(secrets) == 10
    found = {
        path.name
        for path in written
        for one in secrets
        if one.encode("latin-1") in path.read_bytes()
    }
    assert found == set()


def test_a_terminal_is_shown_links_that_open_once_and_the_log_beside_it_is_not(
    tmp_path: Path,
) -> None:
    for name in ("run", "state"):
        (tmp_path / name).mkdir(mode=0o700)
    places = {"XDG_RUNTIME_DIR": str(tmp_path / "run"), "XDG_STATE_HOME": str(tmp_path / "state")}
    terminal, inside = pty.openpty()
    command = [sys.executable, "-m", "server", "serve", "--https-port", "0", "--http-port", "0"]
    log = (tmp_path / "log").open("wb")
    environment = {**os.environ, **places, "COLUMNS": "100"}
    process = subprocess.Popen(command, env=environment, stdout=inside, stderr=log)
    try:
        shown, end = "", time.monotonic() + START_S
        while "Ctrl-C" not in shown and time.monotonic() < end:
            if select.select([terminal], [], [], 1.0)[0]:
                shown += os.read(terminal, 65_536).decode("utf-8", "replace")
        found = re.search(r"Supervisor: +(http://127\.0\.0\.1:\d+)/supervisor#k=(\S+)", shown)
        assert found is not None, shown + (tmp_path / "log").read_text()
        url, key = found.groups()
        headers = {"Origin": url, "X-Lightleash": "1"}
        asked = json.dumps({"token": key}).encode()
        request = urllib.request.Request(f"{url}/api/pair", asked, headers, method="POST")
        with urllib.request.urlopen(request, timeout=5.0) as answer:
            assert json.loads(answer.read())["role"] == "supervisor"
        with pytest.raises(urllib.error.HTTPError, match="401"):
            urllib.request.urlopen(request, timeout=5.0)
        assert "█" in shown or "▀" in shown  # the code to scan
    finally:
        process.terminate()
        process.wait(20.0)
        log.close()
        os.close(terminal)
        os.close(inside)
    assert key not in (tmp_path / "log").read_text()
    assert "#k=" not in (tmp_path / "log").read_text()
