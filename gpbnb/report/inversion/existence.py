"""Search for matrices of a given wordlength that have the error printed in Table 1 of section 11.4.

Source: hung1984, ch. II, section 11.4; hung1982, ch. III, section 11.4.
"""

from __future__ import annotations

import math
from bisect import bisect_left
from collections.abc import Sequence
from fractions import Fraction
from functools import cache
from itertools import product
from typing import Any

import numpy as np

from gpbnb.arithmetic.rational import inverse_of
from gpbnb.arithmetic.rounding import Rounding
from gpbnb.report.inversion.example import (
    KINDS,
    MATRIX,
    PLACES,
    PRINTED,
    Matrix,
    Wordlength,
    interval,
    matrix,
)
from gpbnb.report.inversion.procedure import NORMS

#: Norms that are sums of sizes or squares over groups of entries, or the largest such sum.
SEARCHED = ("column sum", "row sum", "largest entry", "Frobenius")


def possible(
    wordlength: Wordlength,
    places: int,
    norm: str,
    relative: bool = False,
    printed: str | None = None,
    reference: str = "given",
) -> Matrix | None:
    """Search all matrices X of a wordlength for one whose error has the printed norm; None if there is none.

    It does not matter how X was computed. Only the set of numbers of the wordlength matters, not the rounding.

    Parameters
    ----------
    printed : an error norm as text; by default that of Table 1.
    reference : whose inverse defines the error, the matrix as "given" or as "stored" in the wordlength.
    """
    printed = printed or PRINTED["error"][PLACES.index(places)]
    true = inverse_of(matrix() if reference == "given" else wordlength.rounder(places)(matrix()))
    scale = Fraction(float(NORMS[norm](true))) if relative else Fraction(1)
    low, high = (end * scale for end in interval(printed))
    square = norm == "Frobenius"
    if square:
        low, high = low * low, high * high
    groups = _groups(norm)
    entries: dict[tuple[int, ...], Any] = {index: true[index] for index in np.ndindex(true.shape)}
    candidates = {index: _near(x, wordlength, places, high, square) for index, x in entries.items()}
    least = [sum(min((size for size, _ in candidates[i]), default=high) for i in group) for group in groups]
    for g, group in enumerate(groups):
        others = [least[h] for h in range(len(groups)) if h != g]
        if any(value >= high for value in others):
            continue
        group = sorted(group, key=lambda i: len(candidates[i]))
        if (chosen := _fit([candidates[i] for i in group], low, high)) is not None:
            nearest = {index: near[0][1] for index, near in candidates.items()}
            values = nearest | dict(zip(group, chosen, strict=True))
            return np.array([*values.values()], dtype=object).reshape(true.shape)
    return None


@cache
def all_possible() -> tuple[tuple[int, Matrix | None], ...]:
    """Search every wordlength and every norm; return the places of each search, and what it found.

    Rounding matters only if three digits cannot hold the given matrix.
    """
    given = [(Wordlength(kind, Rounding.NEAREST), "given") for kind in KINDS]
    stored = [(Wordlength(KINDS[0], rounding), "stored") for rounding in Rounding.documented()]
    cases = product((*given, *stored), SEARCHED, (False, True), PLACES)
    return tuple((places, possible(w, places, norm, relative, None, r)) for (w, r), norm, relative, places in cases)


def _groups(norm: str) -> list[list[tuple[int, int]]]:
    """List the groups of entries whose sizes are summed; the norm is the largest of the sums."""
    n = range(len(MATRIX))
    return {
        "column sum": [[(i, j) for i in n] for j in n],
        "row sum": [[(i, j) for j in n] for i in n],
        "largest entry": [[(i, j)] for i in n for j in n],
        "Frobenius": [[(i, j) for i in n for j in n]],
    }[norm]


def _near(
    x: Fraction, wordlength: Wordlength, places: int, most: Fraction, square: bool
) -> list[tuple[Fraction, Fraction]]:
    """List numbers of the wordlength near x, nearest first, whose distance (or its square) is below `most`."""
    reach = Fraction(math.sqrt(most) * 1.001) if square else most
    unit = Fraction(1, 10**places)
    if wordlength.kind != "fixed point":  # the spacing of the smallest numbers within reach
        fmt = wordlength.format(places)
        unit = Fraction(10) ** (fmt.split(abs(x) - reach)[2] - fmt.precision)
    multiples = np.arange(math.floor((x - reach) / unit), math.ceil((x + reach) / unit) + 1).astype(object) * unit
    near = multiples[wordlength.rounder(places)(multiples) == multiples]
    return sorted((size, y) for size, y in zip(abs(near - x) ** (2 if square else 1), near, strict=True) if size < most)


def _fit(
    candidates: Sequence[Sequence[tuple[Fraction, Fraction]]], low: Fraction, high: Fraction
) -> list[Fraction] | None:
    """Choose one candidate of each list so that the sizes sum to at least `low` and less than `high`, or None."""
    first, *rest = candidates
    if not rest:
        i = bisect_left(first, low, key=lambda candidate: candidate[0])
        return [first[i][1]] if i < len(first) and first[i][0] < high else None
    for size, value in first:
        if size >= high:
            break
        if (others := _fit(rest, low - size, high - size)) is not None:
            return [value, *others]
    return None
