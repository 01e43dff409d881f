"""gpbnb.sweeps.sweep: a sweep gives the same on every executor, goes on after an interruption and verifies itself."""

from __future__ import annotations

import dataclasses
import re
from concurrent.futures import ThreadPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from typing import NamedTuple

import numpy as np
import pytest
from distributed import KilledWorker
from executors import Failing

from gpbnb.report.guarantees import scalar
from gpbnb.sweeps import Column, DamagedFileError, Sweep, read, write
from gpbnb.sweeps import command as sweep_command
from gpbnb.sweeps.command import INTERRUPTED, verify
from gpbnb.sweeps.sweep import ATTEMPTS


def run(sweeps, arguments):
    return sweep_command.run(sweeps, "python -m sweeps", arguments)


class Cell(NamedTuple):
    name: str
    seed: int

    @property
    def key(self):
        return self.name, str(self.seed)


CELLS = tuple(Cell(name, seed) for name in ("first", "second") for seed in range(5))
COLUMNS = (Column("name", "text"), Column("seed", "integer"), Column("part", "text"), Column("value"))


def compute(cell, directory):
    return np.random.default_rng([cell.seed, len(cell.name)]).standard_normal(3).tolist()


def rows(cell, result):
    return [(*cell.key, str(part), f"{value:.6g}") for part, value in enumerate(result)]


def total(results):
    return [("all", "0", "all", f"{sum(sum(result) for _, result in results):.6g}")]


@pytest.fixture
def sweep(tmp_path):
    return Sweep("tests/normal", tmp_path / "normal.csv", COLUMNS, 3, lambda: CELLS, compute, "make it", 7, rows)


EXPECTED = [(cell, compute(cell, None)) for cell in CELLS]


@pytest.mark.parametrize("chunk", [1, 3, 100])
def test_the_result_does_not_depend_on_the_executor(sweep, tmp_path, chunk):
    assert sweep.run(tmp_path / "serial", chunk=chunk, progress=False) == EXPECTED
    with ThreadPoolExecutor(2) as pool:
        assert sweep.run(tmp_path / "threads", pool, chunk=chunk, progress=False) == EXPECTED


def test_finished_cells_are_not_computed_again(sweep, tmp_path):
    seen = []

    def interrupted(cell, directory):
        if len(seen) == 4:
            raise KeyboardInterrupt
        seen.append(cell)
        return compute(cell, directory)

    with pytest.raises(KeyboardInterrupt):
        dataclasses.replace(sweep, compute=interrupted).run(tmp_path / "some", progress=False)
    assert sweep.finished(tmp_path / "some") == EXPECTED[:4]
    assert 0 <= sweep.seconds(tmp_path / "some") < 1

    def rest(cell, directory):
        seen.append(cell)
        return compute(cell, directory)

    assert dataclasses.replace(sweep, compute=rest).run(tmp_path / "some", progress=False) == EXPECTED
    assert tuple(seen) == CELLS
    newer = dataclasses.replace(sweep, version="2")
    assert newer.finished(tmp_path / "some") == []


def _with_another_digit(text):
    """The text of a record with the first digit of its result changed."""
    begin, result, end = text.partition('"result"')
    return begin + result + re.sub("[0-9]", lambda digit: str(9 - int(digit[0])), end, count=1)


@pytest.mark.parametrize("damage", [lambda text: text[:-9], lambda text: "", lambda text: "[]", _with_another_digit])
def test_a_damaged_cell_is_computed_again(sweep, tmp_path, damage):
    expected = sweep.run(tmp_path, progress=False)
    for file in tmp_path.glob("*.json"):
        text = file.read_text(encoding="utf-8")
        assert damage(text) != text
        file.write_text(damage(text), encoding="utf-8")
    assert sweep.finished(tmp_path) == []
    assert sweep.run(tmp_path, progress=False) == expected
    assert sweep.finished(tmp_path) == expected


def test_the_command_goes_on_after_an_interruption_and_stores_what_is_finished(sweep, tmp_path, capsys):
    def again(one, folder, *arguments):
        return run([one], ["recompute", one.name, "--output", str(tmp_path / folder), *arguments])

    def interrupted(cell, directory):
        raise KeyboardInterrupt

    def stored(folder):
        return sweep.load(tmp_path / folder / "tests" / "normal.csv").rows

    assert again(sweep, "saved", "--cells", "3") == 0
    assert capsys.readouterr().out == f"{tmp_path / 'saved' / 'tests' / 'normal.csv'}: 9 rows\n"
    assert len(stored("saved")) == 3 * 3
    assert again(dataclasses.replace(sweep, compute=interrupted), "saved") == INTERRUPTED == 130
    assert capsys.readouterr().err.endswith(
        f"\ninterrupted; run the same command again to continue from the progress saved in {tmp_path / 'saved'}\n"
    )
    (tmp_path / "saved" / "tests" / "normal.csv").unlink()
    assert again(dataclasses.replace(sweep, compute=interrupted), "saved", "--store") == 0
    assert len(stored("saved")) == 3 * 3
    assert again(sweep, "saved") == 0
    assert len(stored("saved")) == 3 * len(CELLS)
    assert again(sweep, "other", "--cells", "2") == 0
    assert len(stored("other")) == 3 * 2


def test_words_choose_cells_and_the_other_stored_rows_stay(sweep, tmp_path):
    sweep.store(EXPECTED)
    higher = dataclasses.replace(sweep, compute=lambda cell, directory: [value + 1 for value in compute(cell, None)])
    given = ["recompute", sweep.name, "--output", str(tmp_path / "new"), "--only", "second", "seed=4"]
    assert run([higher], given) == 0
    before, after = sweep.load().rows, sweep.load(tmp_path / "new" / "tests" / "normal.csv").rows
    assert [row[: sweep.key] for row in before] == [row[: sweep.key] for row in after]
    changed = {row[:2] for row, other in zip(before, after, strict=True) if row != other}
    assert changed == {cell.key for cell in CELLS if cell.name == "second" or cell.seed == 4}


def test_the_command_fails_where_a_result_must_not_occur(sweep, tmp_path, capsys):
    for faults, status in (([], 0), (["first 0 is wrong"], 1)):
        one = dataclasses.replace(sweep, faults=lambda file, faults=faults: faults if file.exists() else ["no file"])
        assert run([one], ["recompute", one.name, "--output", str(tmp_path / str(status)), "--cells", "1"]) == status
        assert capsys.readouterr().out.splitlines()[1:] == faults
    last = dataclasses.replace(one, name="tests/last", faults=lambda file: [])
    assert run([one, last], ["recompute", one.name, last.name, "--output", str(tmp_path), "--cells", "1"]) == 1
    assert capsys.readouterr().out.splitlines()[2:] == faults


def test_the_processes_of_this_machine_give_the_stored_rows(tmp_path, capsys):
    given = ["recompute", "guarantees/scalar", "--cells", "2", "--processes", "2", "--output", str(tmp_path)]
    assert run([scalar.SWEEP], given) == 0
    assert scalar.load(tmp_path / "guarantees" / "scalar.csv") == scalar.load()[:2]


def test_chunks_of_dead_workers_are_sent_again(sweep, tmp_path):
    failing = Failing(*[KilledWorker("some", None, 3)] * 3)
    assert sweep.run(tmp_path / "some", failing, chunk=5, progress=False) == EXPECTED
    assert failing.sent == 5
    with pytest.raises(RuntimeError, match=f"got {ATTEMPTS} workers that died under one chunk of 10 cells"):
        sweep.run(tmp_path / "none", Failing(*[KilledWorker("some", None, 3)] * 20), chunk=10, progress=False)
    for error in (BrokenProcessPool(), ValueError("of the computation")):
        with pytest.raises(type(error)):
            sweep.run(tmp_path / "none", Failing(error), chunk=10, progress=False)
    with pytest.raises(ValueError, match="got chunks of 0 cells"):
        sweep.run(tmp_path / "none", chunk=0)


def test_what_is_stored_has_its_provenance(sweep):
    whole = dataclasses.replace(sweep, summary=total)
    whole.store(EXPECTED, 12.3)
    table = whole.load()
    assert len(table.rows) == 31
    assert table.rows[-1] == total(EXPECTED)[0]
    assert table.provenance["command"] == "make it"
    assert table.provenance["seed"] == "7"
    assert table.provenance["cells"] == "10 of 10"
    assert table.provenance["processor seconds"] == "12"
    assert table.provenance["versions"].startswith("numpy ")
    assert {"machine", "commit"} < set(table.provenance)


def test_a_sample_of_what_is_stored_is_verified(sweep):
    sweep.store(EXPECTED)
    assert sweep.verify(4, seed=1) == []
    assert sweep.verify(100, seed=1) == []
    table = read(sweep.file, COLUMNS, "")
    # A careless rewrite: a wrong digit.
    for place in (0, 14, 29):
        changed = list(table.rows)
        changed[place] = (*changed[place][:3], "0.123")
        write(sweep.file, COLUMNS, changed, {"command": "make it"})
        (difference,) = sweep.verify(10, seed=1)
        assert difference.stored == changed[place]
        assert difference.computed == table.rows[place]
        found = [bool(sweep.verify(4, seed)) for seed in range(8)]
        assert True in found
        assert False in found  # not all cells are computed
        assert len(verify([sweep, sweep], 10, 1)) == 2


def test_the_command_reports(sweep, capsys):
    sweep.store(EXPECTED)
    assert run([sweep], ["verify", "--sample", "2", "--seed", "5"]) == 0
    assert "1 sweeps, 2 cells of each: no differences" in capsys.readouterr().out
    assert run([sweep], ["list"]) == 0
    assert "tests/normal: command make it; seed 7; cells 10 of 10" in capsys.readouterr().out
    with pytest.raises(SystemExit):
        run([sweep], ["verify", "tests/other"])
    with pytest.raises(SystemExit):
        run([sweep], ["verify", "--sample", "0"])
    capsys.readouterr()
    changed = [(*row[:3], "0.5") for row in sweep.load().rows]
    write(sweep.file, COLUMNS, changed, {})
    assert run([sweep], ["verify"]) == 1
    first, *others, last = capsys.readouterr().out.splitlines()
    name, seed, part, value = sweep.verify(1, 1)[0].computed
    assert first.startswith("tests/normal, ")
    assert first.endswith(
        f": stored ('{name}', '{seed}', '{part}', '0.5'), computed ('{name}', '{seed}', '{part}', '{value}')"
    )
    assert last == f"1 sweeps, 1 cells of each: {1 + len(others)} differences"
    sweep.file.write_bytes(sweep.file.read_bytes()[:-20])
    assert run([sweep], ["verify"]) == 1
    assert "rows" in capsys.readouterr().err
    with pytest.raises(DamagedFileError):
        sweep.load()
