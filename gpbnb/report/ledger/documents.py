"""The bibliographic record of each document, read from ``documents.csv``; none of it is a statement to be judged."""

from __future__ import annotations

import csv
from importlib.resources import files

from gpbnb.report.display.tables import Table


def document_table() -> Table:
    """Tabulate title, author, date, numbers and remarks of the documents."""
    text = (files(__package__) / "documents.csv").read_text(encoding="utf-8")
    header, *body = csv.reader(text.splitlines(), strict=True)
    return Table(f"{len(body)} documents", tuple(header), tuple(map(tuple, body)))
