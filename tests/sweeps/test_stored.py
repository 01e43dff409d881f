"""The stored sweeps of the package: undamaged, one row a key, each cell stored, and no digit changes unnoticed."""

from __future__ import annotations

from typing import NamedTuple

import pytest

from gpbnb.report import stored_rows
from gpbnb.report.gravity_probe_b import year
from gpbnb.report.inversion.experiment import SWEEPS as INVERSIONS
from gpbnb.report.inversion.experiment import format_name
from gpbnb.report.stored import SWEEPS
from gpbnb.sweeps import DamagedFileError
from gpbnb.sweeps.sweep import cell_key

each_sweep = pytest.mark.parametrize("sweep", SWEEPS, ids=lambda sweep: sweep.name)


@each_sweep
def test_every_stored_sweep_is_undamaged_and_its_key_as_short_as_can_be(sweep):
    table = sweep.load()
    assert table.provenance["command"] == sweep.command
    assert len({row[: sweep.key] for row in table.rows}) == len(table.rows) > 0
    assert len({row[: sweep.key - 1] for row in table.rows}) < len(table.rows)


@each_sweep
def test_one_changed_digit_is_found(sweep, tmp_path):
    text = sweep.file.read_text(encoding="utf-8")
    last = max(text.rfind(each) for each in "123456789")
    changed = tmp_path / sweep.file.name
    changed.write_text(f"{text[:last]}{'8' if text[last] == '9' else '9'}{text[last + 1 :]}", encoding="utf-8")
    with pytest.raises(DamagedFileError):
        sweep.load(changed)


@each_sweep
def test_every_cell_that_has_a_key_is_stored(sweep):
    stored = sweep.load().rows
    for key in map(cell_key, sweep.cells()):
        assert any(row[: len(key)] == key for row in stored)


@pytest.mark.parametrize("name", INVERSIONS)
def test_inversions_are_stored_for_the_formats_of_their_cells(name):
    (sweep,) = (each for each in SWEEPS if each.name == f"inversion/{name}")
    formats = {row[1] for row in sweep.load().rows} - {"all"}
    assert formats == {format_name(cell.fmt) for cell in sweep.cells()}


class Bounded(NamedTuple):
    name: str
    steps: int
    bound: float
    text: stored_rows.Number


def test_the_columns_of_a_row_accept_what_its_fields_hold_and_no_negative_number():
    found = stored_rows.columns(Bounded)
    assert [column.fault("1") for column in found] == [None] * 4
    assert [column.fault("-1") is None for column in found] == [True, False, False, False]
    assert [column.fault("1.5") is None for column in found] == [True, False, True, True]
    assert [column.fault("") is None for column in stored_rows.columns(Bounded, optional=True)] == [True] * 4


def test_the_first_steps_include_the_last_of_them():
    """Of the checkpoints, three a decade."""
    assert [row[5] for row in year.rows(year.CASES[0], steps=10)] == ["1", "2", "5", "10"]
