"""The names of section 11.1 with the largest errors that the roundings of a triangularization can cause."""

from __future__ import annotations

import random
from fractions import Fraction
from functools import cache
from typing import Any

import numpy as np

from gpbnb.report.ledger.checks.inversion.environments import Elimination, Named, column, random_matrix
from gpbnb.report.ledger.checks.inversion.first_order import EPSILON, FirstOrder
from gpbnb.report.ledger.checks.inversion.judging import COMMON, SYMBOLS
from gpbnb.report.ledger.formula import Relation
from gpbnb.report.ledger.tracked import Matrix, Rounded, largest, rounded, tracked


def alternating(n: int, seed: int, shrink: int = 1) -> Matrix:
    """Return a system (n, n + 1) in which each step changes the sign of every entry that it changes.

    The last row and the last column have the largest entries of every block. Then each rounding error adds to the
    others, in each entry and in the norms. With multipliers that `shrink` divides, the pivot row is larger still.
    """
    rng = random.Random(seed)
    sign, block = 1, np.array([[Fraction(1), Fraction(rng.randint(2, 9))]], dtype=object)
    for _ in range(n - 1):
        rows, columns = block.shape
        factors = [Fraction(rng.randint(3, 5)) for _ in range(rows - 1)] + [Fraction(rng.randint(20, 30))]
        sizes = [Fraction(rng.randint(3, 5)) for _ in range(columns - 2)] + [Fraction(rng.randint(20, 30))] * 2
        pivots = [-sign * shrink * abs(block).max() * size for size in sizes]
        pivot = Fraction(-sign * rng.randint(2, 4))
        below = [
            [factor / shrink * pivot, *(entry + factor / shrink * p for entry, p in zip(row, pivots, strict=True))]
            for factor, row in zip(factors, block, strict=True)
        ]
        block, sign = np.array([[pivot, *pivots], *below], dtype=object), -sign
    return block


@cache
def worst_eliminations(n: int) -> tuple[tuple[dict[str, Any], bool], ...]:
    """Return the symbols of systems of n rows with the largest errors, and whether all errors add up, also in norms."""
    systems = [(alternating(n, 1), True), (alternating(n, 2, shrink=100), n == 2)]
    systems += [(random_matrix(random.Random(300 + seed), n, n + 1), False) for seed in (1, 2, 3)]
    return tuple((_names(system), tight) for system, tight in systems)


def _names(system: Matrix) -> dict[str, Any]:
    n = len(system)
    run = Elimination(system[:, :n], system[:, n:], lambda x: x)
    sizes = [largest(_error_of_a_step(stage.value, k)) for k, stage in enumerate(run.stages[0][:-1])]
    steps = [FirstOrder(size * 0, size) for size in (system * 0, *sizes)]
    total = sum(steps[1:], start=steps[0])

    def named(right: bool) -> Named:
        part = (lambda x: column(x, n + 1)) if right else (lambda x: FirstOrder(x.value[:, :n], x.slope[:, :n]))
        return Named(part(total), lambda k: part(steps[k]))

    errors = {"A_tilde": named(False), "b_tilde_underline": named(True)}
    return {**COMMON, **run.names(), **errors, "epsilon": EPSILON, "beta": EPSILON, "k": Fraction(1)}


def _error_of_a_step(before: Matrix, k: int) -> Matrix:
    """Return the error that step k + 1 adds, from the exact step of the same numbers."""
    old, error, zero = tracked(before), tracked(before * 0), Rounded(Fraction(0))
    for i in range(k + 1, len(before)):
        m = zero - old[i, k] / old[k, k]
        for j in range(k + 1, before.shape[1]):
            new = rounded(old[i, j] + rounded(rounded(m) * old[k, j]))
            error[i, j] = new - (old[i, j] + m * old[k, j])
    return error


def bounds_errors(relation: Relation, sizes: tuple[int, ...]) -> bool:
    """Whether a printed bound allows the largest errors, and no more where all of them add up."""
    for names, tight in (each for n in sizes for each in worst_eliminations(n)):
        first, *others = relation.links(names, Fraction)
        if first.symbol != "<=" or not all(SYMBOLS[each.symbol](each.left, each.right) for each in (first, *others)):
            return False
        if tight and first.left != first.right:
            return False
    return True
