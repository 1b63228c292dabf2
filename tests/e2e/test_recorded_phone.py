"""What a real browser once sent is sent again over real websockets to a whole real server, a
supervisor resets, arms and stops, by socket and by the buttons of the page, and the robot moves."""

from __future__ import annotations

import contextlib
import subprocess
import sys
import time
from abc import ABC, abstractmethod
from collections.abc import Iterator
from contextlib import closing
from pathlib import Path

import numpy as np
import pytest

from hardware.sim.truth import TruthClient
from tests.e2e.chromium_rig import calibrate
from tests.e2e.clicked_page import ClickedPage, clicked_page
from tests.e2e.flight_log import Flight, FlightLog, to_its_end
from tests.e2e.serving import Serving, serving
from tests.e2e.test_serve import ANSWER_S, ZERO_N, mode, status, thrust, until
from tests.e2e.witness import Witness
from tests.machine import Load, slowness

pytestmark = [pytest.mark.e2e, pytest.mark.flight]
RECORDING = Path(__file__).parents[1] / "data" / "chromium.mcap"
CONNECTED_S, ARMED_S, PRESSED_S, DONE_S = 30.0, 5.0, 3.0, 3.0
STILL_M, MOVED_M = 0.0005, 0.003
"""How far the robot gets while nobody leads it, and how far that hand leads it at least."""
MOVED_S = 4.5
"""It has led it so far by then: the recording holds the button for 5 s."""


@pytest.fixture
def server(tmp_path: Path) -> Iterator[Serving]:
    """Of its own for each test: a robot that was stopped goes on swinging."""
    with serving(tmp_path, "--cameras", str(calibrate(tmp_path))) as running:
        yield running


class Supervisor(ABC):
    """Who resets, arms and stops."""

    @abstractmethod
    def request(self, what: str) -> None:
        """Ask for it once, as soon as that is possible."""


class Socket(Supervisor):
    """Without a page."""

    def __init__(self, log: FlightLog, server: Serving) -> None:
        self._log, self._server = log, server

    def request(self, what: str) -> None:
        if what == "arm":
            until(lambda: status(self._server)["ready"] is True, ARMED_S, "ready")
        self._log.request(what)


class ByPage(Supervisor):
    """The page's buttons."""

    def __init__(self, page: ClickedPage) -> None:
        self._page = page

    def request(self, what: str) -> None:
        is_possible = f"document.querySelector('#{what}').disabled === false"
        until(lambda: bool(self._page.evaluate(is_possible)), ARMED_S, f"{what} can be clicked")
        self._page.click(f"#{what}")


@pytest.fixture(params=["socket", "chromium", "firefox"])
def supervisor(request: pytest.FixtureRequest, server: Serving) -> Iterator[Supervisor]:
    if request.param == "socket":
        with contextlib.closing(FlightLog(server)) as log:
            yield Socket(log, server)
        return
    path = {"chromium": "chromium", "firefox": "firefox_path"}[request.param]
    with clicked_page(request.param, request.getfixturevalue(path)) as page:
        page.open(f"{server.http_url}/supervisor{server.link('supervisor')}")
        yield ByPage(page)


@contextlib.contextmanager
def recorded_phone(server: Serving) -> Iterator[None]:
    """The recorded browser is the phone; it ends with the recording."""
    command = [sys.executable, "-m", "server", "replay", str(RECORDING)]
    phone = subprocess.Popen(command, env=server.environment, stdout=subprocess.PIPE, text=True)
    try:
        until(lambda: status(server)["phones"] == 1, CONNECTED_S, "a phone")
        yield
    finally:
        phone.terminate()
        phone.communicate()


def flight(server: Serving, supervisor: Supervisor, witness: Witness) -> Flight:
    """From the reset to the place that proves that the hand leads; tried once."""
    began, never, load = time.monotonic(), "", Load()
    with (
        closing(TruthClient(server.truth_port, timeout=ANSWER_S)) as truth,
        closing(FlightLog(server)) as log,
        recorded_phone(server),
    ):
        supervisor.request("stop")
        until(lambda: mode(server) == "STOPPED", DONE_S, "STOPPED")
        supervisor.request("reset")
        until(lambda: mode(server) == "DISARMED", DONE_S, "DISARMED")
        p_start = truth.latest().p_bf_in_f[-1]

        def moved_m() -> float:
            return float(np.linalg.norm(truth.latest().p_bf_in_f[-1] - p_start))

        try:
            supervisor.request("arm")
            until(lambda: mode(server) == "ARMED", DONE_S, "ARMED")
            assert moved_m() < STILL_M
            until(lambda: mode(server) == "TRACK", PRESSED_S, "TRACK")
            until(lambda: moved_m() > MOVED_M, MOVED_S, "moved")
        except AssertionError as error:
            never = str(error)
        said = status(server)
        supervisor.request("stop")
        until(lambda: thrust(truth) < ZERO_N, DONE_S, "no thrust")
        until(lambda: mode(server) == "STOPPED", DONE_S, "STOPPED")
    spare, slow = load.spare, slowness()
    holes = witness.holes(began)
    return Flight(MOVED_S, [], said, log.said, holes, never, slowness=slow, spare=spare)


def test_a_recorded_browser_moves_the_robot_which_a_supervisor_resets_arms_and_stops(
    server: Serving, supervisor: Supervisor
) -> None:
    with closing(Witness()) as witness:
        flown = to_its_end(lambda: flight(server, supervisor, witness), lambda: None)
    assert flown.status["leds"] == 5
    assert "TRACK" in {said.mode for said in flown.said}
