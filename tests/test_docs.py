"""The documents say what the code does: equation map, configuration, protocol."""

from __future__ import annotations

import ast
import re
import subprocess
from pathlib import Path

from server.cli import COMMANDS
from server.experiments import EXPERIMENTS
from tests.sources import parsed

ROOT = Path(__file__).resolve().parents[1]
CITED = re.compile(r"Eq\.\s*((?:\(\d+\)(?:\s*-\s*|,\s*|\s+and\s+)?)+)")


def equations(text: str) -> set[int]:
    """Numbers of the equations cited in `text`; `(5)-(8)` is a range."""
    numbers: set[int] = set()
    for cited in CITED.findall(text):
        for first, last in re.findall(r"\((\d+)\)(?:\s*-\s*\((\d+)\))?", cited):
            numbers |= set(range(int(first), int(last or first) + 1))
    return numbers


def docstrings(path: Path) -> str:
    """Docstrings of the functions, classes and methods of a module, without its own."""
    kinds = (ast.FunctionDef, ast.ClassDef)
    nodes = [node for node in ast.walk(parsed(path.read_text())) if isinstance(node, kinds)]
    return "\n".join(ast.get_docstring(node) or "" for node in nodes)


def test_the_equation_map_and_the_docstrings_agree() -> None:
    cited = {
        (number, path.name)
        for path in (ROOT / "pipeline").rglob("*.py")
        for number in equations(docstrings(path))
        if path.name not in ("teleop.py", "config.py")  # the composition names them all
    }
    rows = re.findall(
        r"^\| \((\d+)\)(?:-\((\d+)\))? \|.*\| (.*) \|$",
        (ROOT / "ARCHITECTURE.md").read_text(),
        re.MULTILINE,
    )
    mapped = {
        (number, name)
        for first, last, files in rows
        for number in range(int(first), int(last or first) + 1)
        for name in re.findall(r"`pipeline/(?:[a-z_]+/)?([a-z_0-9]+\.py)`", files)
    }
    assert cited == mapped


PATH = re.compile(r"`([\w./-]*/[\w-]+\.(?:py|js|c|h|toml|css|html))`")


def test_files_that_documents_name_are_there() -> None:
    """By their path, or by the end of it."""
    named = {
        (page.name, path)
        for page in (*ROOT.glob("*.md"), *(ROOT / "docs").rglob("*.md"))
        for path in PATH.findall(page.read_text())
    }
    rooms = (
        "deploy",
        "docs",
        "examples",
        "hardware",
        "pipeline",
        "server",
        "tests",
        "web_client/src",
    )
    there = [f"/{file.relative_to(ROOT)}" for room in rooms for file in (ROOT / room).rglob("*.*")]
    assert len(named) > 100
    assert {one for one in named if not any(file.endswith(f"/{one[1]}") for file in there)} == set()


def test_every_equation_from_1_to_24_has_a_home() -> None:
    text = (ROOT / "ARCHITECTURE.md").read_text()
    rows = re.findall(r"^\| \((\d+)\)(?:-\((\d+)\))? \|", text, re.MULTILINE)
    numbers = {n for first, last in rows for n in range(int(first), int(last or first) + 1)}
    assert numbers == set(range(1, 25))


ONE_SCREEN, LINE = 50, 160  # lines, and characters of one


def test_the_changelog_stays_on_one_screen() -> None:
    lines = (ROOT / "CHANGELOG.md").read_text().splitlines()
    assert len(lines) <= ONE_SCREEN
    assert max(map(len, lines)) <= LINE, "a screen's lines are not longer"


def test_the_readme_s_table_of_commands_is_the_command_line_s() -> None:
    table = (ROOT / "README.md").read_text().split("## Commands")[1].split("```")[0]
    rows = [row.split("|")[1] for row in table.splitlines() if row.startswith("| `")]
    words = [word for row in rows for word in re.findall(r"`([a-z][a-z_ ]*)`", row)]
    begun = {word.split()[0] for word in words if word.split()[0] in COMMANDS}
    assert begun == {name for name in COMMANDS if not name.startswith("_")}
    after = words[words.index("experiments loop") :]
    flown = [word.removeprefix("experiments ") for word in after]
    assert sorted(flown) == sorted(EXPERIMENTS)


def test_the_readme_s_table_of_folders_is_the_tree_s() -> None:
    table = (ROOT / "README.md").read_text().split("| folder |")[1].split("\n\n")[0]
    told = set(re.findall(r"^\| `([a-z_]+)/` \|", table, re.MULTILINE))
    files = subprocess.check_output(["git", "ls-files"], cwd=ROOT, text=True).splitlines()
    tops = {file.split("/")[0].strip('"') for file in files if "/" in file}
    assert {top for top in tops if not top.startswith(".")} == told
