"""The ledger at a glance: one square a statement, in the order of the documents, and those of each root error."""

from __future__ import annotations

from collections.abc import Iterable
from html import escape

from gpbnb.report.ledger.checking import Row, counts, in_reading_order
from gpbnb.report.ledger.html import Html, typeset
from gpbnb.report.ledger.page import PAGES, address
from gpbnb.report.ledger.render import outcome_name
from gpbnb.report.ledger.roots import by_root, load_roots


def squares(rows: Iterable[Row]) -> Html:
    """Draw a square for each statement, coloured by its verdict, which links to its row in the ledger.

    Each row of squares stands for one page of the ledger. Verdicts also differ in shape, for readers who do not see
    the colours.
    """
    rows = in_reading_order(rows)
    key = "".join(
        f'<li><span class="square {_class(outcome)}"></span>{escape(outcome_name(outcome))} ({count})</li>'
        for outcome, count in counts(rows).items()
    )
    lines = []
    for page in PAGES:
        if inside := [row for row in rows if page.holds(row.statement)]:
            title = page.title.removeprefix("Ledger: ")
            lines.append(_group(f"{title[0].upper()}{title[1:]}", inside))
    return Html(f"{len(rows)} squares", _whole(f'<ul class="squares-key">{key}</ul>', lines))


ROOT_CAPTION = (
    "Each row is a root error, and its squares are the statements that it makes wrong or inconsistent. The longest row "
    "comes first. Squares have the shapes and colours of the picture at the top of this page, and lead to the ledger."
)


def root_squares(rows: Iterable[Row]) -> Html:
    """Draw the squares of the statements that each root error affects, the longest row first, with a caption."""
    found = sorted(by_root(rows).items(), key=lambda item: -len(item[1]))
    lines = [_group(typeset(load_roots()[key].title), in_reading_order(spoiled), True) for key, spoiled in found]
    picture = _whole("", lines, " squares-roots")
    caption = f"<figcaption>{escape(ROOT_CAPTION)}</figcaption>"
    return Html(f"squares of {len(found)} root errors", f"<figure>{picture}{caption}</figure>")


def _class(outcome: str) -> str:
    return f"square-{outcome_name(outcome).replace(' ', '-')}"


def _whole(key: str, lines: Iterable[str], classes: str = "") -> str:
    said = '<p class="squares-said" aria-hidden="true">\u00a0</p>'
    return f'<div class="squares{classes}">{key}{"".join(lines)}{said}</div>'


def _group(title: str, rows: Iterable[Row], with_document: bool = False) -> str:
    """Lay out the squares of some statements after their title."""
    links = []
    for row in rows:
        place = f"{row.statement.document} " if with_document else ""
        words = escape(f"{place}{row.statement.item}: {outcome_name(row.outcome)}", quote=True)
        links.append(
            f'<a class="square {_class(row.outcome)}" href="{address(row.statement)}" aria-label="{words}"></a>'
        )
    return f'<div class="squares-group"><span class="squares-title">{title}</span><span>{"".join(links)}</span></div>'
