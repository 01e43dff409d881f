"""Everything printed in the three documents, and what became of it.

``python -m gpbnb.ledger`` writes it out. In a notebook::

    from gpbnb import ledger

    rows = ledger.rows(document="hung1984", chapter="II", sections=range(1, 10))
    ledger.table(rows)
    ledger.summary_table(rows)
"""

from gpbnb.ledger.checking import TOPICS, Row, counts, examine, rows, summary
from gpbnb.ledger.inventory import Entry, load_inventory, select
from gpbnb.ledger.render import summary_table, table

__all__ = [
    "TOPICS",
    "Entry",
    "Row",
    "counts",
    "examine",
    "load_inventory",
    "rows",
    "select",
    "summary",
    "summary_table",
    "table",
]
