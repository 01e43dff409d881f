"""Triangularization and back substitution with all their roundings, and named matrices."""

from __future__ import annotations

import itertools
import random
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from fractions import Fraction
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gpbnb.arithmetic.formats import FloatFormat
from gpbnb.report.ledger.first_order import EPSILON, FirstOrder, looked_up, matrix

Round = Callable[[FirstOrder], FirstOrder]
COMMON: Mapping[str, Any] = {"matrix": matrix, "norm": lambda x: x.norm()}
"""Functions that every statement may use."""


class Named(FirstOrder):
    """A matrix named in the documents, whose entries, stages or blocks a function returns."""

    def __init__(self, whole: FirstOrder, look: Callable[..., Any]) -> None:
        super().__init__(whole.value, whole.slope)
        self._look = look

    def __call__(self, *where: Any) -> Any:
        """Return an entry, a stage or a block."""
        return self._look(*map(int, where))


def to_first_order(x: FirstOrder) -> FirstOrder:
    """Round with the one ε of the documents."""
    return x * (1 + EPSILON)


def rounded_to(fmt: FloatFormat) -> Round:
    """Round to the digits of a format."""
    return lambda x: FirstOrder(fmt.round(x.value))


def known(values: dict[tuple[int, ...], Any]) -> Callable[..., Any]:
    """Return a function that looks up a value by its indices, or raises KeyError."""
    return lambda *where: values[tuple(map(int, where))]


@dataclass(frozen=True)
class Elimination:
    """Triangularization of a matrix and of right-hand sides, and back substitution, with rounded results.

    Parameters
    ----------
    given : (n, n) and (n, p), Fractions: the matrix and the right-hand sides.
    rounded : function that rounds each operation.
    """

    a: NDArray[Any]
    b: NDArray[Any]
    rounded: Round

    @property
    def n(self) -> int:
        """Number of rows."""
        return len(self.a)

    @cached_property
    def stages(self) -> tuple[list[FirstOrder], list[FirstOrder], dict[tuple[int, ...], FirstOrder]]:
        """(A, b) after each step: the exact step from computed numbers, the computed step, and the multipliers."""
        n, width, fl = self.n, self.n + self.b.shape[1], self.rounded
        first = FirstOrder(np.hstack([self.a, self.b]))
        exact, computed = [first], [first]
        multipliers: dict[tuple[int, ...], FirstOrder] = {}
        old = [[FirstOrder(x) for x in row] for row in first.value]
        for k in range(n - 1):
            true, new = [list(row) for row in old], [list(row) for row in old]
            for i in range(k + 1, n):
                m = -(old[i][k] / old[k][k])
                multipliers[i + 1, k + 1] = m
                true[i][k] = new[i][k] = FirstOrder(Fraction(0))
                for j in range(k + 1, width):
                    true[i][j] = old[i][j] + m * old[k][j]
                    new[i][j] = fl(old[i][j] + fl(fl(m) * old[k][j]))
            exact.append(matrix(true))
            computed.append(matrix(new))
            old = new
        return exact, computed, multipliers

    @cached_property
    def lower(self) -> FirstOrder:
        """L, made of the exact quotients of computed numbers."""
        low = [[FirstOrder(Fraction(i == j)) for j in range(self.n)] for i in range(self.n)]
        for (i, k), m in self.stages[2].items():
            low[i - 1][k - 1] = -m
        return matrix(low)

    def part(self, stage: FirstOrder, right: bool) -> FirstOrder:
        """Return the matrix or the right-hand sides of a stage."""
        columns = slice(self.n, None) if right else slice(0, self.n)
        return FirstOrder(stage.value[:, columns], stage.slope[:, columns])

    @cached_property
    def solution(self) -> list[list[FirstOrder]]:
        """The rows of x̂, with a column for each right-hand side."""
        n, fl = self.n, self.rounded
        last = self.stages[1][-1].tolist()
        found: list[list[FirstOrder]] = [[] for _ in range(n)]
        for k in reversed(range(n)):
            for column in range(self.b.shape[1]):
                value = last[k][n + column]
                for j in range(k + 1, n):
                    value = fl(value - fl(last[k][j] * found[j][column]))
                found[k].append(fl(value / last[k][k]))
        return found

    def errors(self, right: bool) -> list[FirstOrder]:
        """Return Ã(k) or b̃(k), the error of step k compared with the exact step from computed numbers."""
        exact, computed, _ = self.stages
        return [
            self.part(computed[k], right) - self.part(exact[k], right) if k else self.part(exact[0], right) * 0
            for k in range(self.n)
        ]

    def sizes(self, right: bool) -> NDArray[Any]:
        """Return the sum over k of 3|Â_k(k)| + 2|Â_k(k-1)|, without β."""
        total = 0 * abs(self.part(self.stages[1][0], right).value)
        for k in range(1, self.n):
            new, old = (abs(block(self.part(self.stages[1][i], right), k).value) for i in (k, k - 1))
            total = total + 3 * new + 2 * old
        return np.asarray(total)

    def names(self) -> dict[str, Any]:
        """Return the symbols of section 11.1, with the first right-hand side."""
        exact, computed, multipliers = self.stages

        def staged(stages: list[FirstOrder], right: bool, errors: bool = False) -> Named:
            def look(*where: int) -> FirstOrder:
                *blocks, k = where
                return block(column(parts[k]) if right else parts[k], *blocks)

            parts = self.errors(right) if errors else [self.part(stage, right) for stage in stages]
            whole = sum(parts[1:], start=parts[0]) if errors else parts[0]
            return Named(column(whole) if right else whole, look)

        def entry(stages: list[FirstOrder], right: bool) -> Callable[..., FirstOrder]:
            def look(*where: Any) -> FirstOrder:
                i, *rest = map(int, where)
                j, k = (self.n + 1, *rest) if right and rest else (self.n + 1, 0) if right else (*rest, 0)[:2]
                if not 1 <= i <= self.n or not (right or 1 <= j <= self.n) or not 0 <= k < min(i, j):
                    raise KeyError(
                        f"got the entry {where}; needed the last step that changed the entry, by which "
                        "the documents name it"
                    )
                return FirstOrder(stages[k].value[i - 1, j - 1], stages[k].slope[i - 1, j - 1])

            return look

        a_exact, a_computed, b_exact, b_computed = (
            entry(stages, right) for right in (False, True) for stages in (exact, computed)
        )
        upper = self.part(computed[-1], False)

        cells = ((true.tolist(), new.tolist()) for true, new in zip(exact[1:], computed[1:], strict=True))
        rows = itertools.chain.from_iterable(zip(*each, strict=True) for each in cells)
        results = [(t, c) for row in rows for t, c in zip(*row, strict=True) if t.value]
        return {
            **COMMON, "n": Fraction(self.n), "epsilon": EPSILON, "beta": EPSILON, "m": known(multipliers),
            "fl": looked_up(results), "a": a_exact, "a_hat": a_computed, "b": b_exact, "b_hat": b_computed,
            "a_tilde": lambda i, j, k: self.errors(False)[int(k)].tolist()[int(i) - 1][int(j) - 1],
            "A": staged(exact, False), "A_hat": staged(computed, False), "b_underline": staged(exact, True),
            "A_tilde": staged(computed, False, errors=True), "b_hat_underline": staged(computed, True),
            "b_tilde_underline": staged(computed, True, errors=True), "A_hat_T": square(upper),
            "b_hat_T_underline": vector(column(self.part(computed[-1], True))),
        }  # fmt: skip


def column(x: FirstOrder, j: int = 1) -> FirstOrder:
    """Return the jth column; LookupError if there is none."""
    if not 1 <= j <= x.value.shape[1]:
        raise LookupError(f"got column {j}; needed a number from 1 to {x.value.shape[1]}")
    return FirstOrder(x.value[:, j - 1 : j], x.slope[:, j - 1 : j])


def block(x: FirstOrder, k: int = 0) -> FirstOrder:
    """Set the first k rows and, for a square matrix, the first k columns to zero, as in (58)."""
    kept = np.array([[Fraction(i >= k and (x.value.shape[1] == 1 or j >= k)) for j in range(x.value.shape[1])]
                     for i in range(len(x.value))], dtype=object)  # fmt: skip
    return FirstOrder(x.value * kept, x.slope * kept)


def random_matrix(rng: random.Random, rows: int, columns: int, fractions: bool = True) -> NDArray[Any]:
    """Draw Fractions of sizes up to 9, or whole numbers of up to three digits, never zero or one."""

    def entry() -> Fraction:
        if fractions:
            return Fraction(rng.choice((-1, 1)) * rng.randint(11, 99), rng.choice((7, 11, 13)))
        return Fraction(rng.choice((-1, 1)) * rng.randint(2, 999))

    return np.array([[entry() for _ in range(columns)] for _ in range(rows)], dtype=object)


def diagonal(numbers: list[Fraction]) -> FirstOrder:
    """Return a diagonal matrix."""
    n = len(numbers)
    return FirstOrder(
        np.array([[numbers[i] if i == j else Fraction(0) for j in range(n)] for i in range(n)], dtype=object)
    )


def on_diagonal(x: FirstOrder) -> Named:
    """Return a diagonal matrix whose entries have one index."""
    return Named(x, known({(k + 1,): row[k] for k, row in enumerate(x.tolist())}))


def vector(x: FirstOrder) -> Named:
    """Return a column with its entries."""
    return Named(x, known({(i + 1,): row[0] for i, row in enumerate(x.tolist())}))


def square(x: FirstOrder) -> Named:
    """Return a matrix with its entries."""
    return Named(x, known({(i + 1, j + 1): c for i, row in enumerate(x.tolist()) for j, c in enumerate(row)}))
