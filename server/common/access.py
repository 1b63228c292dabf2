"""Where a server is and what opens its door: from its run file, or from the command line."""

from __future__ import annotations

import argparse
import ssl
import urllib.request
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from urllib.parse import urlsplit

import msgspec

from pipeline.config import VirtualCameraConfig
from server.common.options import add_name_argument
from server.common.runtime import RUN_FILE, runtime_directory, servers_here
from server.common.runtime_parameters import RuntimeParameters

DEFAULT_CAMERA = VirtualCameraConfig()


class PhoneClientError(Exception):
    """The server can't be found, or doesn't take us; says why in words."""


def direct(tls: ssl.SSLContext | None = None) -> urllib.request.OpenerDirector:
    """Opens past the environment's proxies, which reach no robot and must not learn a key."""
    https = urllib.request.HTTPSHandler(context=tls)
    return urllib.request.build_opener(urllib.request.ProxyHandler({}), https)


@dataclass(frozen=True, slots=True)
class Access:
    """Where a server is and what opens its door."""

    url: str
    """http://… or https://…"""
    token: str
    truth_port: int = 0
    """UDP port of the simulated robot's true pose; 0: not known."""
    robot: str = "ames"
    """Name or path of its robot file."""
    ca: Path | None = None
    """Certificate of the authority that signed the server's."""
    virtual_camera: VirtualCameraConfig = DEFAULT_CAMERA
    """How the server smooths the phone's turns: its lag is no tracking error."""


def run_of(directory: Path | None = None, or_else: str = "") -> dict[str, object]:
    """The run file of the server in `directory`, else of the one here that has no name.

    `or_else` is what whoever asks can do but start one, in words.

    Raises:
        PhoneClientError: there is none, or it makes no sense.
    """
    path = (directory or runtime_directory()) / RUN_FILE
    try:
        return msgspec.json.decode(path.read_bytes(), type=dict[str, object])
    except FileNotFoundError as error:
        raise PhoneClientError(_nobody(path, or_else)) from error
    except (OSError, msgspec.MsgspecError) as error:
        raise PhoneClientError(f"{path}: not a run file of `lightleash serve`: {error}") from error


def _nobody(path: Path, or_else: str) -> str:
    """Why there is no run file, and where there is one."""
    others = [name for name, one in servers_here().items() if (one / RUN_FILE).exists()]
    if not others:
        return f"no server is running here: start `lightleash serve`{or_else}"
    words = (f"--name {name}" if name else "one without --name" for name in others)
    return f"no server is running in {path.parent}; there is {', '.join(words)}"


def running_server(directory: Path | None = None) -> Access:
    """The server running on this machine, as its run file tells.

    Raises:
        PhoneClientError: there is none, or its run file makes no sense.
    """
    run = run_of(directory, ", or name one with --url")
    try:
        url = run["http_url"] or run["https_url"]
        knobs = run.get("virtual_camera")
        return Access(
            str(url),
            str(run["operator_token"]),
            int(str(run.get("truth_port") or 0)),
            str(run.get("robot") or "ames"),
            virtual_camera=msgspec.convert(knobs, RuntimeParameters).config()
            if knobs
            else DEFAULT_CAMERA,
        )
    except (ValueError, LookupError, TypeError, msgspec.MsgspecError) as error:
        why = f"{RUN_FILE}: not a run file of `lightleash serve`: {error}"
        raise PhoneClientError(why) from error


def add_access_arguments(parser: argparse.ArgumentParser) -> None:
    """The options that say where the server is."""
    add_name_argument(parser)
    parser.add_argument("--url", help="of the server; default: the one running here")
    parser.add_argument("--token", help="operator_token of that server's run file; goes with --url")
    parser.add_argument("--ca", type=Path, help="certificate of the server's own authority (PEM)")


def _is_address(url: str) -> bool:
    """Whether a server can have it."""
    with suppress(ValueError):  # a port that is none, half an address in brackets
        parts = urlsplit(url)
        return parts.scheme in ("http", "https") and bool(parts.hostname) and parts.port != 0
    return False


def access_of(arguments: argparse.Namespace) -> Access:
    """The server these options mean.

    Raises:
        PhoneClientError: there is none, or url and token don't come together.
    """
    if (arguments.url is None) != (arguments.token is None):
        raise PhoneClientError("--url and --token go together")
    if arguments.url is not None and arguments.name:
        raise PhoneClientError("--name is of a server here: not with --url")
    if arguments.url is None:
        return running_server(runtime_directory(arguments.name))
    if not _is_address(arguments.url):
        raise PhoneClientError(f"--url {arguments.url}: allowed: http://HOST:PORT or https://…")
    if arguments.ca is not None and not arguments.ca.is_file():
        raise PhoneClientError(f"--ca {arguments.ca}: no such file")
    return Access(arguments.url, arguments.token, ca=arguments.ca)
