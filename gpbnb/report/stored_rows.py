"""Stored tables of the chapters: where each is kept, and rows that are declared once, as a named tuple."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from typing import Annotated, Any, TypeVar, get_type_hints

from gpbnb.sweeps import Column, Sweep

C = TypeVar("C")
R = TypeVar("R", bound=tuple[Any, ...])

Number = Annotated[str, "number"]
Whole = Annotated[str, "integer"]
"""Numbers as the text that is stored, which may be empty in an optional column."""

_KINDS = {int: "integer", float: "number"}


def columns(row: type[R], optional: bool = False) -> tuple[Column, ...]:
    """Return the columns for the fields of a named tuple: texts, whole numbers and numbers, none of them negative."""
    found = []
    for name, hint in get_type_hints(row, include_extras=True).items():
        kind: Any = _KINDS.get(hint) or getattr(hint, "__metadata__", ("text",))[0]
        found.append(Column(name, kind, 0, optional=optional))
    return tuple(found)


def sweep(
    name: str,
    columns: Sequence[Column],
    key: int,
    cells: Callable[[], Sequence[C]],
    compute: Callable[[C, Path | None], Any],
    seed: int = 0,
    **more: Any,
) -> Sweep[C]:
    """Return a sweep that is kept in the folder of its chapter, as in gravity_probe_b/year."""
    command = f"python -m gpbnb.report.stored recompute {name}"
    file = Path(__file__).parent / f"{name}.csv"
    return Sweep(name, file, tuple(columns), key, cells, compute, command, seed, **more)


def sweep_of_rows(
    name: str,
    row: type[R],
    cells: Callable[[], Sequence[C]],
    examine: Callable[[C], R],
    optional: bool = False,
    **more: Any,
) -> Sweep[C]:
    """Return a sweep whose cells have a row each, which its first column identifies."""
    return sweep(name, columns(row, optional), 1, cells, partial(one_row, examine), **more)


def one_row(examine: Callable[[C], R], cell: C, directory: Path | None = None) -> list[list[str]]:
    """Return the row of a cell as it is stored."""
    return [[str(each) for each in examine(cell)]]


def load(stored: Sweep[Any], row: type[R], file: Path | None = None) -> tuple[R, ...]:
    """Return the stored rows as named tuples."""
    kinds = get_type_hints(row).values()
    return tuple(row(*(kind(text) for kind, text in zip(kinds, line, strict=True))) for line in stored.load(file).rows)
