"""The stored sweeps of the package can be read, and no digit of them changes unnoticed."""

from __future__ import annotations

import pytest

from gpbnb.report.gravity_probe_b import year
from gpbnb.report.stored import SWEEPS
from gpbnb.sweeps import DamagedFileError


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
