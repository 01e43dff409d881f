"""gpbnb.report.sweep and its command: a sweep resumes after an interruption, and a sample of it is verified."""

from __future__ import annotations

import dataclasses
from typing import NamedTuple

import numpy as np
import pytest

from gpbnb.report import stored
from gpbnb.report.guarantees import scalar
from gpbnb.report.stored_table import Column, write
from gpbnb.report.sweep import Sweep


class Cell(NamedTuple):
    name: str
    seed: int


CELLS = tuple(Cell(name, seed) for name in ("first", "second") for seed in range(5))
COLUMNS = (Column("name", "text"), Column("seed", "integer"), Column("part", "text"), Column("value"))


def compute(cell):
    return np.random.default_rng([cell.seed, len(cell.name)]).standard_normal(3)


def rows(cell, result):
    return [(cell.name, str(cell.seed), str(part), f"{value:.6g}") for part, value in enumerate(result)]


def total(results):
    return [("all", "0", "all", f"{sum(sum(result) for _, result in results):.6g}")]


SWEEP = Sweep("tests/normal", COLUMNS, 3, lambda: CELLS, compute, 7, rows, total)
EXPECTED = tuple(row for cell in CELLS for row in rows(cell, compute(cell)))


@pytest.fixture
def command(monkeypatch, tmp_path):
    """Runs the command with a sweep whose table is in the folder of the test."""
    monkeypatch.setattr(Sweep, "file", property(lambda self: tmp_path / f"{self.name}.csv"))

    def run(sweep, name, *arguments):
        monkeypatch.setattr(stored, "SWEEPS", (sweep,))
        return stored.main([name, sweep.name, *arguments])

    return lambda sweep, *arguments: run(
        sweep, *arguments, *(["--output", str(tmp_path)] if arguments[0] == "recompute" else [])
    )


def test_an_interrupted_sweep_resumes_and_computes_no_cell_twice(command, tmp_path, capsys):
    seen = []

    def interrupted(cell):
        if len(seen) == 4:
            raise KeyboardInterrupt
        return noted(cell)

    def noted(cell):
        seen.append(cell)
        return compute(cell)

    assert command(dataclasses.replace(SWEEP, compute=interrupted), "recompute") == 130
    assert capsys.readouterr().err.endswith(
        f"\ninterrupted; run the same command again to continue from the progress saved in {tmp_path}\n"
    )
    assert not SWEEP.file.exists()
    assert command(dataclasses.replace(SWEEP, compute=noted), "recompute") == 0
    assert capsys.readouterr().out == f"{SWEEP.file}: 31 rows\n"
    assert tuple(seen) == CELLS
    assert SWEEP.load().rows == (*EXPECTED, SWEEP.load().rows[-1])
    assert SWEEP.load().rows[-1][0] == "all"
    assert command(dataclasses.replace(SWEEP, compute=noted), "recompute") == 0
    assert tuple(seen) == CELLS * 2  # a finished sweep starts anew


def test_processes_give_the_same(tmp_path):
    few = dataclasses.replace(scalar.SWEEP, cells=lambda: range(3))
    assert scalar.load(few.recompute(tmp_path, processes=2)) == scalar.load()[:3]


def test_the_command_fails_where_a_result_must_not_occur(command, capsys):
    for faults, status in (([], 0), (["first 0 is wrong"], 1)):
        one = dataclasses.replace(SWEEP, faults=lambda file, faults=faults: faults if file.exists() else ["no file"])
        assert command(one, "recompute") == status
        assert capsys.readouterr().out.splitlines()[1:] == faults


def test_a_sample_is_verified(command, capsys):
    assert command(SWEEP, "recompute") == 0
    table = SWEEP.load()
    provenance = {"command": "python -m gpbnb.report.stored recompute tests/normal", "seed": "7"}
    assert provenance.items() < table.provenance.items()
    assert {"machine", "versions", "commit"} < set(table.provenance)
    assert command(SWEEP, "list") == 0
    assert "tests/normal: command python" in capsys.readouterr().out
    assert command(SWEEP, "verify", "--sample", "100") == 0
    assert capsys.readouterr().out == "1 sweeps, 100 cells of each: no differences\n"
    for place in (0, 14, 29):  # a careless rewrite: a wrong digit
        changed = list(table.rows)
        changed[place] = (*changed[place][:3], "0.123")
        write(SWEEP.file, COLUMNS, changed, {})
        (difference,) = SWEEP.verify(10, 1)
        assert difference.startswith("tests/normal, Cell(name=")
        assert difference.endswith(f": stored {changed[place]}, computed {table.rows[place]}")
        assert len({len(SWEEP.verify(4, seed)) for seed in range(8)}) == 2  # some samples miss the cell
    assert command(SWEEP, "verify", "--sample", "10") == 1
    assert capsys.readouterr().out.splitlines() == [difference, "1 sweeps, 10 cells of each: 1 differences"]
    SWEEP.file.write_bytes(SWEEP.file.read_bytes()[:-20])
    assert command(SWEEP, "verify") == 1
    assert "rows" in capsys.readouterr().err
    for wrong in (["verify", "tests/other"], ["verify", "--sample", "0"]):
        with pytest.raises(SystemExit):
            stored.main(wrong)
