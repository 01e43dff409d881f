"""The stored sweeps of the package are undamaged, with one row for each key."""

from __future__ import annotations

from typing import NamedTuple

import pytest

from gpbnb.report.stored import SWEEPS
from gpbnb.report.sweep import Number, columns


@pytest.mark.parametrize("sweep", SWEEPS, ids=lambda sweep: sweep.name)
def test_every_stored_sweep_is_undamaged_and_its_key_as_short_as_can_be(sweep):
    table = sweep.load()
    assert table.provenance["command"] == sweep.command
    assert len({row[: sweep.key] for row in table.rows}) == len(table.rows) > 0
    assert len({row[: sweep.key - 1] for row in table.rows}) < len(table.rows)


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
