"""A printed matrix with dots, and the matrices that it can stand for."""

from __future__ import annotations

import itertools
import operator
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any


@dataclass(frozen=True, eq=False)
class DottedMatrix:
    r"""A matrix of which some cells are dots, as in :math:`[\,a_{11} \cdots a_{1n}\,]`.

    A row that begins or ends with dots stands for any number of rows, including none; a column whose top or bottom is
    dots stands for any number of columns. Every other row or column is one row or column. Dots match anything. A
    printed cell matches if all entries that it stands for compare with it as asked. The display compares with a matrix
    if some choice of these numbers makes all cells match; its first row is then the first row of the matrix, its last
    row the last one, and rows without dots between them are neighbours. The same holds for columns.

    Parameters
    ----------
    cells : rows of cells, all of the same length; a cell is a number or the `Ellipsis` ``...``.

    Examples
    --------
    >>> import sympy as sp
    >>> display = DottedMatrix([[1, ..., 4], [..., ..., ...], [0, ..., 1]])
    >>> display == sp.Matrix([[1, 2, 4], [3, 1, 5], [0, 7, 1]])
    True
    >>> display == sp.Matrix([[1, 4], [1, 1]])
    False
    """

    cells: Sequence[Sequence[Any]]

    __hash__ = None  # type: ignore[assignment]

    def __post_init__(self) -> None:
        lengths = [len(row) for row in self.cells]
        if len(set(lengths)) != 1:
            raise ValueError(f"got rows of {lengths} cells; needed rows of the same length")

    def __eq__(self, other: object) -> bool:
        return self._compares(other, operator.eq)

    def __le__(self, other: Any) -> bool:
        return self._compares(other, operator.le)

    def __ge__(self, other: Any) -> bool:
        return self._compares(other, operator.ge)

    def __mul__(self, factor: Any) -> DottedMatrix:
        """Multiply every cell by a number."""
        if getattr(factor, "shape", ()):
            return NotImplemented
        return DottedMatrix([[cell if cell is ... else cell * factor for cell in row] for row in self.cells])

    __rmul__ = __mul__

    def __neg__(self) -> DottedMatrix:
        return self * -1

    def _compares(self, other: Any, compare: Callable[[Any, Any], Any]) -> bool:
        """Whether some placement makes every printed cell compare with all entries that it stands for."""
        if not getattr(other, "shape", ()):
            return NotImplemented
        entries = other.tolist()
        columns = list(zip(*self.cells, strict=True))
        return any(
            all(
                cell is ... or all(compare(cell, entries[i][j]) for i in rows for j in across)
                for row, rows in zip(self.cells, down, strict=True)
                for cell, across in zip(row, right, strict=True)
            )
            for down, right in itertools.product(
                _placements(self.cells, len(entries)), _placements(columns, len(entries[0]))
            )
        )


def _placements(lines: Sequence[Sequence[Any]], length: int, start: int = 0) -> Iterator[list[range]]:
    """Divide start … length - 1 among lines: any number of them for a line with dots at an end, else one."""
    if not lines:
        if start == length:
            yield []
        return
    elastic = lines[0][0] is ... or lines[0][-1] is ...
    for stop in range(start, length + 1) if elastic else [start + 1]:
        for others in _placements(lines[1:], length, stop):
            yield [range(start, stop), *others]
