"""`lightleash serve` for real: its addresses, and the death of each of its processes in flight."""

from __future__ import annotations

import contextlib
import json
import os
import signal
import ssl
import subprocess
import sys
import threading
import time
import urllib.error
import urllib.request
from collections.abc import Callable, Iterator
from contextlib import closing
from math import inf
from pathlib import Path

import numpy as np
import pytest
from cryptography import x509
from cryptography.hazmat.primitives import hashes
from websockets.sync.client import connect

from hardware.follower import FollowerError
from hardware.robot_file import load_robot
from hardware.sim.truth import TruthClient
from server.protocol.messages import Status, decode_from_server
from server.protocol.wire import VERSION
from server.recording.reader import read
from server.recording.writer import SERVER_MESSAGES
from tests.e2e.flight_log import FlightLog
from tests.e2e.serving import Serving, serving

pytestmark = pytest.mark.e2e
MODULES = {"robot": "hardware.sim.robot", "control": "server.control.process", "server": "_server"}
ZERO_N = 1e-3
RAMP_S = 6.0
"""A ramp of one period of the suspension, with the failsafe's waits before it."""
OWN_RAMP_S = load_robot("ames").robot.ramp_s
"""Of the robot by itself, from the last command that it took, however much that asked for."""
COASTS_S = 0.2
"""By then it gives what it falls from."""
LOST_S = 0.3
"""Of a recording, at most, by a server that is killed."""
ANSWER_S = 0.5
"""A robot that has not told its thrust by then is taken for dead: 50 ms are few when it is busy."""


@pytest.fixture(scope="module")
def server(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Serving]:
    with serving(tmp_path_factory.mktemp("serve")) as running:
        yield running


def until(
    condition: Callable[[], bool],
    seconds: float,
    what: str,
    instead: Callable[[], object] = lambda: "",
) -> float:
    """Wait for it; gives how long that took [s]. A failure shows what there is `instead`."""
    start = time.monotonic()
    while not condition():
        late = time.monotonic() > start + seconds
        assert not late, f"after {seconds} s still not: {what}; {instead()}"
        time.sleep(0.02)
    return time.monotonic() - start


def processes(launcher: int) -> dict[str, int]:
    """The launcher's children by name."""
    found: dict[str, int] = {}
    for pid in Path(f"/proc/{launcher}/task/{launcher}/children").read_text().split():
        with contextlib.suppress(OSError):
            words = Path(f"/proc/{pid}/cmdline").read_text().split("\0")
            found |= {name: int(pid) for name, module in MODULES.items() if module in words}
    return found


def status(server: Serving) -> dict[str, object]:
    return server.request("GET", "/api/status")


def mode(server: Serving) -> str:
    """As the server says; "" while it says nothing."""
    with contextlib.suppress(urllib.error.URLError, OSError, TypeError):
        return str(status(server)["mode"])
    return ""


def body_imu_rate_hz(server: Serving) -> float:
    streams = status(server)["streams"]
    assert isinstance(streams, dict)
    return float(streams["body_imu"]["rate_hz"])


def thrust(truth: TruthClient) -> float:
    """Sum of the thrusts the simulated robot makes [N]; zero while it is dead."""
    try:
        return float(np.abs(truth.latest().thrusts).sum())
    except FollowerError:
        return 0.0


@contextlib.contextmanager
def flight(server: Serving, *options: str) -> Iterator[subprocess.Popen[bytes]]:
    """A virtual phone leads the robot."""
    command = [sys.executable, "-m", "server", "phone", "--hand", "steady", "--rest", "1"]
    phone = subprocess.Popen(
        [*command, *options], env=server.environment, stdout=subprocess.PIPE, bufsize=0
    )
    try:
        until(lambda: mode(server) == "TRACK", 60.0, "TRACK", lambda: status(server))
        with closing(TruthClient(server.truth_port, timeout=ANSWER_S)) as truth:
            until(lambda: thrust(truth) > 1.0, 2.0, "thrust, which begins without a jump")
        yield phone
    finally:
        phone.terminate()
        try:
            phone.wait(10.0)
        except subprocess.TimeoutExpired:
            phone.kill()
            phone.wait()
        assert phone.stdout is not None
        phone.stdout.close()
        until(lambda: mode(server) == "DISARMED", 20.0, "DISARMED")


def kill(server: Serving, name: str, number: signal.Signals = signal.SIGKILL) -> int:
    os.kill(pid := processes(server.process.pid)[name], number)
    return pid


def get(url: str, context: ssl.SSLContext | None = None) -> tuple[int, bytes]:
    with urllib.request.urlopen(url, timeout=5.0, context=context) as response:
        return response.status, response.read()


def test_its_addresses_answer_and_the_certificate_holds_for_who_trusts_its_authority(
    server: Serving,
) -> None:
    trusting = server.trusting()
    for base in (server.https_url, server.local_https):
        assert b"src/app/main.js" in get(f"{base}/", trusting)[1]
    with pytest.raises(urllib.error.URLError, match="CERTIFICATE"):
        get(f"{server.https_url}/")
    assert b"src/dashboard/main.js" in get(f"{server.http_url}/supervisor")[1]


def test_who_asks_the_https_port_in_plain_text_is_told_how_to_trust_it_and_nothing_else(
    server: Serving,
) -> None:
    plain = server.https_url.replace("https://", "http://")
    _, page = get(f"{plain}/")
    _, authority = get(f"{plain}/ca.crt")
    shown = x509.load_pem_x509_certificate(authority).fingerprint(hashes.SHA256()).hex(":").upper()
    assert shown in page.decode()
    assert f'href="{server.https_url}/"' in page.decode()
    for path in ("/supervisor", "/api/status", "/src/app/main.js", "/healthz"):
        with pytest.raises(urllib.error.HTTPError, match=r"40[1234]"):
            get(f"{plain}{path}")
    assert json.loads(get(f"{server.http_url}/healthz")[1])["ok"]


def open_to_others(folder: Path) -> list[str]:
    """Files and directories, sockets too, that others than their user may do anything with."""
    found = [folder, *folder.rglob("*")]
    return [f"{path} {mode:o}" for path in found if (mode := path.stat().st_mode & 0o777) & 0o077]


def test_no_secret_is_in_a_command_line(server: Serving) -> None:
    for pid in (server.process.pid, *processes(server.process.pid).values()):
        words = Path(f"/proc/{pid}/cmdline").read_text()
        assert server.operator_token not in words
        assert server.supervisor_token not in words


def test_all_three_run_and_wait_for_a_phone(server: Serving) -> None:
    assert set(processes(server.process.pid)) == set(MODULES)
    until(lambda: mode(server) == "DISARMED", 5.0, "DISARMED")
    until(lambda: "No phone" in str(status(server)["refusals"]), 5.0, "what is missing")


def test_a_second_one_in_the_same_place_is_refused_and_the_first_goes_on(server: Serving) -> None:
    command = [sys.executable, "-m", "server", "serve", "--https-port", "0", "--http-port", "0"]
    done = subprocess.run(command, env=server.environment, capture_output=True, text=True)
    assert done.returncode == 2
    assert "runs already" in done.stderr
    assert status(server)["mode"] == "DISARMED"


@pytest.mark.flight
@pytest.mark.parametrize(
    ("path", "words"), [("webrtc", "WebRTC, H264"), ("websocket", "websocket")]
)
def test_a_virtual_phone_leads_the_robot_by_either_path(
    path: str, words: str, server: Serving
) -> None:
    with flight(server, "--path", path) as phone:
        until(lambda: str(status(server)["video_path"]).startswith(words), 5.0, words)
        time.sleep(4.0)
        assert phone.poll() is None, "it left, and said why"
        streams = status(server)["streams"]
        assert isinstance(streams, dict)
        assert streams["phone_imu"]["rate_hz"] > 30.0
        assert streams["pose"]["rate_hz"] > 5.0
        link = server.request("GET", "/api/link?seconds=4")
        assert float(str(link["motion_hz"])) > 30.0
        assert float(str(link["picture_hz"])) > 5.0
        assert link["rtt_ms"] is not None
        phone.terminate()
        assert phone.stdout is not None
        summary = json.loads(phone.stdout.read().decode().splitlines()[-1])
    assert summary["tracked_s"] > 2.0
    assert summary["rms_mm"] < 100.0


def test_what_it_leaves_on_the_disk_is_for_its_user_alone(server: Serving) -> None:
    server.request("POST", "/api/recording")
    time.sleep(0.5)
    assert open_to_others(server.state / "recordings") == []
    server.request("DELETE", "/api/recording")
    assert list((server.state / "recordings").glob("*.mcap"))
    assert {path.name for path in server.runtime.iterdir()} >= {"lightleash-run.json", "view.sock"}
    assert open_to_others(server.runtime) == []
    assert open_to_others(server.state) == []


class ThrustLog:
    """Thrust by the robot's own time, looked at from a thread that waits for no server."""

    def __init__(self, server: Serving) -> None:
        self._truth = TruthClient(server.truth_port, timeout=ANSWER_S)
        self._is_over = threading.Event()
        self.seen: list[tuple[float, float]] = []
        """(t [s], sum of the thrusts [N])."""
        self._thread = threading.Thread(target=self._look)
        self._thread.start()

    def _look(self) -> None:
        while not self._is_over.wait(0.01):
            with contextlib.suppress(FollowerError):  # next time
                truth = self._truth.latest()
                self.seen.append((float(truth.t[-1]), float(np.abs(truth.thrusts).sum())))

    def close(self) -> None:
        self._is_over.set()
        self._thread.join()
        self._truth.close()

    @property
    def over(self) -> float:
        """When there was none any more [s]; inf: there still is."""
        return min((t for t, total in self.seen if total < ZERO_N), default=inf)

    def at(self, t: float) -> float:
        """The last that was seen until then [N]."""
        return [total for seen, total in self.seen if seen <= t][-1]


@pytest.mark.parametrize("number", [signal.SIGKILL, signal.SIGTERM], ids=["killed", "ended"])
def test_control_killed_in_flight_lets_the_robot_ramp_down_and_comes_back_disarmed(
    server: Serving, number: signal.Signals
) -> None:
    with (
        closing(TruthClient(server.truth_port, timeout=ANSWER_S)) as truth,
        flight(server) as phone,
        closing(FlightLog(server)) as log,
        closing(ThrustLog(server)) as thrusts,
    ):
        assert thrust(truth) > 1.0
        killed, pid = time.monotonic(), kill(server, "control", number)
        phone.send_signal(signal.SIGSTOP)  # it would arm again
        try:
            until(lambda: thrusts.over < inf, 2 * RAMP_S, "no thrust")
            assert thrusts.over - killed > 0.95 * OWN_RAMP_S, thrusts.seen
            full, half = thrusts.at(killed + COASTS_S), thrusts.at(killed + OWN_RAMP_S / 2)
            assert half > 0.4 * full, thrusts.seen
            until(lambda: mode(server) == "DISARMED", 10.0, "DISARMED")
            assert "LOST" in [said.mode for said in log.said]
            assert processes(server.process.pid)["control"] != pid
            assert thrust(truth) < ZERO_N
        finally:
            phone.send_signal(signal.SIGCONT)


def test_the_server_killed_in_flight_leaves_control_to_ramp_down_and_comes_back_as_it_was(
    server: Serving,
) -> None:
    with (
        closing(TruthClient(server.truth_port, timeout=ANSWER_S)) as truth,
        flight(server) as phone,
    ):
        assert thrust(truth) > 1.0
        control = processes(server.process.pid)["control"]
        kill(server, "server")
        phone.send_signal(signal.SIGSTOP)
        try:
            until(lambda: thrust(truth) < ZERO_N, RAMP_S, "no thrust")
            until(lambda: mode(server) == "DISARMED", 10.0, "DISARMED, with the old token")
            assert processes(server.process.pid)["control"] == control
        finally:
            phone.send_signal(signal.SIGCONT)


def test_a_server_killed_while_it_records_loses_the_last_moment_and_mends_the_recording(
    server: Serving,
) -> None:
    folder = server.state / "recordings"
    with flight(server) as phone:
        name = str(server.request("POST", "/api/recording")["name"])
        until(lambda: status(server)["recording"] == name, 1.0, "a recording in the status")
        time.sleep(1.0)
        heard_ms = int(str(status(server)["time_ms"]))
        kill(server, "server")
        assert (folder / f"{name}.mcap.part").exists()
        phone.send_signal(signal.SIGSTOP)  # it would arm again
        try:
            until(lambda: mode(server) == "DISARMED", 20.0, "a server that is back")
            mended = read(folder / f"{name}.mcap")
            told = [decode_from_server(entry.data) for entry in mended.entries(SERVER_MESSAGES)]
            kept_ms = max(one.time_ms for one in told if isinstance(one, Status))
            assert heard_ms - kept_ms <= 1e3 * LOST_S  # by the server's own clock
            assert list(mended.phone_records())
        finally:
            phone.send_signal(signal.SIGCONT)


def test_a_robot_killed_in_flight_does_not_fly_on_when_it_is_back(server: Serving) -> None:
    with (
        closing(TruthClient(server.truth_port, timeout=ANSWER_S)) as truth,
        flight(server) as phone,
    ):
        pid = kill(server, "robot")
        phone.send_signal(signal.SIGSTOP)
        try:
            until(
                lambda: processes(server.process.pid).get("robot") not in (pid, None), 5.0, "back"
            )
            until(lambda: mode(server) == "DISARMED", 10.0, "DISARMED")
            until(lambda: body_imu_rate_hz(server) > 100.0, 10.0, "the robot's samples")
            assert thrust(truth) < ZERO_N
        finally:
            phone.send_signal(signal.SIGCONT)


def test_stop_over_plain_http_cuts_at_once_and_stays(server: Serving) -> None:
    with closing(TruthClient(server.truth_port, timeout=ANSWER_S)) as truth, flight(server):
        assert thrust(truth) > 1.0
        server.request("POST", "/api/stop")
        until(lambda: thrust(truth) < ZERO_N, 1.0, "no thrust")
        until(lambda: mode(server) == "STOPPED", 1.0, "STOPPED")
        until(lambda: "reset" in str(status(server)["refusals"]), 3.0, "reset")
        reset(server)


def reset(server: Serving) -> None:
    """As a supervisor's page does it."""
    url = server.http_url.replace("http", "ws") + "/ws/supervisor"
    headers = {"Authorization": f"Bearer {server.supervisor_token}"}
    with connect(url, additional_headers=headers, proxy=None) as page:
        page.send(json.dumps({"type": "hello", "version": VERSION, "role": "supervisor"}))
        page.recv()
        for _ in range(20):
            page.send(json.dumps({"type": "command", "what": "reset"}))
            time.sleep(0.1)
            if mode(server) != "STOPPED":
                return
    raise AssertionError("reset was not granted")


def test_ctrl_c_ends_all_robot_first_and_leaves_no_socket(tmp_path: Path) -> None:
    with serving(tmp_path) as server:
        pids = processes(server.process.pid)
        assert set(pids) == set(MODULES)
        server.process.send_signal(signal.SIGINT)
        assert server.process.wait(15.0) == 0
    assert not [pid for pid in pids.values() if Path(f"/proc/{pid}").exists()]
    assert not list(server.runtime.glob("*.sock"))
    assert not (server.runtime / "lightleash-run.json").exists()
    assert "Stopping: robot first." in (tmp_path / "serve.log").read_text()


def test_a_launcher_killed_takes_its_processes_with_it(tmp_path: Path) -> None:
    with serving(tmp_path) as server:
        pids = processes(server.process.pid)
        server.process.kill()
        server.process.wait()
        until(lambda: not any(map(running, pids.values())), 5.0, "all gone")


def running(pid: int) -> bool:
    """Alive, and no zombie."""
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    except OSError:
        return False
