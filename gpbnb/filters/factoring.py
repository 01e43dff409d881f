"""Factors and inverses of covariances in a format, each operation rounded."""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gpbnb.arithmetic.algebra import Matrix, inverse_in_order
from gpbnb.arithmetic.machine import code_of, evaluate, fault_of, packed_constants, tables
from gpbnb.arithmetic.tape import Tape
from gpbnb.arithmetic.traced import TracedFormat
from gpbnb.filters.array_steps import if_nonzero


def factors(a: Matrix) -> tuple[Matrix, Any]:
    """Return the factors of a = U D U' with D on the diagonal, and whether they are those of a covariance.

    They are not if an entry of D is negative, or if it is zero and an entry above it is not.
    """
    n = len(a)
    rows = [[a[i, j] for j in range(n)] for i in range(n)]
    found = [[each * 0 for each in row] for row in rows]
    definite = True
    for j in range(n - 1, -1, -1):
        d = found[j][j] = rows[j][j]
        above = [rows[i][j] for i in range(j)]
        definite = definite & (d >= 0)
        for each in above:
            definite = definite & ((d != 0) | (each == 0))
        column = if_nonzero(d, _divided(above, d), [each * 0 for each in above])
        for i in range(j):
            found[i][j] = column[i]
            for k in range(i + 1):
                rows[k][i] = rows[k][i] - column[k] * above[i]
    return np.stack([np.stack(row) for row in found]), definite


def _divided(above: list[Matrix], d: Matrix) -> Callable[[], list[Matrix]]:
    return lambda: [each / d for each in above]


def inverse(a: Matrix) -> tuple[Matrix, Any]:
    """Return the inverse of a covariance, and whether all pivots are positive."""
    found = inverse_in_order(a, a.format.eye(len(a)))
    definite: Any = True
    for pivot in found.pivots:
        definite = definite & np.all(pivot > 0)
    return found.matrix, definite


class _Recorded:
    """A function of one array that is recorded once, and then runs on many arrays in any format with loops.

    Parameters
    ----------
    function : takes an array of the given shape, and returns another and a truth value.
    """

    def __init__(self, function: Callable[[Any], tuple[Any, Any]], shape: tuple[int, ...]) -> None:
        count = math.prod(shape)
        self._tape, self._shape = Tape(count), shape
        result, truth = function(TracedFormat(self._tape).made(1 + np.arange(count).reshape(shape)))
        self._places, self._truth = result.components[0], truth.components[0]

    def run(self, fmt: Any, tag: Any, given: NDArray[Any]) -> tuple[NDArray[Any], NDArray[np.bool_]]:
        """Run the function on each of some packed arrays, in a format and its arithmetic."""
        kind, formats = tables([fmt], tag)
        tape, lanes = self._tape, len(given)
        rows = tape.instructions.astype(np.int64)
        parts = given.shape[1:][len(self._shape) :]
        values = np.zeros((tape.sizes[0], lanes, *parts), given.dtype)
        truths = np.zeros((tape.sizes[1], lanes), np.uint8)
        truths[1] = 1
        for constants in tape.all_constants:
            if constants.places:
                values[constants.places] = packed_constants(fmt, constants)[:, np.newaxis]
        values[1 : 1 + tape.inputs] = np.moveaxis(given.reshape(lanes, tape.inputs, *parts), 0, 1)
        done = evaluate(kind, formats, code_of(rows, tape.formats), values, truths)
        if done < len(rows):
            fault = fault_of(rows, values, done)
            raise (OverflowError if fault.overflows else ZeroDivisionError)(f"got {fault.reason}")
        found = np.moveaxis(values[self._places.ravel()], 1, 0).reshape(lanes, *self._places.shape, *parts)
        return found, truths[self._truth] != 0


@lru_cache(maxsize=32)
def _recorded(function: Callable[[Matrix], tuple[Matrix, Any]], n: int) -> _Recorded:
    return _Recorded(function, (n, n))


def factors_of_each(fmt: Any, tag: Any, matrices: NDArray[Any], found: NDArray[Any]) -> bool:
    """Fill in the factors of packed covariances (p, n, n, ...); return whether all are definite."""
    return _of_each(factors, fmt, tag, matrices, found)


def inverses_of_each(fmt: Any, tag: Any, matrices: NDArray[Any], found: NDArray[Any]) -> bool:
    """Fill in the inverses of packed covariances (p, n, n, ...); return whether all are definite."""
    return _of_each(inverse, fmt, tag, matrices, found)


def _of_each(
    function: Callable[[Matrix], tuple[Matrix, Any]], fmt: Any, tag: Any, matrices: NDArray[Any], found: NDArray[Any]
) -> bool:
    results, definite = _recorded(function, matrices.shape[1]).run(fmt, tag, matrices)
    found[:] = results
    return bool(definite.all())
