"""A sweep computes cells one by one or on an executor, saves them until all are done, and stores them as one table.

A cell is a small picklable value, such as a named tuple of a model, a format and a seed. It determines its result
on any machine. Finished cells survive an interruption. The same class recomputes a sample of the stored cells.
"""

from __future__ import annotations

import hashlib
import operator
import platform
import subprocess
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import FIRST_COMPLETED, BrokenExecutor, CancelledError, Executor, Future, wait
from dataclasses import dataclass
from importlib import metadata
from pathlib import Path
from typing import Any, Generic, NamedTuple, TypeVar

import numpy as np
from tqdm import tqdm  # type: ignore[import-untyped]

from gpbnb.sweeps.record import read_record, write_record
from gpbnb.sweeps.table import Column, DamagedFileError, Record, StoredTable, read, write

C = TypeVar("C")

ATTEMPTS = 10
"""Number of times that a chunk is sent to a worker, if workers die."""


class Difference(NamedTuple):
    """A recomputed row that the stored table does not contain, and the stored row with the same key, if any."""

    cell: str
    stored: Record | None
    computed: Record


def _as_computed(cell: Any, result: Sequence[Any]) -> list[Record]:
    return [tuple(row) for row in result]  # lists, if they were saved


def _no_faults(file: Path) -> list[str]:
    return []


@dataclass(frozen=True)
class Sweep(Generic[C]):
    """One stored sweep.

    Parameters
    ----------
    name : name of the sweep, as in "kalman/year".
    file : file of the stored table.
    columns : columns of the table; the first `key` of them identify a row.
    key : number of columns that identify a row.
    cells : all cells, in the order of the table.
    compute : picklable function that returns the result of a cell, made of lists, dictionaries, texts and numbers. Its
        second argument is a directory in which a long cell may save its progress, or None.
    command : command that recomputes the sweep.
    seed : seed of all random numbers.
    rows : function that turns the result of a cell into rows; by default the result is these rows.
    version : a number that changes when results change, so that cells saved by an older version are not used.
    summary : function that makes further rows from the results of all cells.
    sample : function that recomputes rows of a cell as a check, by default all of them; it receives a random
        generator and may choose rows with it.
    same : function that decides whether a stored and a recomputed row agree; by default they must be equal.
    packages : packages whose versions the provenance lists.
    faults : function that lists the impossible results in a table.
    """

    name: str
    file: Path
    columns: tuple[Column, ...]
    key: int
    cells: Callable[[], Sequence[C]]
    compute: Callable[[C, Path | None], Any]
    command: str
    seed: int
    rows: Callable[[C, Any], list[Record]] = _as_computed
    version: str = "1"
    summary: Callable[[Sequence[tuple[C, Any]]], list[Record]] | None = None
    sample: Callable[[C, np.random.Generator], list[Record]] | None = None
    same: Callable[[Record, Record], bool] = operator.eq
    packages: tuple[str, ...] = ("numpy", "numba", "llvmlite")
    faults: Callable[[Path], list[str]] = _no_faults

    # -- computing --------------------------------------------------------------------------------------

    def run(
        self,
        directory: Path,
        executor: Executor | None = None,
        *,
        chunk: int = 1,
        cells: Sequence[C] | None = None,
        progress: bool = True,
    ) -> list[tuple[C, Any]]:
        """Compute the cells that are not yet saved in a directory, and return all cells in their order.

        Parameters
        ----------
        directory : folder for finished cells; after an interruption, the same call resumes.
        executor : any executor of concurrent.futures, or Dask's ``Client.get_executor()``; by default this process.
        chunk : number of cells that are sent at once.
        cells : some of the cells; all by default.
        """
        if chunk < 1:
            raise ValueError(f"got chunks of {chunk} cells; needed at least 1")
        directory.mkdir(parents=True, exist_ok=True)
        wanted = tuple(self.cells() if cells is None else cells)
        found = {cell: self._saved(cell, directory) for cell in wanted}
        missing = [cell for cell in wanted if found[cell] is None]
        chunks = [tuple(missing[start : start + chunk]) for start in range(0, len(missing), chunk)]
        done = len(wanted) - len(missing)
        with tqdm(total=len(wanted), initial=done, desc=self.name, unit="cell", disable=not progress) as bar:
            for part, results in self._computed(chunks, executor, directory):
                for cell, (result, seconds) in zip(part, results, strict=True):
                    found[cell] = self._save(cell, result, seconds, directory)
                bar.update(len(part))
        return [(cell, found[cell]["result"]) for cell in wanted]  # type: ignore[index]

    def finished(self, directory: Path) -> list[tuple[C, Any]]:
        """Return the cells that are saved in a directory, with their results."""
        saved = ((cell, self._saved(cell, directory)) for cell in self.cells())
        return [(cell, each["result"]) for cell, each in saved if each is not None]

    def recompute(
        self,
        folder: Path,
        executor: Executor | None = None,
        *,
        count: int | None = None,
        only: Sequence[str] = (),
        store: bool = False,
    ) -> Path:
        """Compute cells, save them in a subfolder with the name of the sweep, write the table and return its file.

        Parameters
        ----------
        folder : folder for the table and for saved progress.
        count : compute only this number of cells, the first ones; by default all cells.
        only : words, one of which must be in the text of a cell; the table keeps the stored rows of other cells.
        store : whether to write the table from the finished cells without computing more.
        """
        if only and self.summary is not None:
            raise ValueError(
                f"{self.name}: got words {' '.join(only)}; needed all cells, because the table has their sums"
            )
        chosen = [cell for cell in self.cells() if not only or any(word in str(cell) for word in only)][:count]
        if only and not chosen:
            raise ValueError(f"{self.name}: got no cell with {' or '.join(only)}; needed words of {self.cells()[0]}")
        progress, file = folder / self.name, folder / f"{self.name}.csv"
        if not store:
            self.run(progress, executor, cells=chosen)
        found = [(cell, result) for cell, result in self.finished(progress) if not only or cell in chosen]
        file.parent.mkdir(parents=True, exist_ok=True)
        self.store(found, self.seconds(progress), file, kept=self.load().rows if only else ())
        return file

    def store(
        self,
        results: Sequence[tuple[C, Any]],
        seconds: float | None = None,
        file: Path | None = None,
        kept: Sequence[Record] = (),
    ) -> None:
        """Write the table of results, with its provenance; a new row replaces a stored row with the same key."""
        lines = [row for cell, result in results for row in self.rows(cell, result)]
        if kept:
            lines = list(({row[: self.key]: row for row in kept} | {row[: self.key]: row for row in lines}).values())
        if self.summary is not None:
            lines += self.summary(results)
        write(file or self.file, self.columns, lines, self.provenance(len(results), seconds))

    def provenance(self, cells: int, seconds: float | None = None) -> dict[str, str]:
        """Return command, seed, machine, versions, and the commit if there is one."""
        found = {
            "command": self.command,
            "seed": str(self.seed),
            "cells": f"{cells} of {len(self.cells())}",
            **machine(self.packages),
        }
        return found if seconds is None else {**found, "processor seconds": f"{seconds:.0f}"}

    def seconds(self, directory: Path) -> float:
        """Return the processor time of all saved cells."""
        saved = (self._saved(cell, directory) for cell in self.cells())
        return float(sum(each["seconds"] for each in saved if each is not None))

    # -- reading ----------------------------------------------------------------------------------------

    def load(self, file: Path | None = None) -> StoredTable:
        """Read the stored table."""
        return read(file or self.file, self.columns, self.command)

    def verify(self, count: int, seed: int, progress: bool = False) -> list[Difference]:
        """Recompute a random sample of the stored cells, chosen by `seed`, and compare digit by digit.

        Parameters
        ----------
        count : number of cells; if there are no more than these, all are recomputed.
        """
        stored = {row[: self.key]: row for row in self.load().rows}
        if len(stored) < len(self.load().rows):
            raise ValueError(f"{self.name}: got several rows with the same key; needed a key that identifies each row")
        rng = np.random.default_rng([seed, int.from_bytes(hashlib.sha256(self.name.encode()).digest()[:4])])
        cells = [cell for cell in self.cells() if self._is_stored(cell, stored)]
        chosen = [cells[i] for i in sorted(rng.choice(len(cells), min(count, len(cells)), replace=False))]
        differences = []
        for cell in tqdm(chosen, desc=self.name, unit="cell", disable=not progress):
            again = self.rows(cell, self.compute(cell, None)) if self.sample is None else self.sample(cell, rng)
            if not again:
                raise ValueError(f"{self.name}: got no rows from {cell}; needed at least one to compare")
            for row in again:
                found = stored.get(row[: self.key])
                if found is None or not self.same(found, row):
                    differences.append(Difference(str(cell), found, row))
        return differences

    def _is_stored(self, cell: C, stored: Mapping[Record, Record]) -> bool:
        """Whether rows of a cell are stored; a sweep may be stored before all cells are computed."""
        names = cell_key(cell)
        return any(key[: len(names)] == names for key in stored)

    # -- saved cells ------------------------------------------------------------------------------------

    def _path(self, cell: C, directory: Path) -> Path:
        return directory / f"{hashlib.sha256(repr(cell).encode()).hexdigest()[:20]}.json"

    def _saved(self, cell: C, directory: Path) -> dict[str, Any] | None:
        """Return what is saved of a cell; None if there is nothing, or it is damaged and must be computed again."""
        try:
            found = read_record(self._path(cell, directory), self.command)
        except DamagedFileError:
            return None
        return found if (found.get("cell"), found.get("version")) == (repr(cell), self.version) else None

    def _save(self, cell: C, result: Any, seconds: float, directory: Path) -> dict[str, Any]:
        file = self._path(cell, directory)
        write_record(file, {"cell": repr(cell), "version": self.version, "seconds": seconds, "result": result})
        return read_record(file, self.command)

    # -- executors --------------------------------------------------------------------------------------

    def _computed(
        self, chunks: Sequence[tuple[C, ...]], executor: Executor | None, directory: Path
    ) -> Iterator[tuple[tuple[C, ...], list[tuple[Any, float]]]]:
        if executor is None:
            for chunk in chunks:
                yield chunk, _some(self.compute, chunk, directory)
            return
        tries = dict.fromkeys(range(len(chunks)), 1)
        pending: dict[Future[list[tuple[Any, float]]], int] = {
            executor.submit(_some, self.compute, chunk, directory): number for number, chunk in enumerate(chunks)
        }
        while pending:
            for future in wait(pending, return_when=FIRST_COMPLETED).done:
                number = pending.pop(future)
                try:
                    results = future.result()
                except Exception as error:
                    if not _is_of_the_worker(error):
                        raise
                    if tries[number] >= ATTEMPTS:
                        raise RuntimeError(
                            f"{self.name}: got {ATTEMPTS} workers that died under one chunk of "
                            f"{len(chunks[number])} cells; needed workers that survive; give them "
                            "more memory, or send smaller chunks"
                        ) from error
                    tries[number] += 1
                    pending[executor.submit(_some, self.compute, chunks[number], directory)] = number
                else:
                    yield chunks[number], results


def cell_key(cell: Any) -> Record:
    """Return the first columns of a cell's rows: its `key`, or nothing."""
    return tuple(getattr(cell, "key", ()))


def _some(compute: Callable[[C, Path | None], Any], chunk: Sequence[C], directory: Path) -> list[tuple[Any, float]]:
    found = []
    for cell in chunk:
        start = time.process_time()
        result = compute(cell, directory)
        found.append((result, time.process_time() - start))
    return found


def _is_of_the_worker(error: BaseException) -> bool:
    """Whether a chunk failed because of its worker; Dask's own exceptions are recognized without importing Dask."""
    if isinstance(error, BrokenExecutor):
        return False  # the executor accepts no more work
    return isinstance(error, CancelledError) or type(error).__module__.partition(".")[0] in ("distributed", "dask")


def machine(packages: Sequence[str] = ("numpy", "numba", "llvmlite")) -> dict[str, str]:
    """Return system, versions, and the commit if there is one."""
    here = Path(__file__).parent
    try:
        found = subprocess.run(
            ["git", "-C", str(here), "rev-parse", "--short=12", "HEAD"], capture_output=True, text=True, check=False
        ).stdout.strip()
    except OSError:
        found = ""
    return {
        "machine": f"{platform.system()} {platform.machine()}, Python {platform.python_version()}",
        "versions": ", ".join(f"{name} {metadata.version(name)}" for name in packages),
        "commit": found or "none",
    }
