"""Exact matrices of Fractions: conversion, inverse, eigenvalues, norms.

Entries may be Fractions, ints, floats (with their exact binary value) or an array of a format.
"""

from __future__ import annotations

import math
from fractions import Fraction
from typing import Any

import numpy as np
from flint import fmpq, fmpq_mat
from numpy.typing import NDArray

from gpbnb.arithmetic.conversion import entries as all_entries
from gpbnb.arithmetic.conversion import exact_fraction


def exact(values: Any) -> NDArray[Any]:
    """Return entries as exact Fractions, in an object array of the same shape."""
    if hasattr(values, "to_fractions"):
        values = values.to_fractions()
    if np.ma.is_masked(values):
        raise TypeError("got a masked entry; needed a number; fill it first: a.filled(...)")
    entries: NDArray[Any] = np.asarray(values, dtype=object)
    given = entries.ravel().tolist()
    if set(map(type, given)) == {Fraction}:
        return entries.copy()
    fractions = np.empty(entries.size, object)
    for i, entry in enumerate(given):
        if not isinstance(entry, Fraction):
            try:
                entry = exact_fraction(entry)
            except (TypeError, ValueError) as error:
                if isinstance(entry, (list, tuple)) and entries.ndim < 32:  # deeper lists leave NumPy's dimensions
                    all_entries(values)  # which names the shapes of lists of different lengths
                index = np.unravel_index(i, entries.shape)
                where = f"entry {', '.join(map(str, index))}: " if index else ""
                raise type(error)(f"{where}{error}") from None
        fractions[i] = entry
    return fractions.reshape(entries.shape)


def integers(fractions: NDArray[Any]) -> tuple[NDArray[Any], Fraction]:
    """Write exact Fractions as integers times one unit; sums and products of integers are much faster."""
    ratios = [entry.as_integer_ratio() for entry in fractions.flat]
    common = math.lcm(*(q for _, q in ratios))
    counts = [p * (common // q) for p, q in ratios]
    return np.array(counts, dtype=object).reshape(fractions.shape), Fraction(1, common)


def rationals(a: Any) -> Any:
    """Convert a matrix (m, n) of exact numbers, or an array of a format, to a matrix of python-flint's rationals."""
    if hasattr(a, "to_pairs"):  # for an array of a format, this is faster than conversion through Fractions
        base = a.format.base
        pairs = zip(*(part.ravel() for part in a.to_pairs()), strict=True)
        entries = [(m * base**e, 1) if e >= 0 else (m, base**-e) for m, e in pairs]
    else:
        a = exact(a)
        entries = [(x.numerator, x.denominator) for x in a.ravel()]
    rows, columns = a.shape
    return fmpq_mat(rows, columns, [fmpq(p, q) for p, q in entries])


def true_inverse(a: Any) -> Any:
    """Return the exact inverse of a square matrix (n, n), as a matrix of python-flint's rationals."""
    try:
        return rationals(a).inv()
    except ZeroDivisionError:
        raise np.linalg.LinAlgError(
            "got a singular matrix, which has no inverse in any precision; change an entry"
        ) from None


def inverse_of(a: Any) -> NDArray[Any]:
    """Return the exact inverse of a square matrix (n, n), as Fractions."""
    found = true_inverse(a)
    entries = [Fraction(int(entry.p), int(entry.q)) for entry in found.entries()]
    return np.array(entries, dtype=object).reshape(found.nrows(), found.ncols())


def roots(polynomial: Any) -> NDArray[np.complex128]:
    """Return the roots of an exact polynomial of python-flint, (n,), each to the accuracy of float64."""
    found = [complex(root) for root, count in polynomial.complex_roots() for _ in range(count)]
    return np.array(found, dtype=np.complex128)


def eigenvalues(a: Any) -> NDArray[np.complex128]:
    """Return the eigenvalues of a square matrix (n, n) of exact numbers, each to the accuracy of float64.

    They are roots of the exact characteristic polynomial. In float64, rounding errors move those of a long filter by
    as much as their distance from the unit circle, by other amounts on another machine.
    """
    return roots(rationals(a).charpoly())


def max_norm(x: Any) -> Fraction:
    r"""Largest size of an entry of a vector, :math:`\max_j |x_j|`; hung1984, ch. II, (21)."""
    entries = exact(x)
    if entries.ndim != 1:
        raise ValueError(f"got shape {entries.shape}; needed a vector (n,); take a matrix row by row")
    return max(abs(entries), default=Fraction(0))


def column_sum_norm(a: Any) -> Fraction:
    r"""Largest column sum, :math:`\max_j \sum_i |a_{ij}|`, of a matrix; hung1984, ch. II, (22)."""
    if isinstance(a, fmpq_mat):
        sums = (sum((abs(entry) for entry in column), fmpq(0)) for column in a.transpose().tolist())
        largest = max(sums, default=fmpq(0))
        return Fraction(int(largest.p), int(largest.q))
    sizes, unit = _sizes(a)
    return max(sizes.sum(axis=0), default=0) * unit


def row_sum_norm(a: Any) -> Fraction:
    r"""Largest row sum, :math:`\max_i \sum_j |a_{ij}|`, the matrix norm that is compatible with (21)."""
    sizes, unit = _sizes(a)
    return max(sizes.sum(axis=1), default=0) * unit


def _sizes(a: Any) -> tuple[NDArray[Any], Fraction]:
    """Return absolute values as integers times one unit."""
    entries = exact(a)
    if entries.ndim != 2:
        raise ValueError(f"got shape {entries.shape}; needed a matrix (m, n); reshape a vector to (n, 1)")
    counts, unit = integers(entries)
    return np.asarray(abs(counts)), unit
