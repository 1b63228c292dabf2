"""`lightleash serve`: starts robot, control and server, and stops them, robot first."""

from __future__ import annotations

import contextlib
import json
import os
import secrets
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TextIO

import msgspec

from hardware.follower import FollowerError
from hardware.link.link_key import KEY_VARIABLE, LinkKeyError, new_key
from hardware.link.registry import link_kind
from hardware.plant_parameters import ArmParameters
from hardware.robot_file import COMMANDS, RobotFileError, load_robot
from server.common import clock
from server.common.access import PhoneClientError
from server.common.child import Child, die_with, ending, watched
from server.common.runtime import RUN_FILE, BusyError, prepare, runtime_directory
from server.common.settings import GAINS, Settings
from server.process.invite import invite, print_code
from server.process.ports import listening
from server.process.robot_claim import claimed
from server.process.robot_key import epoch_file, key_of

MAX_DEATHS = 4
"""Of one process before anything worked: better end, with the reason on the screen."""
POLL_S = 0.05
REMIND_S = 15.0
"""People wait longer for what still speaks."""
FLIES, SERVES = -900, 300
"""Who dies first when memory runs out: the server is started anew and nothing falls down."""
NOT_WARM = (
    "`lightleash warm` ended by {}: its reason, if it had time for one, stands above. Robot, "
    "control and server start all the same, and compile for themselves, for minutes."
)
SECRET_VARIABLE = "_LIGHTLEASH_SECRET"


def free_udp_port() -> int:
    """A port nobody uses now."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        probe.bind(("127.0.0.1", 0))
        port: int = probe.getsockname()[1]
        return port


def say(text: str, to: TextIO | None = None) -> None:
    """Print; that nobody reads it any more, for his terminal has gone, ends nothing."""
    with contextlib.suppress(OSError):
        print(text, file=to, flush=True)


class Launcher:
    """Keeps the processes alive until told to stop."""

    def __init__(self, children: Sequence[Child], run_file: Path) -> None:
        """`children` are stopped in this order; the server tells of itself in `run_file`."""
        self.children = children
        self._run_file = run_file
        self._stopping = False

    def stop(self, *_: object) -> None:
        """End soon; may be called from a signal handler."""
        self._stopping = True

    def run(self) -> int:
        """Start, announce, watch, stop; gives the exit code."""
        announced, said = False, clock.now()
        names = ", ".join(child.name for child in self.children)
        say(f"Starting {names}: some seconds.")
        try:
            while not self._stopping:
                self.revive(clock.now())
                if not announced and self._run_file.exists():
                    announced = True
                    self._announce()
                if not announced and self._is_hopeless():
                    return 1
                if not announced and clock.now() - said > REMIND_S:
                    said = clock.now()
                    say("Still starting: this computer is slow, or busy elsewhere.")
                time.sleep(POLL_S)
        finally:
            say("\nStopping: robot first.")
            for child in self.children:
                child.stop()
            self._run_file.unlink(missing_ok=True)
        return 0

    def _announce(self) -> None:
        try:
            announce(json.loads(self._run_file.read_text()))
        except (OSError, PhoneClientError) as error:  # the server has just died: it comes back
            say(f"{error}; `lightleash invite` prints links.", sys.stderr)

    def revive(self, now: float) -> None:
        """Start whoever should run and doesn't."""
        for child in self.children:
            said = child.revive(now)
            if said:
                say(said, sys.stderr)

    def _is_hopeless(self) -> bool:
        worst = max(self.children, key=lambda child: child.deaths)
        if worst.deaths < MAX_DEATHS:
            return False
        say(f"The {worst.name} process does not start: see above.", sys.stderr)
        return True


def children_of(
    settings: Settings,
    arguments: Sequence[str],
    runtime: Path,
    sockets: tuple[socket.socket, socket.socket],
) -> list[Child]:
    """Robot, control, server: the order in which they are stopped.

    `sockets` (HTTPS, HTTP) and the secret of the run outlive the server process: one that is
    started anew has the same address and still knows its pages.

    Robot and control share a key: of a real robot its own, of a simulated one another each run.

    Raises:
        RobotFileError: no such robot, or it has no such gains.
        LinkKeyError: a real robot without a key.
        FollowerError: nobody here knows the kind of its link.
    """
    robot_file = load_robot(settings.robot, takes=COMMANDS)
    name = robot_file.robot.name
    if robot_file.robot.twist is not None:
        if settings.gains != GAINS:
            raise RobotFileError(settings.robot, "gains", "none: it takes a twist, by [twist]")
    elif settings.gains not in robot_file.gains:
        raise RobotFileError(settings.robot, "gains", f"one of {', '.join(robot_file.gains)}")
    if settings.simulate and (arm := robot_file.plant.arm) is not None:
        _refuse_unless_movable(settings.robot, arm)
    link = robot_file.link
    host, port = settings.robot_host or link.host, settings.robot_port or link.port
    truth_port, children = 0, []
    key, epochs = new_key(), runtime / f"{name}.epoch"
    if not settings.simulate:
        is_keyed = link_kind(link.kind).keyed
        key = key_of(settings.state, name, settings.robot) if is_keyed else new_key()
        epochs = epoch_file(settings.state, name)
    shared = {KEY_VARIABLE: key.hex()}
    if settings.simulate:
        host, port, truth_port = "127.0.0.1", free_udp_port(), free_udp_port()
        simulated = ["hardware.sim.robot", "--robot", settings.robot, "--port", str(port)]
        simulated += ["--truth-port", str(truth_port)]
        if (full_v := settings.simulated.battery_v) is not None:
            drain_v_min = settings.simulated.drain_v_min
            simulated += ["--battery-v", str(full_v), "--drain-v-min", str(drain_v_min)]
        simulated += ["--e-stop"] * settings.simulated.e_stop
        children.append(Child("robot", simulated, shared, oom_score=FLIES))
    control = ["server.control.process", "--runtime", str(runtime), "--robot", settings.robot]
    control += ["--host", host, "--port", str(port), "--gains", settings.gains]
    control += ["--estimator", settings.estimator, "--epochs", str(epochs)]
    control += [] if settings.simulate else ["--real"]
    knobs = msgspec.json.encode(settings.virtual_camera.knobs).decode()
    control += ["--virtual-camera", knobs]
    children.append(Child("control", control, shared, oom_score=FLIES))
    descriptors = tuple(s.fileno() for s in sockets)
    server = ["server", "_server", str(runtime), str(truth_port), *map(str, descriptors)]
    secret = {SECRET_VARIABLE: secrets.token_hex(32)}
    server += arguments
    children.append(Child("server", server, secret, descriptors, SERVES, is_prompt=True))
    return children


def _refuse_unless_movable(robot: str, arm: ArmParameters) -> None:
    """A simulated arm that can't be would end as often as it is started.

    Raises:
        RobotFileError: it says why.
    """
    # With MuJoCo, for which no other robot waits.
    from hardware.arm.arm_model import ArmError
    from hardware.arm.movable import movable

    try:
        movable(arm)
    except ArmError as error:
        key = ".".join(filter(None, ("arm", error.key)))
        raise RobotFileError(robot, key, error.allowed) from error


def announce(run: Mapping[str, object]) -> None:
    """Print what a newcomer needs: the code to scan and the page to open.

    Links are for people at a terminal alone: what goes elsewhere is kept in logs.
    """
    inviting = "lightleash invite" + (f" --name {run['name']}" if run["name"] else "")
    if sys.stdout.isatty():
        phone, supervisor = invite(run, "operator"), invite(run, "supervisor")
        print_code(phone.url)
        print(f"\nPhone:       {phone.url}")
        print(f"Supervisor:  {supervisor.here}")
        print(f"Each opens once, within {phone.lives_s / 60:g} minutes; `{inviting}`, with")
        print("--role viewer or supervisor or without, prints another one.")
        print(f"A warning?   {_without_tls(str(run['https_url']))}/ says how to trust this server.")
    else:
        print(f"\nPhone:       {run['https_url']}/ by a link of `{inviting}`")
        print(f"Supervisor:  {run['http_url']}/supervisor by `{inviting} --role supervisor`")
    if run["truth_port"]:  # the robot is a simulated one
        print("No phone at hand? Press “Start virtual phone” on the supervisor's page.")
    print("Ctrl-C stops, robot first.", flush=True)


def _without_tls(url: str) -> str:
    """Where the same port tells who speaks plain HTTP what to do."""
    return url.replace("https://", "http://", 1)


def _compile() -> None:
    """What they all need is compiled once, by one process, which tells how long that takes.

    What fails there they do for themselves, each more slowly: no reason not to start, but to say.
    """
    parent = os.getpid()
    done = subprocess.run(
        [sys.executable, "-m", *watched(["server", "warm"], parent)],
        preexec_fn=lambda: die_with(parent),
        stdin=subprocess.DEVNULL,
        stdout=subprocess.DEVNULL,
        check=False,
    )
    if done.returncode:
        print(NOT_WARM.format(ending(done.returncode)), file=sys.stderr, flush=True)


def main(settings: Settings, arguments: Sequence[str]) -> int:
    """Entry of `lightleash serve`; `arguments` are handed on to the server process."""
    os.umask(0o077)  # whatever is written, by the children too, is for this user alone
    runtime = runtime_directory(settings.name)
    try:
        with (
            prepare(runtime, runtime_directory()),
            claimed(settings),
            listening(settings, print) as sockets,
        ):
            children = children_of(settings, arguments, runtime, sockets)
            _compile()
            launcher = Launcher(children, runtime / RUN_FILE)
            for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
                signal.signal(number, launcher.stop)
            return launcher.run()
    except (RobotFileError, LinkKeyError, FollowerError, BusyError, OSError) as error:
        print(f"lightleash serve: {error}", file=sys.stderr)
        return 2
