"""A page of Chromium's spoken to past the browser's driver: many orders, one wait for all answers.

A hand is played into a page a hundred times a second. By a driver, each of its orders is a round
trip through three processes, which two processors do not have time for beside a flight.
"""

from __future__ import annotations

import contextlib
import json
from pathlib import Path
from typing import Any

import numpy as np
from playwright.sync_api import BrowserContext, Page
from websockets.sync.client import connect

from server.common.child import be_prompt

ANSWER_S = 60.0
SENSORS = ("accelerometer", "gyroscope", "linear-acceleration")
HEARS = ("Chrome_IOThread", "Chrome_DevTools")
"""Names of threads, beside the first one."""
Order = tuple[str, dict[str, object]]
"""A method of the DevTools protocol, and what it is given."""


class ChannelError(Exception):
    """What Chromium answers when it can't do as it is told."""


def _port(context: BrowserContext) -> int:
    """Where Chromium listens, which it writes into its profile; see `FLAGS`."""
    browser = context.browser
    assert browser is not None
    told = browser.new_browser_cdp_session().send("Browser.getBrowserCommandLine")
    (profile,) = (w.split("=", 1)[1] for w in told["arguments"] if w.startswith("--user-data-dir="))
    return int((Path(profile) / "DevToolsActivePort").read_text().split()[0])


def address(context: BrowserContext, page: Page) -> str:
    """Of a page, through all that it shows."""
    target = context.new_cdp_session(page).send("Target.getTargetInfo")["targetInfo"]
    return f"ws://127.0.0.1:{_port(context)}/devtools/page/{target['targetId']}"


def hurry(context: BrowserContext) -> None:
    """Let the threads by which a browser is told what sensors feel wait for no ordinary ones.

    A phone's hardware does not: behind a page that paints, on a busy machine, readings stood still
    for up to 0.17 s, and the phone's motion sensors were called silent.
    """
    browser = context.browser
    assert browser is not None
    told = browser.new_browser_cdp_session().send("SystemInfo.getProcessInfo")["processInfo"]
    for process in (one["id"] for one in told if one["type"] == "browser"):
        for thread in Path(f"/proc/{process}/task").iterdir():
            with contextlib.suppress(OSError):  # it has ended
                if thread.name == str(process) or (thread / "comm").read_text().startswith(HEARS):
                    be_prompt(int(thread.name))


class Channel:
    """To one page."""

    def __init__(self, url: str) -> None:
        """Opens it; what is ordered lasts as long as it is open."""
        self._socket, self._count = connect(url, max_size=None, compression=None), 0

    def orders(self, *orders: Order) -> list[dict[str, Any]]:
        """Do them in this order; gives what each answers.

        Raises:
            ChannelError: one was refused.
        """
        waiting: dict[int, Order] = {}
        for method, given in orders:
            self._count += 1
            waiting[self._count] = (method, given)
            self._socket.send(json.dumps({"id": self._count, "method": method, "params": given}))
        answers: dict[int, dict[str, Any]] = {}
        while len(answers) < len(waiting):
            answer = json.loads(self._socket.recv(ANSWER_S))
            if answer.get("id") not in waiting:
                continue  # an event
            if "error" in answer:
                raise ChannelError(f"{waiting[answer['id']]}: {answer['error']['message']}")
            answers[answer["id"]] = answer["result"]
        return [answers[i] for i in waiting]

    def close(self) -> None:
        """What was ordered for as long as it is open ends."""
        self._socket.close()


def feeling(kind: str) -> Order:
    """The order that lets a sensor read what it is told, instead of the machine's own."""
    on: dict[str, object] = {"enabled": True, "type": kind, "metadata": {}}
    return ("Emulation.setSensorOverrideEnabled", on)


def reading(kind: str, v: np.ndarray) -> Order:
    """What a sensor reads from now on, (3,) in d."""
    reading = {"xyz": dict(zip("xyz", map(float, v), strict=True))}
    return ("Emulation.setSensorOverrideReadings", {"type": kind, "reading": reading})


def evaluation(expression: str) -> Order:
    """The order whose answer `value_of` reads; promises are awaited."""
    given = {"expression": expression, "returnByValue": True, "awaitPromise": True}
    return ("Runtime.evaluate", given)


def value_of(answer: dict[str, Any]) -> Any:
    """What a JavaScript expression gave.

    Raises:
        ChannelError: it has thrown.
    """
    if "exceptionDetails" in answer:
        raise ChannelError(str(answer["exceptionDetails"]))
    return answer["result"].get("value")
