"""Exact values of the symbols of section 11, from elimination and back substitution with all their roundings.

A function rounds each operation. :func:`to_first_order` multiplies a result by 1 + ε and drops ε², as the documents do.
A format rounds to its digits.
"""

from __future__ import annotations

import random
from collections.abc import Callable
from dataclasses import dataclass
from fractions import Fraction
from functools import cache, cached_property
from typing import Any

import numpy as np
import sympy as sp
from numpy.typing import NDArray

from gpbnb.arithmetic.formats import FloatFormat
from gpbnb.arithmetic.rounding import Rounding
from gpbnb.report.display.derivation import errors, first_order
from gpbnb.report.ledger.checks.inversion.first_order import EPSILON, FirstOrder, joined, matrix, quantity
from gpbnb.report.ledger.checks.inversion.judging import Names

Round = Callable[[FirstOrder], FirstOrder]


class Named(FirstOrder):
    """A matrix named in the documents, whose entries, stages or blocks a function returns."""

    def __init__(self, whole: FirstOrder, look: Callable[..., Any]) -> None:
        super().__init__(whole.value, whole.slope)
        self._look = look

    def __call__(self, *where: Any) -> Any:
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

        def fl(value: FirstOrder) -> FirstOrder:
            for k in range(1, self.n):
                for true, new in zip(exact[k].tolist(), computed[k].tolist(), strict=True):
                    for t, c in zip(true, new, strict=True):
                        if t.value and t == value:
                            return c
            raise LookupError(
                "got a value that no quantity of the elimination has; needed the exact value of one of them"
            )

        return {
            "n": Fraction(self.n),
            "epsilon": EPSILON,
            "beta": EPSILON,
            "m": known(multipliers),
            "a": a_exact,
            "a_hat": a_computed,
            "b": b_exact,
            "b_hat": b_computed,
            "a_tilde": lambda i, j, k: self.errors(False)[int(k)].tolist()[int(i) - 1][int(j) - 1],
            "A": staged(exact, False),
            "A_hat": staged(computed, False),
            "A_tilde": staged(computed, False, errors=True),
            "b_underline": staged(exact, True),
            "b_hat_underline": staged(computed, True),
            "b_tilde_underline": staged(computed, True, errors=True),
            "A_hat_T": Named(upper, lambda i, j: upper.tolist()[i - 1][j - 1]),
            "b_hat_T_underline": Named(
                column(self.part(computed[-1], True)), lambda k: computed[-1].tolist()[k - 1][self.n]
            ),
            "fl": fl,
        }


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


@cache
def eliminations(n: int) -> tuple[Names, ...]:
    """Return symbols of random systems of n rows, to first order; i and j, or k, are the indices of some entry."""
    found = []
    for seed, (i, j, k) in enumerate(((2, 3, n - 1), (3, 2, n))):
        rng = random.Random(100 * n + seed)
        run = Elimination(random_matrix(rng, n, n), random_matrix(rng, n, 1), to_first_order)
        found.append({**run.names(), "i": Fraction(i), "j": Fraction(j), "k": Fraction(k)})
    return tuple(found)


FORMATS = (FloatFormat(10, 4), FloatFormat(10, 7), FloatFormat(2, 11, Rounding.CHOP))


def cancelling(system: NDArray[Any], fmt: FloatFormat) -> NDArray[Any]:
    """Change entries of (A, b) so that 3a(1) and 2a(0) nearly cancel in steps 1 and 2; the product is then a(0)/3."""
    system = system.copy()
    n = len(system)
    for j in (1, n):  # entry (2, 2) and the right side of row 2, in step 1
        system[1, j] = fmt.round(3 * system[1, 0] / system[0, 0] * system[0, j])
    first = system[1:, 1:] - np.outer(system[1:, 0] / system[0, 0], system[0, 1:])
    for j in (2, n):  # entry (3, 3) and the right side of row 3, in step 2
        product = first[1, 0] / first[0, 0] * first[0, j - 1]
        system[2, j] = fmt.round(3 * product + system[2, 0] / system[0, 0] * system[0, j])
    return system


@cache
def runs(n: int) -> tuple[tuple[Elimination, Names, Fraction], ...]:
    """Return eliminations in the digits of a format, with their symbols, where β replaces ε, and with β."""
    found = []
    for fmt in FORMATS:
        for seed in range(8):
            rng = random.Random(1000 * n + seed)
            system = random_matrix(rng, n, n + 1, fractions=False)
            if seed % 2:
                system = cancelling(system, fmt)
            run = Elimination(system[:, :n], system[:, n:], rounded_to(fmt))
            beta = fmt.unit_roundoff
            found.append((run, {**run.names(), "epsilon": beta, "beta": beta, "k": Fraction(1)}, beta))
    return tuple(found)


# -- back substitution and the inverse --------------------------------------------------------------


@cache
def roundings(n: int) -> tuple[tuple[tuple[int, ...], ...], tuple[int, ...]]:
    """Count how often each a_kj and each b_k is rounded, with a separate error for each operation."""
    rows, rights = [], []
    for k in range(1, n + 1):
        right, products = back_row_weights(n - k)
        rows.append((0,) * k + tuple(products))
        rights.append(right)
    return tuple(rows), tuple(rights)


def back_row_weights(terms: int) -> tuple[int, tuple[int, ...]]:
    r"""Count the roundings of the right side and of each product in a row with `terms` entries right of the diagonal.

    The computed a_kk x̂_k is b less the products, each with its own error, as is each subtraction and the division.
    """
    eps, b = errors(2 * terms + 1), sp.Symbol("b")
    products = sp.symbols(f"p_1:{terms + 1}")
    value: sp.Expr = b
    for product, of_product, of_sum in zip(products, eps[::2], eps[1::2], strict=False):
        value = (value - product * (1 + of_product)) * (1 + of_sum)
    error = first_order(value * (1 + eps[-1]), eps)
    right, *others = (sum(error.coeff(term).coeff(e) != 0 for e in eps) for term in (b, *products))
    return right, tuple(others)


def weights(n: int) -> tuple[FirstOrder, FirstOrder]:
    """Return the counts of :func:`roundings` as a matrix (n, n) and a diagonal matrix (n, n)."""
    rows, rights = roundings(n)
    return (
        FirstOrder(np.array([[Fraction(x) for x in row] for row in rows], dtype=object)),
        diagonal([Fraction(x) for x in rights]),
    )


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


@cache
def substitutions(n: int) -> tuple[Names, ...]:
    """Return symbols of section 11.2 for random triangular systems of n rows; k and j are the indices of some entry."""
    found = []
    for seed, (k, j, sign) in enumerate(((1, n, 1), (2, 3, -1), (1, 3, Fraction(1, 2)))):
        rng = random.Random(7000 + 10 * n + seed)
        upper = np.triu(random_matrix(rng, n, n)) + Fraction(0)
        right = random_matrix(rng, n, 1)
        e = EPSILON * sign
        run = Elimination(upper, right, lambda x, e=e: x * (1 + e))  # type: ignore[misc]
        of_matrix, of_right = weights(n)
        a, b, x_hat = FirstOrder(upper), FirstOrder(right), matrix(run.solution)
        x = a.inv() * b
        change = FirstOrder(upper * of_matrix.value) * e
        right_change = of_right * b * e
        found.append(
            {
                "n": Fraction(n),
                "k": Fraction(k),
                "j": Fraction(j),
                "epsilon": e,
                "beta": EPSILON,
                "A": square(a),
                "a": square(a),
                "b": vector(b),
                "x": vector(x),
                "x_hat": vector(x_hat),
                "A_hat": a + change,
                "a_hat": square(a + change),
                "b_hat": vector(b + right_change),
                "DeltaA": square(change),
                "Deltaa": square(change),
                "Deltab": vector(right_change),
                "Deltax": x_hat - x,
                "A_D": FirstOrder(np.triu(upper, 1) + Fraction(0)),
                "diag": lambda *numbers: diagonal([quantity(each).value for each in numbers]),
                "M_A": on_diagonal(diagonal([Fraction(x) for x in roundings(n)[0][0]])),
                "M_b": on_diagonal(of_right),
            }
        )
    return tuple(found)


@cache
def inverses(n: int = 3) -> tuple[Names, ...]:
    """Return symbols of section 11.3 for the inverse of a random matrix by elimination and back substitution."""
    found = []
    for seed, j in enumerate((1, 2, n)):
        rng = random.Random(9000 + seed)
        given = random_matrix(rng, n, n)
        unit = np.array([[Fraction(i == j) for j in range(n)] for i in range(n)], dtype=object)
        run = Elimination(given, unit, to_first_order)
        of_matrix, of_right = weights(n)
        _exact, computed, _ = run.stages
        upper, rights = (run.part(computed[-1], right) for right in (False, True))
        tilde, b_tilde = (sum(run.errors(right)[1:], start=run.errors(right)[0]) for right in (False, True))
        delta = FirstOrder(upper.value * of_matrix.value) * EPSILON
        b_delta = of_right * rights * EPSILON
        a, x_hat = FirstOrder(given), matrix(run.solution)
        delta_a = tilde + run.lower * delta
        delta_b = b_tilde + run.lower * b_delta
        solved = a + delta_a
        error = x_hat - a.inv()
        e = joined([column(delta_b, c) - delta_a * column(x_hat, c) for c in range(1, n + 1)])
        found.append(
            {
                "n": Fraction(n),
                "j": Fraction(j),
                "A": a,
                "A_hat": solved,
                "A_tilde": tilde,
                "DeltaA": delta,
                "deltaA": delta_a,
                "L": run.lower,
                "b": column(FirstOrder(unit), j),
                "b_hat": column(FirstOrder(unit) + delta_b, j),
                "b_tilde": column(b_tilde, j),
                "Deltab": column(b_delta, j),
                "deltab": Named(column(delta_b, j), lambda c, d=delta_b: column(d, c)),
                "u": lambda c, u=unit: column(FirstOrder(u), int(c)),
                "x": column(a.inv(), j),
                "x_hat": lambda c, x=x_hat: column(x, int(c)),
                "deltax": lambda c, d=error: column(d, int(c)),
                "delta": lambda x, a=a, d=error: d if x == a.inv() else None,
                "column": lambda x, c: column(x, int(c)),
                "matrix": joined,
                "E": e,
                "D": e,
            }
        )
    return tuple(found)


@cache
def factored_errors() -> tuple[Names, ...]:
    """Return symbols of (96) and (97) for first-order errors that are a computed inverse times a matrix E or D."""
    found = []
    for seed in range(3):
        rng = random.Random(9600 + seed)
        solved = 3 * np.eye(3, dtype=int) + 0 * random_matrix(rng, 3, 3) if seed == 0 else random_matrix(rng, 3, 3)
        a_hat, e = FirstOrder(solved), FirstOrder(random_matrix(rng, 3, 3)) * EPSILON
        error = a_hat.inv() * e
        found.append(
            {
                "A": a_hat,
                "A_hat": a_hat,
                "E": e,
                "D": e,
                "delta": lambda x, d=error: d,
                "epsilon": error.norm() / a_hat.inv().norm(),
            }
        )
    return tuple(found)


@cache
def residues(changed: bool, sharp: bool = False) -> tuple[Names, ...]:
    """Return symbols of section 10: computed inverses of A or of A + ΔA, and their residues.

    Parameters
    ----------
    changed : whether there is a ΔA. If so, residue and ΔA are of first order; otherwise the residue has any size.
    sharp : whether to add a multiple of the identity, for which the documents' norms are attained.
    """
    found = []
    for seed in range(3):
        rng = random.Random(3300 + seed)
        n = 3
        given = random_matrix(rng, n, n)
        size = FirstOrder(random_matrix(rng, n, n)) * Fraction(1, 5)
        change = FirstOrder(random_matrix(rng, n, n)) * EPSILON if changed else FirstOrder(given * 0)
        if sharp and seed == 0:
            given = 3 * np.array([[Fraction(i == j) for j in range(n)] for i in range(n)], dtype=object)
            size, change = abs(size), FirstOrder(change.value, -abs(change.slope))
            size = FirstOrder(-change.slope * Fraction(2, 5)) if changed else size  # the same column is the largest
        residue = size * EPSILON if changed else size
        unit = FirstOrder(np.array([[Fraction(i == j) for j in range(n)] for i in range(n)], dtype=object))
        a = FirstOrder(given)
        inverse, computed = a.inv(), (a + change).inv() * (unit + residue)
        error = computed - inverse
        found.append(
            {
                "A": a,
                "DeltaA": change,
                "I": unit,
                "R": residue,
                "E": error,
                "epsilon": error.norm() / inverse.norm(),
                "j": Fraction(seed + 1),
                "u": lambda c, m=unit: column(m, int(c)),
                "h": lambda c, m=inverse: column(m, int(c)),
                "h_hat": lambda c, m=computed: column(m, int(c)),
                "h_tilde": lambda c, m=error: column(m, int(c)),
                "r": lambda c, m=residue: column(m, int(c)),
                "x": column(inverse, seed + 1),
                "fl": lambda x, i=inverse, c=computed: c if x == i else None,
            }
        )
    return tuple(found)
