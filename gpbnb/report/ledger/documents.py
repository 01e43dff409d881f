"""The bibliographic record of each document, read from ``documents.csv``; none of it is a statement to be judged."""

from __future__ import annotations

from gpbnb.report.display.tables import Table
from gpbnb.report.ledger.statements import rows_of


def document_table() -> Table:
    """Tabulate title, author, date, numbers and remarks of the documents."""
    body = []
    for each in rows_of("documents.csv"):
        contract = f"contract {each['contract']}" if each["contract"] else ""
        numbers = "; ".join(filter(None, (each["date"], each["number"], contract)))
        body.append((each["document"], f"{each['title']}. {each['author']}.", numbers, each["remarks"]))
    return Table(f"{len(body)} documents", ("document", "title and author", "date and numbers", "remarks"), tuple(body))
