"""Copies and comparisons of rows in loops: numba's own, of whole arrays, take seconds to compile."""

from __future__ import annotations

from typing import Any

from numba.extending import overload


def copy_row(given: Any, i: Any, to: Any, j: Any) -> Any:
    """to[j] = given[i], for arrays of one to three axes; an axis of lanes that is missing in `given` is the second."""
    raise TypeError("got a call of copy_row from Python; needed one from a function compiled by numba")


@overload(copy_row, strict=False, jit_options={"_nrt": False})
def _overloaded_copy_row(given: Any, i: Any, to: Any, j: Any) -> Any:
    def of_numbers(given: Any, i: Any, to: Any, j: Any) -> Any:
        to[j] = given[i]

    def of_rows(given: Any, i: Any, to: Any, j: Any) -> Any:
        for k in range(to.shape[1]):
            to[j, k] = given[i, k]

    def to_lanes(given: Any, i: Any, to: Any, j: Any) -> Any:
        for k in range(to.shape[1]):
            to[j, k] = given[i]

    def rows_to_lanes(given: Any, i: Any, to: Any, j: Any) -> Any:
        for k in range(to.shape[1]):
            for m in range(to.shape[2]):
                to[j, k, m] = given[i, m]

    def of_matrices(given: Any, i: Any, to: Any, j: Any) -> Any:
        for k in range(to.shape[1]):
            for m in range(to.shape[2]):
                to[j, k, m] = given[i, k, m]

    if given.ndim < to.ndim:
        return to_lanes if to.ndim == 2 else rows_to_lanes
    return (of_numbers, of_rows, of_matrices)[to.ndim - 1]


def same_rows(a: Any, b: Any) -> Any:
    """Whether two arrays of one to three axes and of one shape have the same entries."""
    raise TypeError("got a call of same_rows from Python; needed one from a function compiled by numba")


@overload(same_rows, strict=False, jit_options={"_nrt": False})
def _overloaded_same_rows(a: Any, b: Any) -> Any:
    def of_numbers(a: Any, b: Any) -> Any:
        same = True
        for i in range(a.shape[0]):
            same &= a[i] == b[i]
        return same

    def of_rows(a: Any, b: Any) -> Any:
        same = True
        for i in range(a.shape[0]):
            same &= same_rows(a[i], b[i])
        return same

    return of_numbers if a.ndim == 1 else of_rows
