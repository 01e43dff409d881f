"""Everything printed in the three documents, and what became of it.

``python -m gpbnb.ledger`` writes it out. In a notebook::

    from gpbnb import ledger

    rows = ledger.rows(document="hung1984", chapter="II", sections=range(1, 10))
    ledger.table(rows)
    ledger.summary_table(rows)
"""

from gpbnb.ledger.checking import Row, counts, examine, rows, summary
from gpbnb.ledger.checks import TOPICS
from gpbnb.ledger.page import (
    CHAPTERS,
    Html,
    brief,
    count_table,
    links,
    of_ids,
    of_kind,
    of_topic,
    searchable,
    told,
    topics,
)
from gpbnb.ledger.render import summary_table, table
from gpbnb.ledger.statements import Statement, load_statements, quote, select

__all__ = [
    "CHAPTERS",
    "TOPICS",
    "Html",
    "Row",
    "Statement",
    "brief",
    "count_table",
    "counts",
    "examine",
    "links",
    "load_statements",
    "of_ids",
    "of_kind",
    "of_topic",
    "quote",
    "rows",
    "searchable",
    "select",
    "summary",
    "summary_table",
    "table",
    "told",
    "topics",
]
