"""`lightleash check`: is this phone, this lens and this network fit to lead with?

A recording of a minute, with the robot in the picture and the phone moved about, is played through
the pipeline; a table says what was found, what it means, and what to change. The exit code is 1 if
something is poor, 2 if the recording can't be used.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from pathlib import Path

import msgspec

from server.common.options import Parser
from server.diagnostics.phone_check.report import html_of, report_of
from server.diagnostics.phone_check.verdicts import CheckLine
from server.recording.reader import read
from server.recording.writer import RecordingError
from server.tools.check.recorded_phone import RecordedPhone

POOR, REFUSED = 1, 2
"""Exit codes."""


def text_of(lines: Sequence[CheckLine]) -> str:
    """A line each, and below it what to do."""
    wide = max(len(line.what) for line in lines)
    rows: list[str] = []
    for line in lines:
        rows.append(f"{line.grade:<7}  {line.what:<{wide}}  {line.value}")
        if line.advice:
            rows.append(f"{'':<7}  {'':<{wide}}  → {line.advice}")
    return "\n".join(rows)


def main(argv: list[str] | None = None) -> int:
    """Run the command; gives the exit status."""
    parser = Parser(prog="lightleash check", description=__doc__)
    parser.add_argument("recording", type=Path)
    parser.add_argument("--html", type=Path, metavar="FILE", help="the same as a page, to send")
    parser.add_argument("--json", type=Path, metavar="FILE", help="all figures, for programs")
    arguments = parser.parse_args(argv)
    try:
        found = RecordedPhone(read(arguments.recording)).figures()
        report = report_of(found)
        print(f"{found.device}, {found.seconds:.0f} s\n{text_of(report.lines)}\n\n{report.title}")
        if arguments.html is not None:
            arguments.html.write_text(html_of(report), encoding="utf-8")
        if arguments.json is not None:
            arguments.json.write_bytes(msgspec.json.format(msgspec.json.encode(report), indent=1))
    except (RecordingError, OSError) as error:
        print(f"lightleash check: {error}", file=sys.stderr)
        return REFUSED
    return POOR if report.grade == "poor" else 0
