"""The page: contents, a section a part, then what it was all made with."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from markupsafe import Markup

from server.common.markup import document, element
from server.experiments.all.parts import ReportPart
from server.experiments.all.results import PartResults
from server.experiments.all.running import RunRecord
from server.experiments.all.show import pictured, shown, table_of
from server.experiments.all.tables import GOAL, Cell, Table

STYLE: Final = Path(__file__).with_name("style.css")
TITLE: Final = "Lightleash: experiments"
STATES: Final = {
    "done": ("✓ done", "good"),
    "missed": ("✗ not all holds", "bad"),
    "refused": ("– could not run here", "bad"),
    "failed": ("✗ failed", "bad"),
    "begun": ("… under way or interrupted", "dim"),
    "": ("… not run yet", "dim"),
}


@dataclass(frozen=True, slots=True)
class Chapter:
    """A part with what became of it."""

    part: ReportPart
    command: str
    """To repeat it alone."""
    seeds: str
    record: RunRecord | None
    results: PartResults

    @property
    def state(self) -> tuple[str, str]:
        """In words, and its class."""
        return STATES[self.record.status if self.record else ""]


@dataclass(frozen=True, slots=True)
class Ending:
    """What stands for all parts."""

    command: str
    """That makes this page."""
    date: str
    versions: Mapping[str, str]
    machine: Mapping[str, str]
    assumptions: Table
    not_shown: str = ""
    """Which parts there would be, too."""


def page(chapters: Sequence[Chapter], ending: Ending) -> Markup:
    """The whole of it."""
    version = ending.versions.get("lightleash", "")
    commit, _, changed = ending.versions.get("git commit", "").partition(",")
    known = [f"commit {commit[:12]}{changed}"] if commit else []
    of = ", ".join([f"Version {version}", *known, ending.date])
    body = (
        element("h1", TITLE),
        element("p", of, class_="dim"),
        _contents(chapters),
        element("main", *(_section(chapter, ending) for chapter in chapters), *_ending(ending)),
    )
    return document(TITLE, STYLE.read_text(encoding="utf-8"), body)


def _contents(chapters: Sequence[Chapter]) -> Markup:
    rows = [
        element(
            "tr",
            element("th", _link(f"part-{one.part.name}", one.part.heading), scope="row"),
            element("td", _state(one)),
            element("td", _took(one.record), class_="number"),
        )
        for one in chapters
    ]
    heads = (_head("part"), _head("state"), element("th", "took", scope="col", class_="number"))
    table = element("table", element("thead", element("tr", *heads)), element("tbody", *rows))
    versions, notes = _link("versions", "Versions and machine"), _link("assumptions", "Assumptions")
    more, title = element("p", versions, " · ", notes), element("h2", "Contents")
    return element("nav", title, table, more, class_="contents", aria_label="Contents")


def _section(chapter: Chapter, ending: Ending) -> Markup:
    part, record, results = chapter.part, chapter.record, chapter.results
    return element(
        "section",
        element("h2", part.heading),
        element("p", part.shows),
        element("p", _state(chapter), f" {_summary(chapter, ending)}", class_="dim"),
        _command(chapter.command),
        *([_reason(record)] if record and record.reason else []),
        *map(shown, results.blocks),
        *(pictured(one, part.heading) for one in results.figures),
        *(element("p", f"Not shown: {note}", class_="dim") for note in results.notes),
        *_printed(results),
        id=f"part-{part.name}",
    )


def _summary(chapter: Chapter, ending: Ending) -> str:
    """Seeds, duration, and the machine if it was another one."""
    record = chapter.record
    words = [f"Seeds: {chapter.seeds}."]
    if record and record.seconds:
        words.append(f"Took {_took(record)}, begun {record.begun}.")
    if record and record.machine != ending.machine:
        words.append(f"Flown on another machine: {', '.join(record.machine.values())}.")
    return " ".join(words)


def _took(record: RunRecord | None) -> str:
    if record is None or not record.seconds:
        return "–"
    if record.seconds < 60.0:
        return f"{record.seconds:.1f} s"
    minutes, seconds = divmod(round(record.seconds), 60)
    return f"{minutes} min {seconds} s"


def _reason(record: RunRecord) -> Markup:
    kind = "bad" if record.status in ("failed", "refused") else "dim"
    return element("p", record.reason, class_=f"box {kind}")


def _state(chapter: Chapter) -> Markup:
    words, kind = chapter.state
    return element("span", words, class_=f"mark {kind}")


def _printed(results: PartResults) -> Iterator[Markup]:
    for what, text in (("printed", results.output), ("told on its way", results.errors)):
        if text:
            summary = element("summary", f"What the command {what}")
            yield element("details", summary, element("pre", text))


def _ending(ending: Ending) -> Iterator[Markup]:
    goal = (
        f"Where the paper gives a figure, “within” means that ours is at most {100 * GOAL:g} % "
        "from it. Ratios are ours over the paper's."
    )
    again = _command(ending.command)
    yield _closing("again", "How to read this page and make it again", element("p", goal), again)
    if ending.not_shown:
        yield element("p", ending.not_shown, class_="dim")
    facts = {**ending.versions, **ending.machine, "page written": ending.date}
    yield _closing("versions", "Versions and machine", table_of(_pairs(facts)))
    says = (
        "known: stands in the paper or follows from it; identified: fitted so that the simulated "
        "robot reproduces the paper's tables; chosen: ours, plausible, not fitted. They are those "
        "of the paper's experiments, whose simulated robot the other parts fly, too."
    )
    yield _closing("assumptions", "Assumptions", element("p", says), table_of(ending.assumptions))


def _closing(name: str, heading: str, *inside: Markup) -> Markup:
    return element("section", element("h2", heading), *inside, id=name)


def _command(command: str) -> Markup:
    """Its lines break between words, not at hyphens."""
    words = (element("span", f"{word} ") for word in command.split(" "))
    return element("pre", element("code", *words), class_="command")


def _pairs(values: Mapping[str, str]) -> Table:
    return Table("", (), tuple((Cell(key), Cell(value)) for key, value in values.items()))


def _link(where: str, words: str) -> Markup:
    return element("a", words, href=f"#{where}")


def _head(words: str) -> Markup:
    return element("th", words, scope="col")
