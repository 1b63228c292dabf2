"""Two servers on one machine, each with a robot: one browser in both, and neither in the other."""

from __future__ import annotations

import json
import signal
import subprocess
import sys
from collections.abc import Iterator
from contextlib import ExitStack

import pytest
from playwright.sync_api import BrowserContext, Locator, Page, expect

from tests.e2e.axe import violations
from tests.e2e.chromium_phone import browser
from tests.e2e.serving import Serving, serving
from tests.e2e.test_serve import get, mode, processes, reset, status, until

pytestmark = [pytest.mark.e2e, pytest.mark.page]
ROBOTS = {"left": "ames", "right": "twister"}
PERMISSIONS = ["camera", "accelerometer", "gyroscope", "magnetometer"]
SMALLEST_PX = """
Math.min(...[...document.querySelectorAll('body *')]
  .filter((one) => [...one.childNodes].some((node) => node.nodeType === 3 && node.data.trim()))
  .map((one) => parseFloat(getComputedStyle(one).fontSize)))
"""
"""Of all that is written."""


@pytest.fixture(scope="module")
def servers(tmp_path_factory: pytest.TempPathFactory) -> Iterator[dict[str, Serving]]:
    folder = tmp_path_factory.mktemp("fleet")
    with ExitStack() as stack:
        yield {
            name: stack.enter_context(serving(folder, "--robot", robot, name=name))
            for name, robot in ROBOTS.items()
        }


@pytest.fixture
def left(servers: dict[str, Serving]) -> Serving:
    return servers["left"]


@pytest.fixture
def right(servers: dict[str, Serving]) -> Serving:
    return servers["right"]


@pytest.fixture(scope="module")
def context(chromium: str) -> Iterator[BrowserContext]:
    """One browser for all."""
    with browser(chromium, viewport={"width": 1280, "height": 720}) as one:
        one.route("**/view/", lambda route: route.abort())  # drawn without a graphics card
        yield one


def lightleash(server: Serving, *words: str) -> subprocess.CompletedProcess[str]:
    """A command of this machine's user."""
    command = [sys.executable, "-m", "server", *words]
    return subprocess.run(
        command, env=server.environment, capture_output=True, text=True, timeout=60.0
    )


def supervising(context: BrowserContext, server: Serving) -> Page:
    """Its page, let in by a link of `lightleash invite`."""
    words = ("invite", "--name", json.loads((server.runtime / "launch.json").read_text())["name"])
    said = lightleash(server, *words, "--role", "supervisor").stdout
    link = said.partition("On this computer: ")[2].split()[0]
    assert link.startswith(server.http_url)
    page = context.new_page()
    page.goto(link)
    return page


def test_one_browser_is_in_at_both_and_stays_in_at_both(
    context: BrowserContext, left: Serving, right: Serving
) -> None:
    pages = [supervising(context, one) for one in (left, right)]
    for _ in range(2):
        for page, (name, robot) in zip(pages, ROBOTS.items(), strict=True):
            expect(page.locator("#mode")).to_have_text("DISARMED")
            expect(page.locator("#robot")).to_have_text(f"{name} · {robot}")
            expect(page).to_have_title(f"DISARMED · {name}")
            expect(page.locator("#people li")).to_have_count(1)
        for page in pages:
            page.reload()
    assert len({cookie["name"] for cookie in context.cookies()}) == 2
    for page in pages:
        page.close()


def test_a_phones_page_says_whose_robot_it_leads(context: BrowserContext, left: Serving) -> None:
    assert context.browser is not None
    with context.browser.new_context(
        ignore_https_errors=True, permissions=PERMISSIONS, viewport={"width": 412, "height": 915}
    ) as held:
        phone = held.new_page()
        phone.goto(f"{left.local_https}/{left.link()}")
        phone.click("#start")
        expect(phone.locator("#server")).to_have_text("left")
        expect(phone.locator("#server")).to_be_visible()
        expect(phone).to_have_title("left · Lightleash")
    until(lambda: status(left)["operator"] == "", 20.0, "no phone")


def test_what_is_done_at_one_is_not_done_at_the_other(left: Serving, right: Serving) -> None:
    until(lambda: {mode(left), mode(right)} == {"DISARMED"}, 10.0, "DISARMED")
    left.request("POST", "/api/stop")
    until(lambda: mode(left) == "STOPPED", 5.0, "STOPPED")
    right.request("POST", "/api/virtual-phone")  # a robot with a twist, by a name it can't guess
    try:
        until(lambda: "virtual" in str(status(right)["operator"]), 30.0, "a virtual phone")
        assert (mode(left), status(left)["operator"]) == ("STOPPED", "")
    finally:
        right.request("DELETE", "/api/virtual-phone")
        until(lambda: status(right)["operator"] == "", 20.0, "no phone")
    reset(left)


def test_each_has_processes_recordings_and_an_audit_log_and_both_have_one_authority(
    left: Serving, right: Serving
) -> None:
    assert len({*processes(left.process.pid).values(), *processes(right.process.pid).values()}) == 6
    for server in (left, right):
        name = server.request("POST", "/api/recording")["name"]
        server.request("DELETE", "/api/recording")
        assert [one.stem for one in (server.state / "recordings").glob("*.mcap")] == [name]
        assert (server.state / "audit.jsonl").exists()
    first, second = (get(f"{one.http_url}/ca.crt")[1] for one in (left, right))
    assert first == second
    assert get(f"{right.local_https}/", left.trusting())[0] == 200


def test_a_command_without_the_name_reaches_neither_and_says_which_there_are(
    left: Serving,
) -> None:
    done = lightleash(left, "invite")
    assert (done.returncode, done.stdout) == (1, "")
    assert done.stderr.endswith("there is --name left, --name right\n")


@pytest.mark.parametrize(
    ("name", "says"), [("left", "runs already"), ("two words", "letters, digits and dashes")]
)
def test_a_name_that_is_taken_or_none_is_refused_and_the_first_goes_on(
    name: str, says: str, left: Serving
) -> None:
    done = lightleash(left, "serve", "--https-port", "0", "--http-port", "0", "--name", name)
    assert done.returncode == 2
    assert says in done.stderr
    assert mode(left) != ""


def card(page: Page, name: str) -> Locator:
    """What the page of all robots shows of one."""
    return page.locator(".server", has=page.get_by_role("heading", name=name))


def test_the_page_of_all_robots_shows_each_and_can_do_nothing(
    context: BrowserContext, left: Serving, right: Serving
) -> None:
    board = supervising(context, left)
    expect(board.locator("#mode")).to_have_text("DISARMED")
    with context.expect_page() as opened:
        board.click("text=All robots here")
    page = opened.value
    page.wait_for_load_state("load")  # its own files are asked for until then
    asked: list[str] = []
    page.on("request", lambda request: asked.append(f"{request.method} {request.url}"))
    for name, robot in ROBOTS.items():
        expect(card(page, name).locator("h2")).to_contain_text(robot)
        expect(card(page, name).locator("strong")).to_have_text("DISARMED")
    right.request("POST", "/api/stop")
    expect(card(page, "right").locator("strong")).to_have_text("STOPPED")
    expect(card(page, "left").locator("strong")).to_have_text("DISARMED")
    reset(right)
    right.request("POST", "/api/virtual-phone")
    try:
        expect(card(page, "right").locator("dl")).to_contain_text("virtual")
        expect(card(page, "right").locator("dl")).to_contain_text(" ms")
        expect(card(page, "left").locator("dl")).to_contain_text("nobody")
    finally:
        right.request("DELETE", "/api/virtual-phone")
    assert set(asked) - {f"GET {left.http_url}/icon.svg"} == {f"GET {left.http_url}/api/fleet"}
    assert page.locator("button, input, select, form").count() == 0
    card(page, "right").locator("a").click()
    expect(page).to_have_url(f"{right.http_url}/supervisor")
    for one in (page, board):
        one.close()


def test_who_is_not_let_in_is_told_so_and_shown_nothing(
    context: BrowserContext, left: Serving
) -> None:
    assert context.browser is not None
    with context.browser.new_context(ignore_https_errors=True) as stranger:
        page = stranger.new_page()
        page.goto(f"{left.local_https}/fleet")
        expect(page.locator("#why")).to_contain_text("pair first")
        assert page.locator(".server").count() == 0


@pytest.mark.parametrize("size", [(412, 915), (1280, 720)])
def test_it_can_be_read_on_a_phone_and_across_a_room(
    size: tuple[int, int], context: BrowserContext, left: Serving
) -> None:
    board = supervising(context, left)
    page = context.new_page()
    page.set_viewport_size({"width": size[0], "height": size[1]})
    page.goto(f"{left.http_url}/fleet")
    expect(page.locator(".server")).to_have_count(2)
    assert page.evaluate(SMALLEST_PX) >= 16.0
    assert page.evaluate("document.documentElement.scrollWidth <= innerWidth")
    assert violations(page) == []
    for one in (page, board):
        one.close()


def test_a_killed_server_is_gone_and_one_that_was_told_to_end_has_ended(
    context: BrowserContext, left: Serving
) -> None:
    folder = left.runtime.parents[3]
    board, page = supervising(context, left), context.new_page()
    page.goto(f"{left.http_url}/fleet")
    for name, number, title in (
        ("killed", signal.SIGKILL, "GONE"),
        ("told", signal.SIGTERM, "ENDED"),
    ):
        with serving(folder, "--robot", "twister", name=name) as third:
            expect(card(page, name).locator("strong")).to_have_text("DISARMED")
            third.process.send_signal(number)
            expect(card(page, name).locator("strong")).to_have_text(title)
        expect(card(page, name).locator("a")).to_be_hidden()
        expect(card(page, name).locator("dl")).to_have_text("")
    expect(card(page, "left").locator("strong")).to_have_text("DISARMED")
    for one in (page, board):
        one.close()


def test_without_an_answer_of_its_own_server_the_page_shows_no_mode(
    context: BrowserContext, left: Serving
) -> None:
    board, page = supervising(context, left), context.new_page()
    page.goto(f"{left.http_url}/fleet")
    expect(card(page, "right").locator("strong")).to_have_text("DISARMED")
    page.route("**/api/fleet", lambda route: route.abort())
    for name in ROBOTS:
        expect(card(page, name).locator("strong")).to_have_text("NO WORD")
    expect(page.locator("#why")).to_have_text("The server of this page does not answer.")
    page.unroute("**/api/fleet")
    expect(card(page, "left").locator("strong")).to_have_text("DISARMED")
    for one in (page, board):
        one.close()
