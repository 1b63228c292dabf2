"""Two servers on one machine, each with a robot: one browser in both, and neither in the other."""

from __future__ import annotations

import json
import subprocess
import sys
from collections.abc import Iterator
from contextlib import ExitStack

import pytest
from playwright.sync_api import BrowserContext, Page, expect

from tests.e2e.chromium_phone import browser
from tests.e2e.serving import Serving, serving
from tests.e2e.test_serve import get, mode, processes, reset, status, until

pytestmark = [pytest.mark.e2e, pytest.mark.page]
WAIT_MS = 30_000
ROBOTS = {"left": "ames", "right": "twister"}


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
        for page, robot in zip(pages, ROBOTS.values(), strict=True):
            expect(page.locator("#mode")).to_have_text("DISARMED", timeout=WAIT_MS)
            expect(page.locator("#robot")).to_contain_text(robot)
            expect(page.locator("#people li")).to_have_count(1)
        for page in pages:
            page.reload()
    assert len({cookie["name"] for cookie in context.cookies()}) == 2
    for page in pages:
        page.close()


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
