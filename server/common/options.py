"""A command line that says in one line what is wrong with it."""

from __future__ import annotations

import argparse
from typing import NoReturn

from server.common.runtime import server_name


class Parser(argparse.ArgumentParser):
    """Parser without the usage, which `--help` tells."""

    def error(self, message: str) -> NoReturn:
        """End with one line."""
        self.exit(2, f"{self.prog}: {message} (--help tells more)\n")


def add_name_argument(parser: argparse.ArgumentParser) -> None:
    """The option that says which server of this machine is meant."""
    help = "of the server that runs here: as its `serve --name`; default: the one without a name"
    parser.add_argument("--name", type=_name, default="", help=help)


def _name(text: str) -> str:
    try:
        return server_name(text)
    except ValueError as error:
        raise argparse.ArgumentTypeError(f"{text}: {error}") from error
