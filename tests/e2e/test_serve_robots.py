"""`lightleash serve --robot …`: other robots behind real processes and sockets are followed."""

from __future__ import annotations

import json
import subprocess
import sys
import time
from contextlib import closing
from pathlib import Path

import numpy as np
import pytest

from hardware.sim.truth import TruthClient
from server.recording.reader import read
from server.recording.writer import STATUS
from server.virtual_phone import live_loop
from tests.e2e.serving import Serving, serving
from tests.e2e.test_serve import ANSWER_S, mode, status, until

pytestmark = [pytest.mark.e2e, pytest.mark.flight]
STANDS_M_S = 1e-3
FOLLOWS_S = 6.0


@pytest.mark.parametrize(
    ("robot", "seconds", "bound_mm"), [("quadrotor", 14, 60), ("copter", 14, 60), ("ground", 8, 40)]
)
def test_a_virtual_phone_leads_the_robot_the_server_names(
    robot: str, seconds: float, bound_mm: float
) -> None:
    with live_loop.server(robot, "phone") as environment:
        summary = live_loop.fly(environment, "demo", seconds, seed=1)
    assert float(summary["tracked_s"]) > 0.5 * seconds
    assert float(summary["rms_mm"]) < bound_mm


def told_mm_s(server: Serving) -> float:
    return float(str(status(server)["told_mm_s"]))


def speed_m_s(truth: TruthClient) -> float:
    """Of the simulated robot, over the last of its ticks."""
    newest = truth.latest()
    way = newest.p_bf_in_f[-1] - newest.p_bf_in_f[-2]
    return float(np.linalg.norm(way) / (newest.t[-1] - newest.t[-2]))


def twists(folder: Path) -> np.ndarray:
    """(n, 6) told in each status of the only recording in `folder` [m/s, rad/s]."""
    (path,) = folder.glob("*.mcap")
    states = [json.loads(entry.data) for entry in read(path).entries(STATUS)]
    return np.array([state["twist_in_b"] for state in states], dtype=np.float64)


@pytest.mark.parametrize("robot", ["twister", "so101"])
def test_a_robot_that_takes_a_twist_follows_and_is_told_to_stand_still_by_stop(
    robot: str, tmp_path: Path
) -> None:
    words = ["phone", "--hand", "demo", "--rest", "1", "--seed", "1"]
    command = [sys.executable, "-m", "server", *words]
    with (
        serving(tmp_path, "--robot", robot) as server,
        closing(TruthClient(server.truth_port, timeout=ANSWER_S)) as truth,
    ):
        assert status(server)["takes"] == "twist"
        server.request("POST", "/api/recording")
        with subprocess.Popen(
            command, env=server.environment, stdout=subprocess.PIPE, text=True
        ) as phone:
            try:
                until(lambda: mode(server) == "ARMED", 60.0, "ARMED")
                assert told_mm_s(server) == 0.0
                until(lambda: mode(server) == "TRACK", 20.0, "TRACK")
                time.sleep(FOLLOWS_S)
                until(lambda: told_mm_s(server) > 20.0 < 1e3 * speed_m_s(truth), 10.0, "moving")
                server.request("POST", "/api/stop")
                until(lambda: mode(server) == "STOPPED", 1.0, "STOPPED")
                assert (told_mm_s(server), status(server)["told_deg_s"]) == (0.0, 0.0)
                until(lambda: speed_m_s(truth) < STANDS_M_S, 1.0, "standing still")
            finally:
                phone.terminate()
            assert phone.stdout is not None
            summary = json.loads(phone.stdout.read().splitlines()[-1])
        server.request("DELETE", "/api/recording")
        told = twists(server.state / "recordings")
    assert summary["tracked_s"] > 0.8 * FOLLOWS_S
    assert summary["rms_mm"] < 40.0
    assert np.isfinite(told).all()
    assert not told[0].any()
    assert told.any()
    assert not told[-1].any()
