"""The `lightleash` command: one word chooses what it does."""

from __future__ import annotations

import os
import socket
import sys
from collections.abc import Callable, Sequence
from pathlib import Path

import server

HELP = f"""lightleash {server.__version__}: move your phone, and the robot follows

usage: lightleash COMMAND [OPTIONS]      (COMMAND --help tells its options)

  serve        server, control and simulated robot; prints the addresses of the pages
  invite       a link into the running server: --role viewer, operator or supervisor
  phone        a virtual phone that films the simulated robot and leads it
  replay       push a recorded phone through a server, or through the pipeline alone
  export       a recording in a format that others read: Foxglove, rosbag2, LeRobot, CSV
  import       a film of any phone, and its motion samples, as a recording
  locate       where the robot was in each picture of a folder or film, with its uncertainty
  experiments  measure the loop, as tables and pictures
  bench        how well it sees: right, exact, honest, fast; against stated goals
  calibrate    a camera: lens, readout time and motion sensors, from a film of a board
  robot        new: a first file; check: can it be flown; leds: can its LEDs be told apart, and
               would others be; key: make its key; bring-up: which thruster is which, by pulses;
               identify: what is it, by flights; onboard: its own computer, before a flight
               controller
  tune         find a robot's gains for a measured latency, under stated margins
  survey       where the LEDs are, from a film of the robot at rest
  warm         compile what must be fast, once; `serve` does so by itself
  check        what a recording tells of its phone: is it fit to lead with, and what to change
  doctor       what this machine can do: real time, certificates, ports, codecs; --phone: a link
"""


def _serve(argv: Sequence[str]) -> int:
    from server.common.settings import SettingsError, load
    from server.process import launcher

    try:
        settings = load(*_config_of(argv))
    except SettingsError as error:
        print(f"lightleash serve: {error}", file=sys.stderr)
        return 2
    return launcher.main(settings, argv)


def _server(argv: Sequence[str]) -> int:
    """The server process, as the launcher starts it."""
    from server.common.settings import load
    from server.process import server_process
    from server.process.launcher import SECRET_VARIABLE

    runtime, truth_port, https, http, *rest = argv
    given = server_process.LaunchContext(
        Path(runtime),
        int(truth_port),
        socket.socket(fileno=int(https)),
        socket.socket(fileno=int(http)),
        bytes.fromhex(os.environ.pop(SECRET_VARIABLE)),
    )
    return server_process.main(load(*_config_of(rest)), given)


def _config_of(argv: Sequence[str]) -> tuple[list[str], Path | None]:
    """Takes `--config FILE`, or `--config=FILE`, out of the arguments."""
    from server.common.settings import SettingsError

    arguments = list(argv)
    at = next((k for k, word in enumerate(arguments) if word.split("=")[0] == "--config"), None)
    if at is None:
        return arguments, None
    _, is_whole, text = arguments[at].partition("=")
    text = text if is_whole else "".join(arguments[at + 1 : at + 2])
    if not text:
        raise SettingsError("--config: a TOML file must follow")
    del arguments[at : at + (1 if is_whole else 2)]
    return arguments, Path(text)


def _invite(argv: Sequence[str]) -> int:
    from server.process.invite import main

    return main(list(argv))


def _phone(argv: Sequence[str]) -> int:
    from server.virtual_phone.command import main

    return main(list(argv))


def _replay(argv: Sequence[str]) -> int:
    from server.replay.command import main

    return main(list(argv))


def _export(argv: Sequence[str]) -> int:
    from server.export.command import main

    return main(list(argv))


def _import(argv: Sequence[str]) -> int:
    from server.tools.import_film.command import main

    return main(list(argv))


def _locate(argv: Sequence[str]) -> int:
    from server.tools.locate import main

    return main(list(argv))


def _experiments(argv: Sequence[str]) -> int:
    from server.experiments import main

    return main(list(argv))


def _bench(argv: Sequence[str]) -> int:
    from server.experiments.vision import main

    return main(list(argv))


def _calibrate(argv: Sequence[str]) -> int:
    from server.tools.calibrate.command import main

    return main(list(argv))


def _robot(argv: Sequence[str]) -> int:
    from server.tools.robot import main

    return main(list(argv))


def _tune(argv: Sequence[str]) -> int:
    from server.tools.tune.command import main

    return main(list(argv))


def _survey(argv: Sequence[str]) -> int:
    from server.tools.survey.command import main

    return main(list(argv))


def _warm(argv: Sequence[str]) -> int:
    from server.tools.warm import main

    return main(list(argv))


def _check(argv: Sequence[str]) -> int:
    from server.tools.check.command import main

    return main(list(argv))


def _doctor(argv: Sequence[str]) -> int:
    from server.tools.doctor import main

    return main(list(argv))


COMMANDS: dict[str, Callable[[Sequence[str]], int]] = {
    "serve": _serve,
    "invite": _invite,
    "phone": _phone,
    "replay": _replay,
    "export": _export,
    "import": _import,
    "locate": _locate,
    "experiments": _experiments,
    "bench": _bench,
    "calibrate": _calibrate,
    "robot": _robot,
    "tune": _tune,
    "survey": _survey,
    "warm": _warm,
    "check": _check,
    "doctor": _doctor,
    "_server": _server,
}


def main(argv: Sequence[str] | None = None) -> int:
    """Entry of the command."""
    words = list(sys.argv[1:] if argv is None else argv)
    if not words or words[0] in ("-h", "--help", "help"):
        print(HELP)
        return 0
    if words[0] in ("-V", "--version"):
        print(f"lightleash {server.__version__}")
        return 0
    command = COMMANDS.get(words[0])
    if command is None:
        known = ", ".join(name for name in COMMANDS if not name.startswith("_"))
        print(f"lightleash: {words[0]!r} is not one of {known}", file=sys.stderr)
        return 2
    try:
        return command(words[1:])
    except KeyboardInterrupt:
        return 130
