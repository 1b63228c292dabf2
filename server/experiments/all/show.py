"""Tables, statements, sentences and figures as HTML."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from markupsafe import Markup

from server.common.markup import element, joined
from server.experiments.all.results import Figure
from server.experiments.all.tables import Block, Cell, Lines, Statements, Table, Text


def shown(block: Block) -> Markup:
    """Whatever it is."""
    match block:
        case Table():
            return table_of(block)
        case Statements():
            items = (element("li", _mark(good), f" {what}") for what, good in block.holds.items())
            return joined((_title(block.title), element("ul", *items, class_="holds")))
        case Lines():
            items = (element("li", line) for line in block.lines)
            return joined((_title(block.title), element("ul", *items)))
        case Text():
            return joined((_title(block.title), element("pre", block.text)))


def _title(title: str) -> Markup:
    return element("p", title, class_="title") if title else joined(())


def _mark(good: bool) -> Markup:
    if good:
        return element("span", "✓ holds", class_="mark good")
    return element("span", "✗ missed", class_="mark bad")


def table_of(table: Table) -> Markup:
    """It can be pushed sideways where it is too wide."""
    columns = list(zip(*table.rows, strict=True)) or [()] * len(table.columns)
    named = zip(table.columns, columns, strict=bool(table.columns))
    heads = [element("th", title, scope="col", **_class(column)) for title, column in named]
    rows = (element("tr", *_cells(row)) for row in table.rows)
    inside = [element("thead", element("tr", *heads))] if heads else []
    inside.append(element("tbody", *rows))
    whole = element(
        "div",
        element("table", *inside, class_="figures" if heads else "pairs"),
        class_="scroll",
        tabindex="0",
        role="region",
        aria_label=table.title or "table",
    )
    more = f"{table.left_out} more rows in the file." if table.left_out else ""
    below = element("p", more, class_="dim") if more else joined(())
    return joined((_title(table.title), whole, below))


def _class(column: Sequence[Cell]) -> dict[str, str]:
    return {"class_": "number"} if any(cell.kind == "number" for cell in column) else {}


def _cells(row: Sequence[Cell]) -> Iterator[Markup]:
    """The first one names the row."""
    for k, cell in enumerate(row):
        if k == 0 and cell.kind == "text":
            yield element("th", cell.text, scope="row")
        elif cell.kind == "text":
            yield element("td", cell.text)
        else:
            yield element("td", cell.text, class_=cell.kind)


def pictured(figure: Figure, heading: str) -> Markup:
    """Picture with its caption; `heading` is that of its part."""
    style = {"class_": "wide"} if figure.is_wide else {}
    image = element("img", src=figure.source, alt=f"{heading}. {figure.caption}", **style)
    frame = element(
        "div", image, class_="scroll", tabindex="0", role="region", aria_label=figure.caption
    )
    return element("figure", frame, element("figcaption", figure.caption))
