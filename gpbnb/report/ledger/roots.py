"""Root errors: the independent mistakes from which the wrong statements of the documents follow."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from functools import cache

from gpbnb.report.ledger.checking import Row
from gpbnb.report.ledger.statements import rows_of


@dataclass(frozen=True)
class Root:
    """One independent mistake.

    Parameters
    ----------
    id : short name in words joined by hyphens, as in ``product-error-relative-to-product``.
    title : the mistake in one line.
    explanation : why it is a mistake; prose with math between single dollar signs.
    """

    id: str
    title: str
    explanation: str


@cache
def load_roots() -> dict[str, Root]:
    """Read ``roots.csv``: root id → root, in the order of the file."""
    return {row["id"]: Root(**row) for row in rows_of("roots.csv")}


def by_root(rows: Iterable[Row]) -> dict[str, tuple[Row, ...]]:
    """Group the rows that disagree by their root error; root id → rows, in the order of ``roots.csv``."""
    found: dict[str, list[Row]] = {root: [] for root in load_roots()}
    for row in rows:
        if row.finding.root:
            found[row.finding.root].append(row)
    return {root: tuple(inside) for root, inside in found.items() if inside}
