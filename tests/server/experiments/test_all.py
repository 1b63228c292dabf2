"""`lightleash experiments all`: one page of everything, whatever became of each part."""

from __future__ import annotations

import argparse
import json
import subprocess
from html.parser import HTMLParser
from importlib import import_module
from pathlib import Path

import pytest

from server.experiments import EXPERIMENTS, MODULES, main
from server.experiments.all import command, provenance, running
from server.experiments.all.parts import CAPTIONS, LEFT_OUT, PARTS, ReportPart

GOOD = "margins ground --gains phone --estimator relative"
FLOWN = (
    ReportPart("good", GOOD, GOOD, "Good", "It runs."),
    ReportPart("bad", "margins --gains sport", "margins --gains sport", "Bad", "It fails."),
    ReportPart("not_here", "fly", "fly", "Not here", "It refuses."),
)
MADE_UP = ReportPart("made_up", "margins", "margins", "Made up", "By the test.")
EVIL = '"><script>alert(1)</script><img src=x onerror=alert(2)>\ud800&amp;</pre>'
ONE_PIXEL = bytes.fromhex(
    "89504e470d0a1a0a0000000d4948445200000001000000010806000000"
    "1f15c4890000000d49444154789c6360606060000000050001a5f64540"
    "0000000049454e44ae426082"
)
ALLOWED = """html head meta title style body h1 h2 p nav main section table caption thead tbody tr
th td a span pre code div figure img figcaption details summary ul li"""
ELEMENTS = set(ALLOWED.split())


class Seen(HTMLParser):
    """What a browser would make of a page."""

    def __init__(self, page: str) -> None:
        super().__init__()
        self.elements: set[str] = set()
        self.attributes: list[tuple[str, str]] = []
        self.text = ""
        self.feed(page)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.elements.add(tag)
        self.attributes += [(name, value or "") for name, value in attrs]

    def handle_data(self, data: str) -> None:
        self.text += data

    def values(self, name: str) -> list[str]:
        return [value for key, value in self.attributes if key == name]


def page_of(folder: Path) -> Seen:
    return Seen((folder / "index.html").read_text(encoding="utf-8"))


def finished(
    folder: Path, part: ReportPart, status: running.Status = "done", reason: str = ""
) -> Path:
    """A part's folder as an earlier run has left it."""
    place = folder / "parts" / part.name
    record = running.RunRecord(
        part.command, provenance.versions(), provenance.machine(), "2026", "begun", 2.0, reason
    )
    running.prepare(place, record, fresh=True)
    told = json.loads((place / "part.json").read_text())
    (place / "part.json").write_text(json.dumps({**told, "status": status}))
    return place


@pytest.fixture(scope="module")
def flown(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, int]:
    """A page of three parts, each by its own command; its folder and the exit code."""
    folder = tmp_path_factory.mktemp("all")
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(command, "PARTS", FLOWN)
        code = main(["all", "--out", str(folder)])
    return folder, code


def test_parts_that_fail_or_cannot_run_here_say_why_and_the_rest_is_there(flown) -> None:
    folder, code = flown
    assert code == 1
    page = page_of(folder)
    for words in ("✓ done", "delay [ms]", "arming with phone, relative: yes", "Nyquist and Bode"):
        assert words in page.text, words
    assert "✗ failed" in page.text
    assert "exit code 1: gains: 'sport' is not one of" in page.text
    assert "– could not run here" in page.text
    assert "invalid choice: 'fly'" in page.text
    assert [src for src in page.values("src") if src.startswith("data:image/png")]


def test_the_page_tells_command_seeds_versions_machine_and_assumptions(flown) -> None:
    page = page_of(flown[0])
    assert f"lightleash experiments {GOOD} --out good" in page.text
    assert "Seeds: none are used" in page.text
    for words in (
        *provenance.versions(),
        *provenance.machine().values(),
        "largest thrust",
        "identified",
    ):
        assert words in page.text, words


def test_the_page_stands_by_itself(flown) -> None:
    raw = (flown[0] / "index.html").read_text(encoding="utf-8")
    page = Seen(raw)
    assert page.elements <= ELEMENTS
    assert all(src.startswith("data:image/") for src in page.values("src"))
    assert {href[1:] for href in page.values("href")} <= set(page.values("id"))
    style = raw[raw.index("<style>") : raw.index("</style>")]
    assert not any(word in style for word in ("url(", "@import", "http"))
    assert not any(name.startswith("on") for name, _ in page.attributes)
    assert all(page.values("alt"))


def test_finished_parts_are_taken_over_and_the_others_tried_again(flown, monkeypatch) -> None:
    folder, _ = flown
    monkeypatch.setattr(command, "PARTS", FLOWN)
    tried: list[list[str]] = []

    def fly(words, place, wanted, tick):
        tried.append(words)
        return wanted

    monkeypatch.setattr(running, "fly", fly)
    main(["all", "--out", str(folder)])
    assert tried == [part.words(False) for part in FLOWN[1:]]
    assert "✓ done" in page_of(folder).text
    tried.clear()
    main(["all", "--out", str(folder), "--only", "good", "--fresh"])
    assert tried == [FLOWN[0].words(False)]
    assert not (folder / "parts" / "good" / "margins.json").exists()


def test_what_another_version_or_command_made_is_not_taken_over(tmp_path, monkeypatch) -> None:
    finished(tmp_path, MADE_UP)
    monkeypatch.setattr(command, "PARTS", (MADE_UP,))
    report = command.Report(tmp_path, [], quick=False)
    assert report._is_finished(MADE_UP)
    monkeypatch.setattr(provenance, "versions", lambda: {"lightleash": "another"})
    assert not command.Report(tmp_path, [], quick=False)._is_finished(MADE_UP)


def test_a_clone_tells_its_commit_and_which_change_was_made_since(tmp_path) -> None:
    def git(*words: str) -> None:
        who = ["-c", "user.name=x", "-c", "user.email=x@x", "-c", "commit.gpgsign=false"]
        subprocess.run(["git", "-C", str(tmp_path), *who, *words], check=True, capture_output=True)

    assert provenance.commit(tmp_path) == ""
    git("init")
    (tmp_path / "a").write_text("1")
    git("add", "a")
    git("commit", "-m", "a")
    clean = provenance.commit(tmp_path)
    assert len(clean) == 40
    (tmp_path / "a").write_text("2")
    second = provenance.commit(tmp_path)
    (tmp_path / "a").write_text("3")
    assert second.startswith(f"{clean}, changed since")
    assert provenance.commit(tmp_path) != second


def test_text_of_results_never_becomes_markup(tmp_path, monkeypatch) -> None:
    place = finished(tmp_path, MADE_UP, "missed", EVIL.replace("\ud800", ""))
    told = {"title": EVIL, "rows": [{EVIL: EVIL, "seen": 1.0}], "holds": {EVIL: True}, EVIL: [EVIL]}
    (place / "made_up.json").write_text(json.dumps(told))
    (place / "table.csv").write_text('a,b\n"<script>",2\n')
    for name in ("output.txt", "errors.txt", "note.txt"):
        (place / name).write_text(EVIL, errors="replace")
    (place / f"{EVIL[:10].replace('/', '')}.png").write_bytes(ONE_PIXEL)
    (place / "broken<script>.json").write_text("{")
    monkeypatch.setattr(command, "PARTS", (MADE_UP,))
    assert main(["all", "--out", str(tmp_path)]) == 1
    page = page_of(tmp_path)
    assert page.elements <= ELEMENTS
    assert all(src.startswith("data:image/") for src in page.values("src"))
    assert not any(name.startswith("on") for name, _ in page.attributes)
    assert page.text.count("<script>alert(1)</script>") >= 7
    assert "Not shown: broken<script>.json" in page.text


def test_an_interruption_ends_the_command_and_what_it_was_in_is_gone_on_with(tmp_path) -> None:
    place = tmp_path / "loop"
    wanted = running.RunRecord("loop", {}, {}, "now")
    running.prepare(place, wanted, fresh=False)

    def interrupt(seconds: float) -> None:
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        running.fly(["loop", "--seconds", "600"], place, wanted, interrupt)
    processes = subprocess.run(["ps", "-A", "-o", "args"], capture_output=True, text=True).stdout
    assert str(place) not in processes
    (place / "half").touch()
    running.prepare(place, wanted, fresh=False)
    assert (place / "half").exists()
    running.prepare(place, wanted, fresh=True)
    assert not (place / "half").exists()


def test_a_folder_that_cannot_be_written_or_is_not_ours_is_told_in_one_line(
    tmp_path, capsys
) -> None:
    (tmp_path / "file").touch()
    assert main(["all", "--out", str(tmp_path / "file" / "x")]) == 2
    told = capsys.readouterr().err
    assert told.startswith("lightleash experiments all: ")
    assert len(told.splitlines()) == 1
    theirs = tmp_path / "parts" / "margins" / "thesis.tex"
    theirs.parent.mkdir(parents=True)
    theirs.touch()
    assert main(["all", "--out", str(tmp_path), "--fresh"]) == 2
    assert "not of an earlier run" in capsys.readouterr().err
    assert theirs.exists()


def test_every_experiment_is_a_part_or_is_left_out_with_a_reason() -> None:
    flown = {part.words(quick)[0] for part in PARTS for quick in (False, True)}
    assert flown | set(LEFT_OUT) == set(EXPERIMENTS)
    assert set(MODULES) == set(EXPERIMENTS)
    assert not flown & set(LEFT_OUT)
    assert all(LEFT_OUT.values())
    assert {name for name, _ in CAPTIONS} <= flown
    assert len({part.name for part in PARTS}) == len(PARTS)


@pytest.mark.parametrize("part", PARTS, ids=lambda part: part.name)
@pytest.mark.parametrize("quick", [False, True], ids=["whole", "quick"])
def test_each_part_is_a_command_that_names_its_seeds(
    part: ReportPart, quick: bool, tmp_path
) -> None:
    experiment, *words = part.words(quick)
    parser = argparse.ArgumentParser(exit_on_error=False)
    import_module(MODULES[experiment]).add_arguments(parser)
    given = parser.parse_args([*words, "--out", str(tmp_path)])
    assert given.out == tmp_path
    for option in {"--seed", "--seeds"} & set(parser._option_string_actions):
        assert option in words


@pytest.mark.slow
def test_a_quick_part_is_flown_and_shown(tmp_path) -> None:
    assert main(["all", "--out", str(tmp_path), "--quick", "--only", "tremor"]) == 0
    page = page_of(tmp_path)
    assert "across [°]" in page.text
    assert "Seeds: 1." in page.text
    assert "selective at once" in page.text
    assert (tmp_path / "index.html").stat().st_size > 50_000
    assert main(["all", "--out", str(tmp_path), "--quick", "--only", "tremor"]) == 0
