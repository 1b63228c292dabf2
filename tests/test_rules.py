"""House rules that a program can check; the words are in CONTRIBUTING.md."""

from __future__ import annotations

import ast
import re
from collections import Counter
from collections.abc import Iterator

import pytest

from tests.sources import parsed, texts

CLOCKS = {
    "server/common/clock.py": "the one that all others ask",
    "hardware/link/robot_server.py": "a robot's own clock, which no server may share",
    "hardware/sim/network/emulated_link.py": "a line between two networks, a process of its own",
    "hardware/sim/truth.py": "patience for an answer, in whatever process asks",
    "hardware/link/udp.py": "a default, in whatever process has the link",
    "hardware/link/rpit/rpit_follower.py": "the same",
    "hardware/link/franka/franka_follower.py": "the same",
    "hardware/link/franka/arm_line.py": "the same: that of who tells",
    "hardware/link/mavlink/mavlink_follower.py": "the same",
    "hardware/link/ros2/ros2_follower.py": "the same",
    "hardware/link/ros2/ports.py": "the same, for the time in ROS's headers",
}
"""Who reads a clock, and why."""
READINGS = {
    "time": re.compile(
        r"(time|monotonic|perf_counter|process_time|thread_time|clock_gettime)(_ns)?"
        r"|localtime|gmtime|ctime|asctime|strftime"
    ),
    "datetime": re.compile(r"now|utcnow|today"),
    "date": re.compile(r"today"),
}

UNIT = re.compile(
    r"_(S|MS|US|NS|HZ|BPS|PX|PX2|M|MM|CM|RAD|DEG|KG|N|G|M_S|M_S2|RAD_S|DEG_S|PPM|PERCENT|BYTES|BITS"
    r"|KB|MB|DAYS)$|^(G|MIN|MAX)$"
)
ROOMS, FILES = 20, 14
"""Of the server, and of each of them: what can still be known by heart."""
NUMERIC = (
    ast.Constant | ast.UnaryOp | ast.BinOp | ast.Tuple | ast.List | ast.Name | ast.Attribute
    | ast.operator | ast.unaryop | ast.expr_context
)  # fmt: skip


def modules() -> Iterator[tuple[str, str]]:
    """(path, text) of each module of the product."""
    return ((path.as_posix(), text) for path, text in texts().items())


def readings(text: str) -> list[str]:
    """What a module takes from a clock."""
    found = []
    for node in ast.walk(parsed(text)):
        if isinstance(node, ast.Attribute):
            of = node.value
            name = getattr(of, "attr", getattr(of, "id", ""))
            if name in READINGS and READINGS[name].fullmatch(node.attr):
                found.append(f"{name}.{node.attr}")
        elif isinstance(node, ast.ImportFrom) and node.module == "time":
            found += [one.name for one in node.names if READINGS["time"].fullmatch(one.name)]
    return found


def numbers(text: str) -> Iterator[tuple[str, bool]]:
    """Each number a module names, and whether unit or words say what it is.

    Words stand under it, or under the lines it is one of, or in a comment beside it.
    """
    lines, body = text.splitlines(), parsed(text).body
    for k, node in enumerate(body):
        names = named(node)
        if not names:
            continue
        last = k
        while last + 1 < len(body) and named(body[last + 1]) and adjoin(body, last):
            last += 1
        under = body[last + 1] if last + 1 < len(body) else None
        is_told = is_text(under) and adjoin(body, last)
        assert node.end_lineno is not None
        beside = "\n".join(lines[node.lineno - 1 : node.end_lineno])
        above = lines[node.lineno - 2].startswith("#")
        units = all(map(UNIT.search, names))
        yield ", ".join(names), is_told or above or "  # " in beside or units


def named(node: ast.stmt) -> list[str]:
    """Capital names that are given a number here."""
    if isinstance(node, ast.Assign):
        target, value = node.targets[0], node.value
    elif isinstance(node, ast.AnnAssign) and node.value is not None:
        target, value = node.target, node.value
    else:
        return []
    parts = list(ast.walk(value))
    constants = [part.value for part in parts if isinstance(part, ast.Constant)]
    is_number = all(isinstance(part, NUMERIC) for part in parts) and any(
        type(one) in (int, float) for one in constants
    )
    names = [part.id for part in ast.walk(target) if isinstance(part, ast.Name)]
    whole = is_number and not any(isinstance(one, str | bytes) for one in constants)
    return names if whole and all(name.isupper() for name in names) else []


def adjoin(body: list[ast.stmt], k: int) -> bool:
    """Whether the next statement stands on the next line."""
    return body[k + 1].lineno == (body[k].end_lineno or 0) + 1


def is_text(node: ast.stmt | None) -> bool:
    return (
        isinstance(node, ast.Expr)
        and isinstance(node.value, ast.Constant)
        and isinstance(node.value.value, str)
    )


def rooms() -> dict[str, int]:
    """Modules in each folder of the server's."""
    return Counter(
        path.rpartition("/")[0]
        for path, _ in modules()
        if path.startswith("server/") and not path.endswith("/__init__.py")
    )


def test_the_server_has_few_rooms_and_none_is_full() -> None:
    found = rooms()
    assert len({room.split("/")[1] for room in found if "/" in room}) <= ROOMS
    assert {room: files for room, files in found.items() if files > FILES} == {}


def test_nobody_but_the_clock_reads_a_clock() -> None:
    assert {path for path, text in modules() if readings(text)} == set(CLOCKS)


@pytest.mark.parametrize(
    "line",
    [
        "import time\nt = time.monotonic()",
        "import time\nclock = time.perf_counter_ns",
        "from time import thread_time as now",
        "from datetime import date\nday = date.today()",
        "import datetime\nt = datetime.datetime.now()",
        "import time\nname = time.strftime('%Y')",
    ],
)
def test_each_way_to_read_a_clock_is_seen(line: str) -> None:
    assert readings(line)
    assert not readings("import time\nfrom time import sleep\ntime.sleep(1.0)\nt = clock.now()")


def test_every_number_has_its_unit_in_its_name_or_words_beside_it() -> None:
    found = [(path, *number) for path, text in modules() for number in numbers(text)]
    assert [f"{path}: {name}" for path, name, is_told in found if not is_told] == []


def test_a_bare_number_is_seen() -> None:
    told = 'A_S = 3.0\nB = 2\nC, D = 1, (2, -3)\n"""Of these."""\nE = 4  # px\n\nF: Final = 5\n'
    assert dict(numbers(told)) == {"A_S": True, "B": True, "C, D": True, "E": True, "F": False}
    assert not list(numbers("A = 'x'\nB = f(3)\nC = True\nlower = 3\n"))
