"""The bibliographic record of each document, read from ``documents.csv``; none of it is a statement to be judged."""

from __future__ import annotations

import csv
from importlib.resources import files

from gpbnb.report.display.tables import Table


def document_table() -> Table:
    """Tabulate title, author, date, numbers and remarks of the documents."""
    text = (files(__package__) / "documents.csv").read_text(encoding="utf-8")
    body = []
    for each in csv.DictReader(text.splitlines(), strict=True):
        contract = f"contract {each['contract']}" if each["contract"] else ""
        numbers = "; ".join(filter(None, (each["date"], each["number"], contract)))
        body.append((each["document"], f"{each['title']}. {each['author']}.", numbers, each["remarks"]))
    return Table(f"{len(body)} documents", ("document", "title and author", "date and numbers", "remarks"), tuple(body))
