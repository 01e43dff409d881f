"""The stored sweeps of the package are undamaged, with one row for each key."""

from __future__ import annotations

from typing import NamedTuple

import pytest

from gpbnb.report.gravity_probe_b import year
from gpbnb.report.inversion.experiment import SWEEPS as INVERSIONS
from gpbnb.report.inversion.experiment import format_name
from gpbnb.report.stored import SWEEPS
from gpbnb.report.sweep import Number, columns


@pytest.mark.parametrize("sweep", SWEEPS, ids=lambda sweep: sweep.name)
def test_every_stored_sweep_is_undamaged_and_its_key_as_short_as_can_be(sweep):
    table = sweep.load()
    assert table.provenance["command"] == sweep.command
    assert len({row[: sweep.key] for row in table.rows}) == len(table.rows) > 0
    assert len({row[: sweep.key - 1] for row in table.rows}) < len(table.rows)


@pytest.mark.parametrize("name", INVERSIONS)
def test_inversions_are_stored_for_the_formats_of_their_cells(name):
    (sweep,) = (each for each in SWEEPS if each.name == f"inversion/{name}")
    formats = {row[1] for row in sweep.load().rows} - {"all"}
    assert formats == {format_name(cell.fmt) for cell in sweep.cells()}


class Bounded(NamedTuple):
    name: str
    steps: int
    bound: float
    text: Number


def test_the_columns_of_a_row_accept_what_its_fields_hold_and_no_negative_number():
    found = columns(Bounded)
    assert [column.fault("1") for column in found] == [None] * 4
    assert [column.fault("-1") is None for column in found] == [True, False, False, False]
    assert [column.fault("1.5") is None for column in found] == [True, False, True, True]
    assert [column.fault("") is None for column in columns(Bounded, optional=True)] == [True] * 4


def test_the_first_steps_include_the_last_of_them():
    """Of the checkpoints, three a decade."""
    assert [row[5] for row in year.rows(year.CASES[0], steps=10)] == ["1", "2", "5", "10"]
