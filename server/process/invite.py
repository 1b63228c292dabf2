"""`lightleash invite`: a fresh link into the server that runs here, for whoever runs it."""

from __future__ import annotations

import json
import shutil
import sys
import urllib.error
import urllib.request
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import cast, get_args

import segno

from server.common.access import PhoneClientError, direct, run_of
from server.common.options import Parser, add_name_argument
from server.common.roles import Role
from server.common.runtime import runtime_directory

TIMEOUT_S = 5.0


@dataclass(frozen=True, slots=True)
class Invitation:
    """A link that opens once."""

    url: str
    """For other machines."""
    here: str
    """For this one, without a certificate to accept."""
    lives_s: float


def invite(run: Mapping[str, object], role: Role) -> Invitation:
    """Ask the server of this run file for a link.

    Raises:
        PhoneClientError: it does not answer.
    """
    request = urllib.request.Request(
        f"{run['http_url']}/api/invite",
        data=json.dumps({"role": role}).encode(),
        headers={"Authorization": f"Bearer {run['supervisor_token']}"},
        method="POST",
    )
    try:
        with direct().open(request, timeout=TIMEOUT_S) as response:
            answer = json.loads(response.read())
        return Invitation(str(answer["url"]), str(answer["here"]), float(answer["lives_s"]))
    except (OSError, ValueError, LookupError) as error:
        raise PhoneClientError(f"{run['http_url']} gives no link: {error}") from error


def print_code(url: str) -> None:
    """The link as a code to scan, if this is a terminal wide enough for it."""
    code = segno.make(url, error="l")
    columns = shutil.get_terminal_size().columns
    if sys.stdout.isatty() and code.symbol_size(border=2)[0] <= columns:
        code.terminal(border=2, compact=True)


def main(argv: Sequence[str]) -> int:
    """Entry of `lightleash invite`."""
    parser = Parser(prog="lightleash invite", description=__doc__)
    parser.add_argument(
        "--role",
        choices=get_args(Role),
        default="operator",
        help="viewer: sees all and may STOP; operator: leads with a phone; supervisor: all",
    )
    add_name_argument(parser)
    arguments = parser.parse_args(argv)
    role = cast(Role, arguments.role)
    try:
        invitation = invite(run_of(runtime_directory(arguments.name)), role)
    except PhoneClientError as error:
        print(f"lightleash invite: {error}", file=sys.stderr)
        return 1
    print_code(invitation.url)
    print(invitation.url)
    if role != "operator":
        print(f"On this computer: {invitation.here}")
    minutes = invitation.lives_s / 60.0
    print(f"Opens once, within {minutes:g} minutes, for one {role}.", file=sys.stderr)
    return 0
