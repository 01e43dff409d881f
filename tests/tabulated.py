"""What a reader sees in a table."""

from __future__ import annotations

from gpbnb.report.display.tables import Table


def by_header(table: Table) -> list[dict[str, str]]:
    """The cells of each line under their headers, all of which differ."""
    assert len(set(table.header)) == len(table.header)
    return [dict(zip(table.header, line, strict=True)) for line in table.body]
