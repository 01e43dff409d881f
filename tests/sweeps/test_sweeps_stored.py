"""The stored sweeps of the package can be read, and a sample of them comes out again."""

from __future__ import annotations

import os
from datetime import UTC, datetime

import pytest

from gpbnb.report.gravity_probe_b import year
from gpbnb.report.stored import SWEEPS
from gpbnb.sweeps import DamagedFileError

#: Sweeps of which a cell, or its first steps, takes seconds; `make verify-sweeps` computes cells of the others.
CHEAP = (year.SWEEP, year.BOUND_SWEEP)


@pytest.mark.parametrize("sweep", SWEEPS, ids=lambda sweep: sweep.name)
def test_every_stored_sweep_is_undamaged(sweep):
    table = sweep.load()
    keys = [row[: sweep.key] for row in table.rows]
    assert len(set(keys)) == len(keys) > 0
    assert table.provenance["command"] == sweep.command


@pytest.mark.parametrize("sweep", SWEEPS, ids=lambda sweep: sweep.name)
def test_one_changed_digit_is_found(sweep, tmp_path):
    text = sweep.file.read_text(encoding="utf-8")
    last = max(text.rfind(each) for each in "123456789")
    changed = tmp_path / sweep.file.name
    changed.write_text(f"{text[:last]}{'8' if text[last] == '9' else '9'}{text[last + 1 :]}", encoding="utf-8")
    with pytest.raises(DamagedFileError):
        sweep.load(changed)


def test_the_first_steps_include_the_last_of_them():
    """Of the checkpoints, three a decade."""
    assert [row[5] for row in year.rows(year.CASES[0], steps=10)] == ["1", "2", "5", "10"]


def test_a_year_is_verified_by_its_first_steps():
    """Of another cell each day. ``GPBNB_SAMPLE=20260131 python -m pytest …`` takes the sample of that day again."""
    seed = int(os.environ.get("GPBNB_SAMPLE") or f"{datetime.now(UTC):%Y%m%d}")
    print(f"GPBNB_SAMPLE={seed}")  # shown if it fails
    for sweep in CHEAP:
        assert sweep.verify(1, seed) == [], f"GPBNB_SAMPLE={seed}"
