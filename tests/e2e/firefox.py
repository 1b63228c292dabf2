"""A real Firefox, spoken to by WebDriver BiDi on a plain websocket, without a driver program."""

from __future__ import annotations

import contextlib
import json
import re
import shutil
import subprocess
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any, Literal

from websockets.sync.client import ClientConnection, connect

Pointer = Literal["touch", "mouse"]
START_S = 60.0
ANSWER_S = 60.0
PREFS = {
    "media.navigator.permission.disabled": True,
    "media.navigator.streams.fake": True,
    "media.peerconnection.ice.loopback": True,
    "media.peerconnection.ice.obfuscate_host_addresses": False,
    "device.sensors.enabled": True,
    "device.sensors.motion.enabled": True,
    "datareporting.policy.dataSubmissionEnabled": False,
    "app.update.enabled": False,
    "network.captive-portal-service.enabled": False,
    "network.connectivity-service.enabled": False,
    "browser.shell.checkDefaultBrowser": False,
    "dom.ipc.processPrelaunch.enabled": False,
    "remote.prefs.recommended": True,
}
"""Permissions without asking, and no word to anyone else."""
REST_S = 10.0
MIDDLE = """
(async () => {
  const box = () => {
    const {x, y, width, height} = document.querySelector(SELECTOR).getBoundingClientRect();
    return [x + width / 2, y + height / 2];
  };
  const before = box();
  await new Promise((resolve) => setTimeout(resolve, 100));
  const [x, y] = box();
  const there = document.elementFromPoint(x, y)?.closest(SELECTOR);
  return x === before[0] && y === before[1] && there && !there.disabled ? [x, y] : null;
})()
"""
"""Of an element [px]; null while it moves, is covered or can't be used: a page still grows when it
learns who it is."""
LISTENING = re.compile(r"WebDriver BiDi listening on (ws://\S+)")


class FirefoxError(Exception):
    """What Firefox answers when it can't do as it is told."""


class Session:
    """With the whole browser."""

    def __init__(self, socket: ClientConnection) -> None:
        """Opens it; certificates of our own authority are taken."""
        self._socket, self._count = socket, 0
        self.command("session.new", capabilities={"alwaysMatch": {"acceptInsecureCerts": True}})

    def tabs(self) -> list[str]:
        """Their ids, in the order they were opened."""
        tree = self.command("browsingContext.getTree", maxDepth=0)
        return [str(one["context"]) for one in tree["contexts"]]

    def command(self, method: str, **params: Any) -> dict[str, Any]:
        """Do something, and wait until it is done.

        Raises:
            FirefoxError: it was refused.
        """
        self._count += 1
        self._socket.send(json.dumps({"id": self._count, "method": method, "params": params}))
        while True:
            answer = json.loads(self._socket.recv(ANSWER_S))
            if answer.get("id") != self._count:
                continue  # an event
            if answer["type"] == "error":
                raise FirefoxError(f"{method}: {answer['error']}: {answer['message']}")
            result: dict[str, Any] = answer["result"]
            return result


class Firefox:
    """One tab."""

    def __init__(self, session: Session, tab: str) -> None:
        """`tab` is its id."""
        self.session, self._tab = session, tab

    def command(self, method: str, **params: Any) -> dict[str, Any]:
        """Do something in the browser, and wait until it is done; see `Session`."""
        return self.session.command(method, **params)

    def to_front(self) -> None:
        """Show it, and hide the others."""
        self.command("browsingContext.activate", context=self._tab)

    def close(self) -> None:
        """The tab, not the browser."""
        self.command("browsingContext.close", context=self._tab)

    def before_each_page(self, script: str) -> None:
        """Run a script before those of every page."""
        self.command("script.addPreloadScript", functionDeclaration=f"() => {{ {script} }}")

    def open(self, url: str) -> None:
        """Go to a page and wait until it is loaded."""
        self.command("browsingContext.navigate", context=self._tab, url=url, wait="complete")

    def size(self, width: int, height: int) -> None:
        """Of the window's inside [px]."""
        viewport = {"width": width, "height": height}
        self.command("browsingContext.setViewport", context=self._tab, viewport=viewport)

    def evaluate(self, expression: str) -> Any:
        """The value of a JavaScript expression, by way of JSON; promises are awaited.

        Raises:
            FirefoxError: it has thrown.
        """
        answer = self.command(
            "script.evaluate",
            expression=f"Promise.resolve({expression}).then((v) => JSON.stringify(v ?? null))",
            target={"context": self._tab},
            awaitPromise=True,
            userActivation=True,
        )
        if answer["type"] == "exception":
            raise FirefoxError(answer["exceptionDetails"]["text"])
        return json.loads(answer["result"]["value"])

    def act(self, pointer: Pointer, *actions: dict[str, object]) -> None:
        """What a finger or a mouse does."""
        source = {"type": "pointer", "id": pointer, "parameters": {"pointerType": pointer}}
        self.command(
            "input.performActions", context=self._tab, actions=[{**source, "actions": actions}]
        )

    def press(self, selector: str, pointer: Pointer = "touch") -> None:
        """Press the middle of an element that rests, and stay there.

        Raises:
            FirefoxError: it moves on, or something lies over it.
        """
        end = time.monotonic() + REST_S
        while (middle := self.evaluate(MIDDLE.replace("SELECTOR", json.dumps(selector)))) is None:
            if time.monotonic() > end:
                raise FirefoxError(f"{selector} does not come to rest in {REST_S:g} s")
        x, y = map(round, middle)
        self.act(
            pointer,
            {"type": "pointerMove", "x": x, "y": y, "duration": 0},
            {"type": "pointerDown", "button": 0},
        )

    def release(self, pointer: Pointer = "touch") -> None:
        """Press no more."""
        self.act(pointer, {"type": "pointerUp", "button": 0})

    def tap(self, selector: str, pointer: Pointer = "touch") -> None:
        """Press an element shortly."""
        self.press(selector, pointer)
        self.release(pointer)


@contextlib.contextmanager
def firefox(executable: str, **prefs: object) -> Iterator[Firefox]:
    """A Firefox with a profile of its own and further `prefs`, ended at the end."""
    profile = Path(tempfile.mkdtemp(prefix="lightleash-firefox-"))
    lines = [f"user_pref({json.dumps(k)}, {json.dumps(v)});" for k, v in (PREFS | prefs).items()]
    (profile / "user.js").write_text("\n".join(lines))
    log = (profile / "firefox.log").open("wb")
    command = [executable, "--headless", "--no-remote", "--remote-debugging-port", "0"]
    process = subprocess.Popen(
        [*command, "--profile", str(profile), "about:blank"], stdout=log, stderr=log
    )
    try:
        url = f"{_address(process, profile / 'firefox.log')}/session"
        with connect(url, compression=None, max_size=None, proxy=None) as socket:
            session = Session(socket)
            yield Firefox(session, session.tabs()[0])
    finally:
        process.terminate()
        try:
            process.wait(15.0)
        except subprocess.TimeoutExpired:
            process.kill()
            process.wait()
        log.close()
        shutil.rmtree(profile, ignore_errors=True)


def _address(process: subprocess.Popen[bytes], log: Path) -> str:
    """Where it listens, as it says itself."""
    end = time.monotonic() + START_S
    while time.monotonic() < end and process.poll() is None:
        found = LISTENING.search(log.read_text(errors="replace"))
        if found:
            return found[1]
        time.sleep(0.1)
    raise FirefoxError(f"it does not listen: {log.read_text(errors='replace')[-500:]}")
