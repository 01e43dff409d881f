"""Dynamic programming over partial sums and products, to find the computation with the largest error."""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from gpbnb.arithmetic.array import FloatArray
from gpbnb.arithmetic.formats import FloatFormat


def exact_terms(fmt: FloatFormat, exponents: Sequence[int], products: bool) -> dict[Fraction, tuple[Fraction, int]]:
    """List the exact terms of a sum; each comes with two numbers of the format whose product it is."""
    significands = range(fmt.base ** (fmt.precision - 1), fmt.base**fmt.precision)
    terms: dict[Fraction, tuple[Fraction, int]] = {Fraction(0): (Fraction(0), 0)}
    for e in exponents:
        for m in significands:
            for k in significands if products else [1]:
                for sign in (1, -1):
                    x = sign * m * Fraction(fmt.base) ** e
                    terms.setdefault(x * k, (x, k))
    return terms


class PartialSums:
    """All partial sums of some terms, and the error of each addition."""

    def __init__(self, choices: FloatArray) -> None:
        self._choices = choices
        self._index = {Fraction(0): 0}
        self._ends: list[NDArray[np.intp]] = []
        self._errors: list[NDArray[np.float64]] = []
        self._fresh = choices.format.array([0])

    def table(self, terms: int) -> tuple[NDArray[np.intp], NDArray[np.float64]]:
        """Tabulate the result and the error of each addition to a partial sum, in sums of up to `terms` terms.

        Row 0 is the empty sum. Partial sums that are reached only by the last addition have no row.
        """
        while len(self._ends) < terms and len(self._fresh):
            self._add()
        return np.concatenate(self._ends[:terms]), np.concatenate(self._errors[:terms])

    def _add(self) -> None:
        """Add each term to each of the partial sums that are new."""
        choices, fresh, index = self._choices, self._fresh, self._index
        values = (fresh[:, np.newaxis] + choices).to_fractions()
        exact = np.add.outer(fresh.to_fractions(), choices.to_fractions())
        self._errors.append((values - exact).astype(np.float64))
        new = list(dict.fromkeys(value for value in values.ravel() if value not in index))
        index |= {value: i for i, value in enumerate(new, start=len(index))}
        self._ends.append(np.frompyfunc(index.__getitem__, 1, 1)(values).astype(np.intp))
        self._fresh = choices.format.array(new)


@lru_cache(maxsize=4)  # a curve of worst cases asks for every number of terms
def partial_sums(
    fmt: FloatFormat, exponents: tuple[int, ...], products: bool
) -> tuple[dict[Fraction, tuple[Fraction, int]], PartialSums]:
    """Return the terms of :func:`exact_terms`, and the partial sums of these, rounded."""
    terms = exact_terms(fmt, exponents, products)
    return terms, PartialSums(fmt.array(np.array(list(terms), dtype=object)))


@lru_cache(maxsize=4)
def product_table(fmt: FloatFormat) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
    """Tabulate the significand of the product of any two significands, and the logarithm of 1 + its relative error."""
    base, t = fmt.base, fmt.precision
    start = np.arange(base ** (t - 1), base**t)
    products = np.frompyfunc(lambda i, j: fmt.kernel.multiply(int(i), 0, int(j), 0), 2, 2)
    significand, exponent = (a.astype(np.int64) for a in products.outer(start, start))
    return significand, np.log(significand * float(base) ** exponent / np.multiply.outer(start, start))


def best_path(rewards: Sequence[NDArray[np.float64]], end: NDArray[np.intp]) -> list[int]:
    """Find the choices with the largest sum of rewards, starting from state 0.

    From state i, choice j earns ``reward[i, j]`` and leads to state ``end[i, j]``.
    """
    states, choices = end.shape
    target = end.ravel()
    value = np.full(max(states, end.max() + 1), -np.inf)
    value[0] = 0.0
    came_from = []
    for reward in rewards:
        candidates = (value[:states, np.newaxis] + reward).ravel()
        value = np.full(len(value), -np.inf)
        np.maximum.at(value, target, candidates)
        winners = np.flatnonzero(candidates == value[target])[::-1]  # the first of equal rewards
        origin = np.zeros(len(value), dtype=np.intp)
        origin[target[winners]] = winners
        came_from.append(origin)
    state = int(np.argmax(value))
    path: list[int] = []
    for origin in reversed(came_from):
        state, choice = divmod(int(origin[state]), choices)
        path.append(choice)
    return path[::-1]
