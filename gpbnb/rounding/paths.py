"""Dynamic programming over partial sums and products, to find the computation with the largest error."""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction

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


def sum_table(choices: FloatArray, terms: int) -> tuple[NDArray[np.intp], NDArray[np.float64]]:
    """Tabulate the result and the error of each addition to a partial sum.

    Row 0 is the empty sum. Partial sums that are reached only by the last addition have no row.
    """
    index = {Fraction(0): 0}
    ends, errors, fresh = [], [], choices.format.array([0])
    for _ in range(terms):
        if not len(fresh):
            break
        values = (fresh[:, np.newaxis] + choices).to_fractions()
        exact = np.add.outer(fresh.to_fractions(), choices.to_fractions())
        errors.append((values - exact).astype(np.float64))
        new = list(dict.fromkeys(value for value in values.ravel() if value not in index))
        index |= {value: i for i, value in enumerate(new, start=len(index))}
        ends.append(np.frompyfunc(index.__getitem__, 1, 1)(values).astype(np.intp))
        fresh = choices.format.array(new)
    return np.concatenate(ends), np.concatenate(errors)


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
