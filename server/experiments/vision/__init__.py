"""`lightleash bench`: figures that the project is held to, measured against stated goals."""

from __future__ import annotations

import sys
from collections.abc import Sequence

from server.common.options import Parser


def main(argv: Sequence[str] | None = None) -> int:
    """Entry of `lightleash bench`."""
    words = list(sys.argv[1:] if argv is None else argv)
    parser = Parser(prog="lightleash bench", description=__doc__)
    kinds = parser.add_subparsers(required=True, metavar="BENCH")
    measures = "seeing: poses from rendered pictures, right or wrong, how exact, how fast"
    one = kinds.add_parser("vision", help=measures, description=measures)
    if words[:1] == ["vision"]:
        from server.experiments.vision import vision

        vision.add_arguments(one)
        one.set_defaults(run=vision.run)
    arguments = parser.parse_args(words)
    code: int = arguments.run(arguments)
    return code
