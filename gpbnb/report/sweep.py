"""A sweep is a long computation in cells, whose results are stored as one table in the folder of its chapter.

A cell is a small picklable value, such as a named tuple of a model, a format and a seed. Its result depends on nothing
else. Finished cells survive an interruption. The same class recomputes a sample of the stored cells.
"""

from __future__ import annotations

import hashlib
import operator
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Annotated, Any, Generic, TypeVar, get_type_hints

import numpy as np
from joblib import Memory, Parallel, delayed
from tqdm import tqdm  # type: ignore[import-untyped]

from gpbnb.files import machine
from gpbnb.report.stored_table import Column, Record, StoredTable, read, write

C = TypeVar("C")
R = TypeVar("R", bound=tuple[Any, ...])

Number = Annotated[str, "number"]
Whole = Annotated[str, "integer"]
"""Numbers as the text that is stored, which may be empty in an optional column."""

_KINDS = {int: "integer", float: "number"}


def _result(commit: str, text: str, compute: Callable[[C], Any], cell: C) -> Any:
    return compute(cell)


@dataclass(frozen=True)
class Sweep(Generic[C]):
    """One stored sweep.

    Parameters
    ----------
    name : name of the sweep and of its file, as in "gravity_probe_b/year".
    columns : columns of the table; the first `key` of them identify a row.
    cells : all cells, in the order of the table.
    compute : picklable function that returns the result of a cell.
    seed : seed of all random numbers.
    rows : function that turns the result of a cell into rows; by default the result is these rows.
    summary : function that makes further rows from the results of all cells.
    sample : function that recomputes rows of a cell as a check, by default all of them; it receives a random
        generator and may choose rows with it.
    same : function that decides whether a stored and a recomputed row agree; by default they must be equal.
    faults : function that lists the impossible results in a table.
    """

    name: str
    columns: tuple[Column, ...]
    key: int
    cells: Callable[[], Sequence[C]]
    compute: Callable[[C], Any]
    seed: int = 0
    rows: Callable[[C, Any], list[Record]] = lambda cell, result: result
    summary: Callable[[Sequence[tuple[C, Any]]], list[Record]] = lambda results: []
    sample: Callable[[C, np.random.Generator], list[Record]] | None = None
    same: Callable[[Record, Record], bool] = operator.eq
    faults: Callable[[Path], list[str]] = lambda file: []

    @property
    def file(self) -> Path:
        """The file of the stored table."""
        return Path(__file__).parent / f"{self.name}.csv"

    @property
    def command(self) -> str:
        """The command that recomputes the sweep."""
        return f"python -m gpbnb.report.stored recompute {self.name}"

    def load(self, file: Path | None = None) -> StoredTable:
        """Read the stored table."""
        return read(file or self.file, self.columns, self.command)

    def recompute(self, folder: Path, processes: int = 1) -> Path:
        """Compute all cells, write the table into a folder and return its file.

        Finished cells are saved in a subfolder until the table is written. After an interruption, the call resumes,
        unless there is another commit, whose results may differ.
        """
        saved = Memory(folder / self.name, verbose=0)
        result = saved.cache(_result, ignore=["compute", "cell"])
        cells, commit = self.cells(), machine()["commit"]
        results = Parallel(processes, return_as="generator")(
            delayed(result)(commit, repr(cell), self.compute, cell) for cell in cells
        )
        found = list(zip(cells, tqdm(results, self.name, len(cells), unit="cell"), strict=True))
        rows = [row for cell, each in found for row in self.rows(cell, each)]
        file = folder / f"{self.name}.csv"
        write(file, self.columns, rows + self.summary(found), self.provenance())
        saved.clear(warn=False)
        return file

    def provenance(self) -> dict[str, str]:
        """Return command, seed, machine, versions, and the commit if there is one."""
        return {"command": self.command, "seed": str(self.seed), **machine()}

    def verify(self, count: int, seed: int) -> list[str]:
        """Recompute a random sample of cells, chosen by `seed`, and describe each row that differs from the stored one.

        Parameters
        ----------
        count : number of cells; if there are no more than these, all are recomputed.
        """
        stored = {row[: self.key]: row for row in self.load().rows}
        rng = np.random.default_rng([seed, int.from_bytes(hashlib.sha256(self.name.encode()).digest()[:4])])
        cells = self.cells()
        chosen = sorted(rng.choice(len(cells), min(count, len(cells)), replace=False))
        differences = []
        for cell in tqdm([cells[i] for i in chosen], self.name, unit="cell"):
            for row in self.sample(cell, rng) if self.sample else self.rows(cell, self.compute(cell)):
                found = stored.get(row[: self.key])
                if found is None or not self.same(found, row):
                    differences.append(f"{self.name}, {cell}: stored {found or 'nothing'}, computed {row}")
        return differences


# -- rows that are declared once, as a named tuple --------------------------------------------------------------------


def columns(row: type[R], optional: bool = False) -> tuple[Column, ...]:
    """Return the columns for the fields of a named tuple: texts, whole numbers and numbers, none of them negative."""
    found = []
    for name, hint in get_type_hints(row, include_extras=True).items():
        kind: Any = _KINDS.get(hint) or getattr(hint, "__metadata__", ("text",))[0]
        found.append(Column(name, kind, 0, optional=optional))
    return tuple(found)


def sweep_of_rows(
    name: str,
    row: type[R],
    cells: Callable[[], Sequence[C]],
    examine: Callable[[C], R],
    optional: bool = False,
    **more: Any,
) -> Sweep[C]:
    """Return a sweep whose cells have a row each, which its first column identifies."""
    return Sweep(name, columns(row, optional), 1, cells, partial(one_row, examine), **more)


def one_row(examine: Callable[[C], R], cell: C) -> list[Record]:
    """Return the row of a cell as it is stored."""
    return [tuple(str(each) for each in examine(cell))]


def load(stored: Sweep[Any], row: type[R], file: Path | None = None) -> tuple[R, ...]:
    """Return the stored rows as named tuples."""
    kinds = get_type_hints(row).values()
    return tuple(row(*(kind(text) for kind, text in zip(kinds, line, strict=True))) for line in stored.load(file).rows)
