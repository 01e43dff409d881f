"""The stored sweeps of the package: their keys identify rows, and their cells are those that are stored."""

from __future__ import annotations

import pytest

from gpbnb.report.inversion.experiment import SWEEPS as INVERSIONS
from gpbnb.report.inversion.experiment import format_name
from gpbnb.report.stored import SWEEPS
from gpbnb.sweeps.sweep import cell_key


@pytest.mark.parametrize("sweep", SWEEPS, ids=lambda sweep: sweep.name)
def test_a_key_has_as_many_columns_as_it_needs(sweep):
    rows = sweep.load().rows
    assert len({row[: sweep.key] for row in rows}) == len(rows)
    assert len({row[: sweep.key - 1] for row in rows}) < len(rows)


@pytest.mark.parametrize("sweep", SWEEPS, ids=lambda sweep: sweep.name)
def test_every_cell_that_has_a_key_is_stored(sweep):
    stored = sweep.load().rows
    for key in map(cell_key, sweep.cells()):
        assert any(row[: len(key)] == key for row in stored)


@pytest.mark.parametrize("name", INVERSIONS)
def test_inversions_are_stored_for_the_formats_of_their_cells(name):
    (sweep,) = (each for each in SWEEPS if each.name == f"inversion/{name}")
    formats = {row[1] for row in sweep.load().rows} - {"all"}
    assert formats == {format_name(cell.fmt) for cell in sweep.cells()}
