"""Tables of the chapters on the year of Gravity Probe B."""

from __future__ import annotations

from gpbnb.report.display.tables import Table
from gpbnb.report.gravity_probe_b.mission import PARAMETERS


def parameters() -> Table:
    """Tabulate the numbers of the mission model with their sources."""
    rows = tuple((each.name, f"{each.value:g}", each.unit, each.source) for each in PARAMETERS)
    return Table("parameters of the mission model", ("parameter", "value", "unit", "source"), rows)
