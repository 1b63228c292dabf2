"""Whatever can be clicked on the supervisor's page is clicked, and the server does it.

In a real Chromium and a real Firefox, on one server each, with the simulated robot. What each click
is to bring about is not so before it; what is on the page and was not clicked makes this red.
"""

from __future__ import annotations

import contextlib
import json
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from server.common.runtime_parameters import RuntimeParameters
from server.recording.reader import read
from tests.e2e.clicked_page import ClickedPage, clicked_page
from tests.e2e.serving import Serving, serving
from tests.e2e.test_pairing import ids, post
from tests.e2e.test_serve import mode, status, until

pytestmark = [pytest.mark.e2e, pytest.mark.page]
SOON_S, READY_S = 15.0, 60.0
"""For what a click does; for what a phone brings."""
CONTROLS = """
[...document.querySelectorAll('button, input, select, textarea, summary, a[href], [role=button]')]
  .map((one) => one.id || [...one.classList].at(-1) || one.outerHTML)
"""
"""All of the page, hidden ones too; those of a person's row by what they do."""
OLD_PAGE = r"""
try {
  if (sessionStorage.getItem('old')) {
    const send = WebSocket.prototype.send;
    WebSocket.prototype.send = function (data) {
      const isText = typeof data === 'string';
      send.call(this, isText ? data.replace(/"version":\d+/, '"version":1') : data);
    };
  }
} catch { /* a page without a place of its own */ }
"""
"""On demand a page that a browser has kept from before an update."""
SHOWN = "document.querySelector('{0}')?.checkVisibility() === true"
COME = "document.body?.dataset.role === '{0}'"


@pytest.fixture
def server(tmp_path: Path) -> Iterator[Serving]:
    with serving(tmp_path, "--pairing.confirm", "supervisor") as running:
        yield running


@pytest.fixture(params=["chromium", "firefox"])
def page(request: pytest.FixtureRequest) -> Iterator[ClickedPage]:
    path = {"chromium": "chromium", "firefox": "firefox_path"}[request.param]
    with clicked_page(request.param, request.getfixturevalue(path), OLD_PAGE) as opened:
        yield opened


class Clicks:
    """Clicks on one page, and what became of them on its server."""

    def __init__(self, page: ClickedPage, server: Serving) -> None:
        self.page, self.server = page, server
        self.seen: set[str] = set()
        self.clicked: set[str] = set()

    def until_page(self, condition: str, seconds: float = SOON_S) -> None:
        """Wait until a JavaScript expression is true there."""
        until(lambda: bool(self.page.evaluate(condition)), seconds, condition)

    def click(
        self, name: str, done: Callable[[], bool], selector: str = "", within_s: float = SOON_S
    ) -> None:
        """Click what has this name, and wait until the server has `done` what was not so before."""
        selector = selector or f"#{name}"
        self._act(name, done, lambda: self.page.click(selector), within_s)

    def choose(self, name: str, value: str, done: Callable[[], bool]) -> None:
        """The same in a list, or on a slider."""
        self._act(name, done, lambda: self.page.choose(f"#{name}", value))

    @contextlib.contextmanager
    def follow(self, name: str) -> Iterator[ClickedPage]:
        """Click a link, and be on the page that it opens, with this one left as it is."""
        self._look()
        opened = self.page.followed(f"#{name}")
        self.clicked.add(name)
        try:
            yield opened
        finally:
            opened.close()
            self.page.to_front()

    def _act(
        self, name: str, done: Callable[[], bool], act: Callable[[], None], within_s: float = SOON_S
    ) -> None:
        self._look()
        assert not done(), f"{name}: done before the click"
        act()
        until(done, within_s, f"what {name} is to do")
        self.clicked.add(name)

    def _look(self) -> None:
        self.seen |= set(self.page.evaluate(CONTROLS))


@contextlib.contextmanager
def idle_phone(server: Serving) -> Iterator[None]:
    """A phone that nobody leads by."""
    phone = subprocess.Popen(
        [sys.executable, "-m", "tests.e2e.idle_phone"], env=server.environment, cwd=Path.cwd()
    )
    try:
        until(lambda: status(server)["phones"] == 1, READY_S, "a phone")
        yield
    finally:
        phone.terminate()
        phone.wait(15.0)


def said(server: Serving, what: str) -> int:
    """How often the server has written down that somebody did this."""
    lines = (server.state / "audit.jsonl").read_text().splitlines()
    return sum(json.loads(line)["what"] == what for line in lines)


def people(server: Serving) -> dict[str, dict[str, object]]:
    """Who is in or waits, by name."""
    listed = status(server)["people"]
    assert isinstance(listed, list)
    return {str(one["name"]): one for one in listed}


def leading(server: Serving, what: str) -> object:
    told = status(server)["leading"]
    assert isinstance(told, dict)
    return told[what]


def knobs(server: Serving) -> RuntimeParameters:
    told = status(server)["virtual_camera"]
    assert isinstance(told, dict)
    return RuntimeParameters(**told["knobs"])


def ask(server: Serving, name: str) -> None:
    """Somebody opens a link of ours and waits to be let in."""
    key = server.link().removeprefix("#k=")
    code, told, _ = post(server, "/api/pair", {"token": key, "name": name})
    assert (code, told["state"]) == (200, "waiting")
    until(lambda: name in people(server), SOON_S, f"{name} asks")


def has_event(server: Serving, beginning: str) -> bool:
    events = status(server)["events"]
    assert isinstance(events, list)
    return any(event["text"].startswith(beginning) for event in events)


def kept(server: Serving) -> object:
    """Whether somebody should learn from the newest press."""
    told = status(server)["episode"]
    assert isinstance(told, dict)
    return told["keep"]


def enter(clicks: Clicks) -> None:
    clicks.page.open(f"{clicks.server.http_url}/supervisor{clicks.server.link('supervisor')}")
    clicks.until_page(COME.format("supervisor"))
    until(lambda: status(clicks.server)["supervisors"] == 1, SOON_S, "the page is connected")


def fly_and_record(clicks: Clicks) -> None:
    """The virtual phone comes, leads, is recorded, is stopped in flight and goes."""
    server = clicks.server
    clicks.click("virtual", lambda: "virtual" in str(status(server)["operator"]))
    until(lambda: mode(server) == "TRACK", READY_S, "TRACK")
    clicks.click("record", lambda: status(server)["recording"] != "")
    clicks.until_page(SHOWN.format("#episode"))
    clicks.choose("task", "a cup", lambda: status(server)["task"] == "a cup")
    clicks.until_page("!document.querySelector('#verdict').disabled")
    clicks.click("verdict", lambda: not kept(server))
    clicks.until_page(SHOWN.format("#picture"))
    ask(server, "Carla")  # perhaps by the code that the page has: it needs another one
    invites = said(server, "invite")
    clicks.click("code", lambda: said(server, "invite") > invites)
    clicks.click("deny", lambda: "Carla" not in people(server), "[aria-label='Deny: Carla']")
    clicks.click("stop", lambda: mode(server) == "STOPPED")
    clicks.click("record", lambda: has_event(server, "Recorded: "))
    (file,) = (server.state / "recordings").glob("*.mcap")
    assert read(file).t_last > read(file).t_first
    clicks.click("virtual", lambda: status(server)["phones"] == 0)
    clicks.click("reset", lambda: mode(server) == "DISARMED")


def arm_and_disarm(clicks: Clicks) -> None:
    """As a person does who reads why it was refused, and clicks again: a busy machine stutters."""
    server, end = clicks.server, time.monotonic() + READY_S
    with idle_phone(server):
        while mode(server) != "ARMED":
            assert time.monotonic() < end, status(server)["refusals"]
            with contextlib.suppress(AssertionError):
                until(lambda: status(server)["ready"] is True, SOON_S, "ready")
                clicks.click("arm", lambda: mode(server) == "ARMED", within_s=3.0)
        clicks.click("disarm", lambda: mode(server) == "DISARMED")


def turn_knobs(clicks: Clicks) -> None:
    server, before = clicks.server, knobs(clicks.server)
    clicks.choose("knob-cutoff", "20", lambda: knobs(server).cutoff_hz != before.cutoff_hz)
    clicks.choose("knob-adaptive", "2.5", lambda: knobs(server).adaptive_beta == 2.5)
    clicks.choose("knob-limit", "3", lambda: knobs(server).max_speed_m_s != before.max_speed_m_s)
    clicks.click("knob-guard", lambda: knobs(server).guard != before.guard)
    clicks.choose("knob-mode", "off", lambda: knobs(server).mode == "off")
    clicks.choose("lead-scale", "0.5", lambda: leading(server, "scale") == 0.5)
    clicks.choose("lead-axes", "level", lambda: leading(server, "axes") == "level")


def lead_by_a_page(clicks: Clicks) -> None:
    """The link beside the code makes this browser a phone; the supervisor chooses its way."""
    server = clicks.server
    with clicks.follow("url") as phone:
        try:
            until(lambda: bool(phone.evaluate(SHOWN.format("#start"))), SOON_S, "the phone page")
        except AssertionError as error:
            shown = phone.evaluate("`${document.readyState}: ${document.body.innerText}`")
            raise AssertionError(f"the phone page shows {shown}") from error
        phone.evaluate("document.querySelector('#name').value = 'Paul'")
        phone.click("#start")
        until(lambda: "Paul" in people(server), SOON_S, "Paul asks")
        clicks.page.to_front()
        clicks.click(
            "confirm",
            lambda: people(server)["Paul"]["state"] == "in",
            "[aria-label='Confirm: Paul']",
        )
        phone.to_front()
        until(lambda: status(server)["path_choice"] is not None, READY_S, "it has several ways")
        clicks.page.to_front()
        clicks.until_page("!document.querySelector('#path-wish').disabled")
        wish = {"type": "path", "wish": "JPEG", "by": "supervisor"}
        clicks.choose("path-wish", "JPEG", lambda: status(server)["path_choice"] == wish)


def decide_about_people(clicks: Clicks) -> None:
    server = clicks.server
    ask(server, "Anna")
    anna = people(server)["Anna"]
    server.request("POST", "/api/people/confirm", {"id": anna["id"], "code": anna["code"]})
    row = "[aria-label='{}: Anna']".format
    clicks.click("lead", lambda: people(server)["Anna"]["offered"] is True, row("Give lead"))
    clicks.page.click(row("Revoke"))
    clicks.until_page(f'document.querySelector("{row("Really?")}") !== null')
    clicks.click("revoke", lambda: "Anna" not in people(server), row("Really?"))


def open_others(clicks: Clicks) -> None:
    """Pages in other tabs: this one stays, with its STOP."""
    server = clicks.server
    shown = "A screen shows the robot"
    assert not has_event(server, shown)
    with clicks.follow("screen") as screen:
        screen.click("#start")
        until(lambda: has_event(server, shown), SOON_S, "a screen")
    answered = "performance.getEntriesByType('navigation')[0].responseStatus === 200"
    with clicks.follow("fleet") as fleet:
        until(lambda: bool(fleet.evaluate(answered)), SOON_S, "the fleet")
        assert fleet.evaluate("location.pathname") == "/fleet"
    with clicks.follow("check") as check:
        until(lambda: bool(check.evaluate(answered)), SOON_S, "the check")
        assert check.evaluate("location.pathname") == "/check"
    with clicks.follow("alone") as view:
        until(lambda: bool(view.evaluate(answered)), SOON_S, "the view")
        assert view.evaluate("location.pathname") == "/view/"
    assert status(server)["supervisors"] == 1


def choose_a_lesser_link(clicks: Clicks) -> None:
    server = clicks.server
    for answer, role in (("keep", "supervisor"), ("take", "viewer")):
        clicks.page.open(f"{server.http_url}/supervisor?{answer}{server.link('viewer')}")
        clicks.until_page(SHOWN.format("#choice"))
        until(lambda: status(server)["supervisors"] == 0, SOON_S, "it waits for the answer")
        clicks.click(f"choice-{answer}", lambda: status(server)["supervisors"] == 1)
        (own,) = people(server).values()
        assert own["role"] == role


def stop_and_reload_an_old_page(clicks: Clicks) -> None:
    server, page = clicks.server, clicks.page
    page.evaluate("sessionStorage.setItem('old', '1')")
    page.open(f"{server.http_url}/supervisor?old")
    clicks.until_page(SHOWN.format("#last-stop-button"))
    clicks.click("last-stop-button", lambda: mode(server) == "STOPPED")
    page.evaluate("sessionStorage.clear()")
    clicks.click("reload", lambda: status(server)["supervisors"] == 1)


def test_each_button_of_the_supervisors_page_does_on_the_server_what_it_says(
    server: Serving, page: ClickedPage
) -> None:
    clicks = Clicks(page, server)
    enter(clicks)
    fly_and_record(clicks)
    turn_knobs(clicks)
    lead_by_a_page(clicks)
    decide_about_people(clicks)
    arm_and_disarm(clicks)
    open_others(clicks)
    server.request("POST", "/api/people/revoke", {"id": ids(server)["Paul"]})
    choose_a_lesser_link(clicks)
    stop_and_reload_an_old_page(clicks)
    assert clicks.seen == clicks.clicked
