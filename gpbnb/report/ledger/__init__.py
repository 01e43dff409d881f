"""Every printed statement of the three documents and the verdict computed for it.

``python -m gpbnb.ledger`` writes the ledger. In a notebook::

    from gpbnb.report import ledger

    rows = ledger.rows(document="hung1984", chapter="II", sections=range(1, 10))
    ledger.error_table(rows)
"""

from gpbnb.report.ledger.checking import Row, counts, examine
from gpbnb.report.ledger.checks import TOPICS
from gpbnb.report.ledger.documents import document_table
from gpbnb.report.ledger.html import CHAPTERS, Html
from gpbnb.report.ledger.legibility import load_legibility
from gpbnb.report.ledger.page import (
    PAGES,
    claim_outcomes,
    claim_table,
    count_table,
    error_table,
    ledger_page,
    note_table,
    root_table,
    select_topic,
)
from gpbnb.report.ledger.render import table
from gpbnb.report.ledger.roots import by_root, load_roots
from gpbnb.report.ledger.squares import root_squares, squares
from gpbnb.report.ledger.statements import Statement, load_statements, quote, select
from gpbnb.report.ledger.stored import rows

__all__ = [
    "CHAPTERS",
    "PAGES",
    "TOPICS",
    "Html",
    "Row",
    "Statement",
    "by_root",
    "claim_outcomes",
    "claim_table",
    "count_table",
    "counts",
    "document_table",
    "error_table",
    "examine",
    "ledger_page",
    "load_legibility",
    "load_roots",
    "load_statements",
    "note_table",
    "quote",
    "root_squares",
    "root_table",
    "rows",
    "select",
    "select_topic",
    "squares",
    "table",
]
