"""Sections 10 and 11 of the chapters on rounding: true values of their names, and computed inverses.

Symbols have their values from elimination and back substitution with all their roundings. :func:`to_first_order`
multiplies a result by 1 + ε and drops ε², as the documents do; a format rounds to its digits.
"""

from __future__ import annotations

import itertools
import random
import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from fractions import Fraction
from functools import cache, cached_property, partial
from typing import Any

import numpy as np
import sympy as sp
from numpy.typing import NDArray

from gpbnb.arithmetic import linalg
from gpbnb.arithmetic.array import FloatArray
from gpbnb.arithmetic.formats import FloatFormat
from gpbnb.arithmetic.rational import column_sum_norm, exact, inverse_of
from gpbnb.arithmetic.rounding import Rounding
from gpbnb.report.display.derivation import errors, first_order
from gpbnb.report.inversion import example, experiment, procedure, theory
from gpbnb.report.inversion.theory import Reduction
from gpbnb.report.ledger.checks import inversion_table
from gpbnb.report.ledger.corrections import intended
from gpbnb.report.ledger.elimination import (
    COMMON,
    Elimination,
    Named,
    column,
    diagonal,
    on_diagonal,
    random_matrix,
    rounded_to,
    square,
    to_first_order,
    vector,
)
from gpbnb.report.ledger.first_order import EPSILON, FirstOrder, joined, matrix, quantity
from gpbnb.report.ledger.judge import read
from gpbnb.report.ledger.statements import Statement, load_statements, statement
from gpbnb.report.ledger.tracked import largest, rounded, tracked

Names = Mapping[str, Any]
Matrix = NDArray[Any]
FOUR = FloatFormat(10, 4)
FORMATS = (FOUR, FloatFormat(10, 7), FloatFormat(2, 11, Rounding.CHOP))


# -- elimination with its roundings ---------------------------------------------------------------


@cache
def eliminations(n: int, sign: int = 1) -> tuple[Names, ...]:
    """Return symbols of random systems of n rows, to first order; i and j, or k, are the indices of some entry.

    With the sign -1, each ε is -β.
    """
    found = []
    for seed, (i, j, k) in enumerate(((2, 3, n - 1), (3, 2, n))):
        rng = random.Random(100 * n + seed)
        run = Elimination(random_matrix(rng, n, n), random_matrix(rng, n, 1), lambda x: x * (1 + EPSILON * sign))
        indices = {"i": Fraction(i), "j": Fraction(j), "k": Fraction(k)}
        found.append({**run.names(), **indices, "epsilon": EPSILON * sign})
    return tuple(found)


def entries_in_turn(n: int, first: int = 1, last: int = 0) -> list[dict[str, Any]]:
    """Return the systems of n rows with each index k from the first to the last."""
    return [{**names, "k": Fraction(k)} for names in eliminations(n) for k in range(first, (last or n) + 1)]


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


def _last_largest(rng: random.Random, others: int) -> list[Fraction]:
    return [*(Fraction(rng.randint(3, 5)) for _ in range(others)), Fraction(rng.randint(20, 30))]


def alternating(n: int, seed: int, shrink: int = 1) -> Matrix:
    """Return a system (n, n + 1) whose rounding errors all add up: each step changes every sign that it can."""
    rng = random.Random(seed)
    sign, block = 1, np.array([[Fraction(1), Fraction(rng.randint(2, 9))]], dtype=object)
    for _ in range(n - 1):
        rows, columns = block.shape
        factors, sizes = _last_largest(rng, rows - 1), _last_largest(rng, columns - 2)
        pivots = [-sign * shrink * abs(block).max() * size for size in (*sizes, sizes[-1])]
        pivot = Fraction(-sign * rng.randint(2, 4))
        below = [
            [factor / shrink * pivot, *(entry + factor / shrink * p for entry, p in zip(row, pivots, strict=True))]
            for factor, row in zip(factors, block, strict=True)
        ]
        block, sign = np.array([[pivot, *pivots], *below], dtype=object), -sign
    return block


@cache
def worst_eliminations(n: int) -> tuple[dict[str, Any], ...]:
    """Return the symbols of systems of n rows with the largest errors; in tight ones all add up, also in norms."""
    systems = [(alternating(n, 1), True), (alternating(n, 2, shrink=100), n == 2)]
    systems += [(random_matrix(random.Random(300 + seed), n, n + 1), False) for seed in (1, 2, 3)]
    return tuple({**_worst_names(system), "tight": tight} for system, tight in systems)


def _worst_names(system: Matrix) -> dict[str, Any]:
    n = len(system)
    run = Elimination(system[:, :n], system[:, n:], lambda x: x)
    sizes = [largest(_error_of_a_step(stage.value, k)) for k, stage in enumerate(run.stages[0][:-1])]
    steps = [FirstOrder(size * 0, size) for size in (system * 0, *sizes)]
    total = sum(steps[1:], start=steps[0])

    def named(right: bool) -> Named:
        part = (lambda x: column(x, n + 1)) if right else (lambda x: FirstOrder(x.value[:, :n], x.slope[:, :n]))
        return Named(part(total), lambda k: part(steps[k]))

    return {**run.names(), "A_tilde": named(False), "b_tilde_underline": named(True), "k": Fraction(1)}


def _error_of_a_step(before: Matrix, k: int) -> Matrix:
    """Return the error that step k + 1 adds, from the exact step of the same numbers."""
    old, error, zero = tracked(before), tracked(before * 0), tracked([0])[0]
    for i in range(k + 1, len(before)):
        m = zero - old[i, k] / old[k, k]
        for j in range(k + 1, before.shape[1]):
            new = rounded(old[i, j] + rounded(rounded(m) * old[k, j]))
            error[i, j] = new - (old[i, j] + m * old[k, j])
    return error


def one_sign(part: int, *sizes: int) -> list[Names]:
    """Return systems whose ε are all β or all -β, and those with the largest errors, which one part must allow."""
    largest_errors = [{**names, "part": part} for n in sizes for names in worst_eliminations(n)]
    return [*eliminations(3), *eliminations(3, -1), *largest_errors]


def norms_of_errors() -> list[Names]:
    """Return systems with the largest errors, and eliminations in the digits of a format."""
    return [
        *(names for n in (2, 3, 4) for names in worst_eliminations(n)),
        *(names for n in (3, 4) for _, names, _ in runs(n)),
    ]


def blocks_of_steps() -> list[Names]:
    """Return the number of rows and columns that a step changes, for each pair of indices."""

    def changed(j: int, k: int) -> FirstOrder:
        error = names["A_tilde"](j).slope != 0
        return matrix([[Fraction(int(error.any(axis=axis).sum())) for axis in (1, 0)]])

    (names, *_) = eliminations(4)
    return [
        {"n": Fraction(4), "j": Fraction(j), "i": Fraction(i), "k": Fraction(j), "A": changed,
         "block": lambda *shape: matrix([list(shape)])}
        for j in (1, 2) for i in (1, 2)
    ]  # fmt: skip


def rows_within(printed: Statement) -> int:
    """Count the runs in which the right side of a relation, with β for ε, does not allow the errors that occur."""
    within = len(runs(3))
    for part in (each for each in printed.parts if "beta" in each.text):
        links = [part.links(names, Fraction) for _, names, _ in runs(3)]  # type: ignore[union-attr]
        within = min(within, sum(abs(link[0].left) <= abs(link[-1].right) for link in links))
    return len(runs(3)) - within


@cache
def sizes_hold() -> int:
    return sum(
        bool((abs(sum(e.value for e in run.errors(right))) <= beta * run.sizes(right)).all())
        for run, _, beta in runs(3)
        for right in (False, True)
    )


@cache
def compounded() -> Names:
    """Count runs with L Â_T = A + Ã(1) + Ã(2) exactly, and runs in which the errors of step 1 change step 2."""
    adds = changes = 0
    for run, _, _ in runs(3):
        upper, given = run.part(run.stages[1][-1], False), run.part(run.stages[0][0], False)
        first, second = run.errors(False)[1:]
        adds += run.lower * upper == given + first + second
        third, leading = (sp.Matrix(given.value[:size, :size]).det() for size in (3, 2))
        changes += run.stages[0][2].value[2, 2] != Fraction(third) / Fraction(leading)
    changed = "will be compounded to" if changes > len(runs(3)) / 2 else "will not affect"
    return {"verb": {changed} if adds == len(runs(3)) else set(), "adds": adds, "changes": changes}


@cache
def available() -> Names:
    """Count entries of Â and of A after the first step that are numbers of the format."""
    computed = exactly = count = 0
    formats = [fmt for fmt in FORMATS for _ in range(len(runs(3)) // len(FORMATS))]
    for (run, _, _), fmt in zip(runs(3), formats, strict=True):
        for true, new in zip(run.stages[0][1].value[1:, 1:].flat, run.stages[1][1].value[1:, 1:].flat, strict=True):
            computed += fmt.round(new) == new
            exactly += fmt.round(true) == true
            count += 1
    return {"hat": "is available" if computed == count > 2 * exactly else "is not available", "computed": computed,
            "exactly": exactly, "count": count}  # fmt: skip


def cleared() -> Names:
    """After which step from the last the entries below the diagonal are zero."""
    first = {
        n - [not np.tril(stage.value[:, :n] != 0, -1).any() for stage in run.stages[1]].index(True)
        for n in (3, 4)
        for run, _, _ in runs(n)
    }
    return {"step": "(n-1)" if first == {1} else "n", "form": "upper triangular"}


# -- back substitution ----------------------------------------------------------------------------


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


@cache
def substitutions(n: int) -> tuple[Names, ...]:
    """Return symbols of section 11.2 for random triangular systems of n rows; k and j are the indices of some entry."""
    return tuple(_substitution_names(n, *each) for each in enumerate(((1, n, 1), (2, 3, -1), (1, 3, Fraction(1, 2)))))


def _substitution_names(n: int, seed: int, indices: tuple[int, int, Any]) -> Names:
    k, j, sign = indices
    rng, e = random.Random(7000 + 10 * n + seed), EPSILON * sign
    upper = np.triu(random_matrix(rng, n, n)) + Fraction(0)
    right = random_matrix(rng, n, 1)
    run = Elimination(upper, right, lambda x: x * (1 + e))
    of_matrix, of_right = weights(n)
    a, b, x_hat = FirstOrder(upper), FirstOrder(right), matrix(run.solution)
    x, change, right_change = a.inv() * b, FirstOrder(upper * of_matrix.value) * e, of_right * b * e
    return {
        **COMMON, "n": Fraction(n), "k": Fraction(k), "j": Fraction(j), "epsilon": e, "beta": EPSILON,
        "A": square(a), "a": square(a), "b": vector(b), "x": vector(x), "x_hat": vector(x_hat),
        "A_hat": a + change, "a_hat": square(a + change), "b_hat": vector(b + right_change),
        "DeltaA": square(change), "Deltaa": square(change), "Deltab": vector(right_change), "Deltax": x_hat - x,
        "A_D": FirstOrder(np.triu(upper, 1) + Fraction(0)),
        "diag": lambda *numbers: diagonal([quantity(each).value for each in numbers]),
        "M_A": on_diagonal(diagonal([Fraction(x) for x in roundings(n)[0][0]])), "M_b": on_diagonal(of_right),
    }  # fmt: skip


def rows_of(*sizes: int) -> list[Names]:
    return [names for n in sizes for names in substitutions(n)]


def entries_of(*sizes: int) -> list[dict[str, Any]]:
    """Return triangular systems with each index k of their rows."""
    return [{**names, "k": Fraction(k)} for names in rows_of(*sizes) for k in range(1, int(names["n"]) + 1)]


def times_epsilon() -> list[dict[str, Any]]:
    """Return triangular systems of three rows where x and x̂ are multiplied by ε, as in (78)."""
    return [
        {**names, **{x: lambda i, x=names[x]: EPSILON * x(i) for x in ("x", "x_hat")}} for names in substitutions(3)
    ]


def index_ranges(off: int, diagonal: int = 0) -> list[dict[str, Any]]:
    """Return each pair of indices: the last part must hold above the diagonal alone, where `off` gives the entries."""
    found = []
    for names in rows_of(4, 5):
        n = int(names["n"])
        for k, j in itertools.product(range(2 * n + 2), repeat=2):
            here, above = {**names, "k": Fraction(k), "j": Fraction(j)}, 1 <= k < j <= n
            found.append({**here, "part": off + 1, "holds": above})
            if above or (diagonal and 1 <= k == j <= n):
                found.append({**here, "part": off if above else diagonal})
    return found


@cache
def generalizes() -> tuple[int, int]:
    """Count the runs of 3 and 4 rows in which each row stays within its counts of roundings, and all runs."""
    kept = count = 0
    for n in (3, 4):
        of_matrix, of_right = weights(n)
        for run, _, beta in runs(n):
            upper, right = (run.part(run.stages[1][-1], side).value for side in (False, True))
            again = Elimination(upper, right, run.rounded)
            x = np.array([[cell.value for cell in row] for row in again.solution], dtype=object)
            allowed = (abs(upper) * of_matrix.value) @ abs(x) + of_right.value @ abs(right)
            kept += bool((abs(right - upper @ x) <= beta * (1 + 10 * beta) * allowed).all())
            count += 1
    return kept, count


def _cited(document: str, number: Any, part: int = 1) -> tuple[sp.Expr, sp.Expr]:
    """Return the left and the last side of an equation of the same document, as it should read."""
    place = {"hung1984": "hung1984.II", "hung1982": "hung1982.III"}[document]
    relation = intended(f"{place}.eq{number}").relation(part)
    return relation.sides[0].value({"matrix": sp.Matrix}), relation.value({"matrix": sp.Matrix})


@cache
def _substituted(document: str, number: int, row: int, phrase: str) -> bool:
    """Whether the equations that a phrase names, in a line of (71), give an equation to first order."""
    unknown, epsilon = sp.Symbol(f"x_hat[{row}]"), sp.Symbol("epsilon")
    left, right = _cited(document, 71, row)
    replaced = dict(_cited(document, each) for each in re.findall(r"\((\d+)", phrase))
    pairs = ((left.subs(replaced), right), _cited(document, number))
    found, stated = (sp.solve(a - b, unknown) for a, b in pairs)
    difference = found[0] - stated[0] if found else sp.Integer(1)
    orders = (difference.subs(epsilon, 0), difference.diff(epsilon).subs(epsilon, 0))
    return all(sp.cancel(each) == 0 for each in orders)


def substitution(document: str, number: int) -> Names:
    """Which equations give (74), (77) or (79), if substituted in the line of (71) with the unknown on its diagonal."""
    row = {74: 3, 77: 2, 79: 1}[number]
    gives = partial(_substituted, document, number, row)
    return {
        "equations": gives,
        "line": lambda phrase: phrase == f"(71{'abc'[row - 1]})" and (number != 74 or gives("(73)")),
    }


def single_equation(document: str) -> Names:
    """Which equations are the rows of (80)."""
    left, right = _cited(document, 80)
    rows = {sp.expand(row) for row in left - right}

    def are_rows(phrase: str) -> bool:
        cited = (_cited(document, number) for number in re.findall(r"\((\d+)", phrase))
        return rows == {sp.expand(a - b) for a, b in cited}

    return {"equations": are_rows}


# -- computed inverses ----------------------------------------------------------------------------


def columns(x: FirstOrder) -> Callable[[Any], FirstOrder]:
    """Return the function that returns the columns of a matrix."""
    return lambda j: column(x, int(j))


@cache
def inverses(n: int = 3) -> tuple[Names, ...]:
    """Return symbols of section 11.3 for the inverse of a random matrix by elimination and back substitution."""
    return tuple(_inverse_names(n, *each) for each in enumerate((1, 2, n)))


def _inverse_names(n: int, seed: int, j: int) -> Names:
    a, unit = FirstOrder(random_matrix(random.Random(9000 + seed), n, n)), diagonal([Fraction(1)] * n)
    run = Elimination(a.value, unit.value, to_first_order)
    of_matrix, of_right = weights(n)
    upper, rights = (run.part(run.stages[1][-1], right) for right in (False, True))
    tilde, b_tilde = (sum(run.errors(right)[1:], start=run.errors(right)[0]) for right in (False, True))
    delta, b_delta = FirstOrder(upper.value * of_matrix.value) * EPSILON, of_right * rights * EPSILON
    delta_a, delta_b, x_hat = tilde + run.lower * delta, b_tilde + run.lower * b_delta, matrix(run.solution)
    error = x_hat - a.inv()
    e = joined([column(delta_b, c) - delta_a * column(x_hat, c) for c in range(1, n + 1)])
    return {
        **COMMON, "n": Fraction(n), "j": Fraction(j), "A": a, "A_hat": a + delta_a, "A_tilde": tilde, "DeltaA": delta,
        "deltaA": delta_a, "L": run.lower, "b": column(unit, j), "b_hat": column(unit + delta_b, j),
        "b_tilde": column(b_tilde, j), "Deltab": column(b_delta, j),
        "deltab": Named(column(delta_b, j), lambda c: column(delta_b, c)), "u": columns(unit), "x": column(a.inv(), j),
        "x_hat": columns(x_hat), "deltax": columns(error), "delta": lambda x: error if x == a.inv() else None,
        "column": lambda x, c: column(x, int(c)), "matrix": joined, "E": e, "D": e,
    }  # fmt: skip


def with_resultants() -> list[dict[str, Any]]:
    """Return the symbols of (68) with the resultant perturbations in place of those of the back substitution."""
    return [
        {**names, "Deltax": names["deltax"](names["j"]), "Deltab": names["deltab"](names["j"]),
         "DeltaA": names["deltaA"], "x_hat": names["x_hat"](names["j"])}
        for names in inverses()
    ]  # fmt: skip


@cache
def factored_errors() -> tuple[Names, ...]:
    """Return symbols of (96) and (97) for first-order errors that are a computed inverse times a matrix E or D."""
    return tuple(map(_factored_error, range(3)))


def _factored_error(seed: int) -> Names:
    rng = random.Random(9600 + seed)
    drawn = random_matrix(rng, 3, 3)
    a, e = FirstOrder(drawn) if seed else diagonal([Fraction(3)] * 3), FirstOrder(random_matrix(rng, 3, 3)) * EPSILON
    error = a.inv() * e
    return {
        **COMMON, "A": a, "A_hat": a, "E": e, "D": e, "delta": lambda x: error,
        "epsilon": error.norm() / a.inv().norm(),
    }  # fmt: skip


@cache
def residues(changed: bool, sharp: bool = False) -> tuple[Names, ...]:
    """Return symbols of section 10: computed inverses of A or of A + ΔA, and their residues.

    Parameters
    ----------
    changed : whether there is a ΔA. If so, residue and ΔA are of first order; otherwise the residue has any size.
    sharp : whether to add a multiple of the identity, for which the documents' norms are attained.
    """
    return tuple(_residue_names(seed, changed, sharp and seed == 0) for seed in range(3))


def _residue_names(seed: int, changed: bool, sharp: bool) -> Names:
    rng, unit = random.Random(3300 + seed), diagonal([Fraction(1)] * 3)
    a, size = FirstOrder(random_matrix(rng, 3, 3)), FirstOrder(random_matrix(rng, 3, 3)) * Fraction(1, 5)
    change = FirstOrder(random_matrix(rng, 3, 3)) * EPSILON if changed else a * 0
    if sharp:
        a, size, change = unit * 3, abs(size), FirstOrder(change.value, -abs(change.slope))
        size = FirstOrder(-change.slope * Fraction(2, 5)) if changed else size  # the same column is the largest
    residue = size * EPSILON if changed else size
    inverse, computed = a.inv(), (a + change).inv() * (unit + residue)
    error = computed - inverse
    return {
        **COMMON, "A": a, "DeltaA": change, "I": unit, "R": residue, "E": error,
        "epsilon": error.norm() / inverse.norm(), "j": Fraction(seed + 1), "u": columns(unit), "h": columns(inverse),
        "h_hat": columns(computed), "h_tilde": columns(error), "r": columns(residue), "x": column(inverse, seed + 1),
        "fl": lambda x: computed if x == inverse else None,
    }  # fmt: skip


@dataclass(frozen=True)
class Sample:
    """A matrix inverted in a format."""

    matrix: FloatArray
    pivot: bool

    @property
    def beta(self) -> Fraction:
        """Unit roundoff of the format."""
        return self.matrix.format.unit_roundoff

    @cached_property
    def reduction(self) -> Reduction:
        """Stages, right sides and inverse, as Fractions."""
        return procedure.as_fractions(procedure.reduce(self.matrix, self.pivot))

    @cached_property
    def inverse(self) -> Matrix:
        """The true inverse of the given matrix with its rows in the order of elimination."""
        return inverse_of(self.reduction.stages[0])

    @cached_property
    def error(self) -> Matrix:
        """The error of the computed inverse, entry by entry, with its signs."""
        return np.asarray(self.reduction.solution - self.inverse @ self.reduction.rights[0])


@cache
def samples() -> tuple[Sample, ...]:
    """Return random matrices of two to four rows in three formats, with or without pivoting, and that of 11.4."""
    rng = np.random.default_rng(1984)
    found = [Sample(FOUR.array(example.MATRIX), False)]
    for fmt in (FOUR, FloatFormat(10, 7), FloatFormat(2, 11, Rounding.CHOP)):
        for n in (2, 3, 4):
            for i in range(4):
                found.append(Sample(fmt.array(rng.integers(-999, 1000, (n, n)).tolist()), pivot=i % 2 == 0))
    return tuple(found)


def of_example() -> tuple[Sample, float]:
    """Return the example of 11.4 in four digits, and the norm of its error."""
    sample = samples()[0]
    return sample, float(column_sum_norm(sample.error))


def solved_columns() -> Names:
    """Count the columns of an inverse that a solution of their own gives in every digit."""
    a = samples()[0].matrix
    n, inverse = len(a), linalg.inv(a)
    columns = [linalg.solve(a, a.format.array([int(i == j) for i in range(n)])) for j in range(n)]
    same = sum(bool((column == inverse[:, j]).all()) for j, column in enumerate(columns))
    return {"times": "n times" if same == n else "", "count": n}


def pivoting() -> Names:
    swap = FOUR.array([[0, 1], [1, 0]])
    try:
        linalg.inv(swap)
        fails = False
    except np.linalg.LinAlgError:
        fails = True
    solved = bool((linalg.inv(swap, pivot=True) == swap).all())
    small = FOUR.array([["0.0001", 1], [1, 1]])
    without, pivoted = (float(column_sum_norm(Sample(small, pivot).error)) for pivot in (False, True))
    needed = fails and solved and without > 100 * pivoted
    return {"method": "with partial pivoting" if needed else "without pivoting", "without": without, "pivoted": pivoted}


def _residue_in_twice_the_digits(sample: Any) -> tuple[int, Fraction]:
    """Return twice the digits of the example, and how far its residue in these is from the true one."""
    twice = FloatFormat(10, 2 * FOUR.precision)
    a, x = (twice.array(part.to_fractions()) for part in (sample.matrix, linalg.inv(sample.matrix)))
    computed = exact(a @ x - twice.array(np.eye(3, dtype=int)))
    true = theory.residual(sample.matrix, sample.reduction.solution)
    return twice.precision, column_sum_norm(computed - true) / column_sum_norm(true)


@cache
def residue_of_example() -> Names:
    """Whether the residue in the example of 11.4 is easy to compute and gives the tightest bound."""
    sample, _ = of_example()
    digits, apart = _residue_in_twice_the_digits(sample)
    true = theory.residual(sample.matrix, sample.reduction.solution)
    trial = experiment.trial(sample.matrix, False, experiment.BETTER)
    tightest = min(trial.bounds, key=trial.overestimation)
    easy = apart < Fraction(1, 100) and tightest == "a posteriori" and not trial.violates(tightest)
    return {
        "residue": "can easily be obtained" if easy else "cannot easily be obtained",
        "parameter": "do not explicitly depend", "digits": digits, "bounds": len(trial.bounds),
        "apart": "exactly" if apart == 0 else f"to {float(apart):.0e}", "best": trial.overestimation(tightest),
        "first": float(theory.printed_first_bound(sample.inverse, true) / column_sum_norm(sample.error)),
    }  # fmt: skip


@cache
def two_parts() -> Names:
    few = samples()[::3]
    same = sum(bool((linalg.inv(s.matrix, s.pivot) == procedure.reduce(s.matrix, s.pivot).solution).all()) for s in few)
    return {"count": "two parts" if same == len(few) else "", "same": same, "tried": len(few)}


@cache
def largest_error() -> Names:
    """Return the largest relative error of rounding five-digit numbers to four digits, and β."""
    numbers = (Fraction(i) for i in range(10**FOUR.precision, 2 * 10**FOUR.precision))
    return {"epsilon": max(abs(FOUR.round(x) / x - 1) for x in numbers), "beta": FOUR.unit_roundoff}


@cache
def perturbed_inverse() -> Names:
    """Whether the inverse of the perturbed matrix is the computed inverse, in the example of 11.4."""
    sample, _ = of_example()
    change = theory.perturbation(sample.reduction, sample.beta, signed=False, transfer=True).matrix
    hat, computed = inverse_of(sample.reduction.stages[0] + change), sample.reduction.solution
    apart = column_sum_norm(hat - computed) / column_sum_norm(computed)
    return {"verb": "are computed" if (hat == computed).all() else "are not both computed", "apart": float(apart)}


@cache
def left_alone() -> Names:
    """Count samples in which elimination leaves the triangular factor, or the full matrix, as is."""
    triangular = full = 0
    few = samples()[::3]
    for sample in few:
        upper = procedure.reduce(sample.matrix, sample.pivot).stages[-1]
        triangular += all(bool((stage == upper).all()) for stage in procedure.reduce(upper).stages)
        full += all(bool((stage == sample.matrix).all()) for stage in procedure.reduce(sample.matrix, True).stages)
    return {"form": "upper triangular" if triangular == len(few) > full else "full", "triangular": triangular,
            "full": full, "count": len(few)}  # fmt: skip


@cache
def left_out() -> tuple[float, float]:
    """Return the share that (91) and (92) omit, as norms of sizes, in the example of 11.4."""
    sample, _ = of_example()
    whole, bare = (theory.perturbation(sample.reduction, sample.beta, False, transfer) for transfer in (True, False))
    parts = [column_sum_norm(w - b) / column_sum_norm(w) for w, b in zip(whole, bare, strict=True)]
    return float(parts[0]), float(parts[1])


COUNTEREXAMPLES = {
    "(96)": ([[-1, 94], [-48, 10]], FloatFormat(10, 3), False),
    "chart": ([[-95, -15, 84], [53, 62, 75], [-43, 48, 162]], FloatFormat(10, 6), True),
}


@cache
def counterexample(form: str) -> tuple[experiment.InverseTrial, str]:
    """Return a matrix whose error exceeds one form of the printed bound, and the name of the bound."""
    rows, fmt, pivot = COUNTEREXAMPLES[form]
    name = str(procedure.Reading(form=form))
    return experiment.trial(fmt.array(rows), pivot, [name, str(procedure.Reading(False, form)), "corrected"]), name


@cache
def exceeded() -> str:
    """Return the factors by which the errors of the counterexamples exceed the printed bound."""
    return "; ".join(map(_exceeded, COUNTEREXAMPLES))


def _exceeded(form: str) -> str:
    trial, name = counterexample(form)
    if not trial.violates(name):
        raise ArithmeticError(
            f"got an error of {trial.ratio(name)} times bound {form}; needed an error above the bound"
        )
    rows = ", ".join("(" + ", ".join(f"{float(x):g}" for x in row) + ")" for row in trial.matrix.to_float())
    return (
        f"for the matrix with rows {rows} and condition number {trial.condition:.3g}, inverted in "
        f"{trial.matrix.format.precision} digits {'with' if trial.pivot else 'without'} pivoting, "
        f"the error is {trial.ratio(name):.2g} times "
        f"{'the bound in the last box of the chart' if form == 'chart' else 'bound (96)'}"
    )


@cache
def terms_of_96() -> tuple[float, float, float]:
    """Return the norms of error, computed inverse and bracket of (95) in the example of 11.4."""
    sample, error = of_example()
    bracket = theory.bracket(sample.reduction, theory.perturbation(sample.reduction, sample.beta))
    return error, float(column_sum_norm(sample.reduction.solution)), float(column_sum_norm(bracket))


def meanings_of_e() -> Names:
    """Where E is defined so that (96) holds in the example of 11.4."""
    error, inverse, bracket = terms_of_96()
    shown = {
        "(95)": "E" in statement("hung1984.II.eq95").form,
        "(36)": error <= inverse * error,
        "the bracket of (95)": error <= inverse * bracket,
    }
    return {"place": {name for name, right in shown.items() if right}, "error": error, "inverse": inverse,
            "allowed": inverse * bracket}  # fmt: skip


def meanings_of_d() -> Names:
    """Where D is defined so that (96) holds in the example of 11.4 and says something."""
    error, inverse, bracket = terms_of_96()
    below_27 = 3.0  # the norm of the D below (27), for n = 3
    shown = {
        "(95)": "D" in statement("hung1982.III.eq95").form and error <= inverse * bracket,
        "(27)": bracket >= below_27,
    }
    return {"place": {name for name, right in shown.items() if right}, "error": error, "allowed": inverse * bracket,
            "other": inverse * below_27}  # fmt: skip


def operations(n: int) -> tuple[int, int]:
    """Count the multiplications and divisions for the inverse, and for its bound (96)."""
    reduce = sum((n - k) * (1 + (n - k) + n) for k in range(1, n))
    solve = n * sum(n - k + 1 for k in range(1, n + 1))
    sums = 2 * sum((n - k) ** 2 + (n - k) * n for k in range(1, n))  # by 3 and by 2, (59) and (60)
    return reduce + solve, sums + n * (n - 1) // 2 + n * n + n**3 + 1  # (89), (90), (95), (96)


def charts(document: str) -> list[str]:
    """Name the flow charts of sections 10 and 11 in a document."""
    figures = (each for each in load_statements() if each.kind == "figure" and each.document == document)
    return list(dict.fromkeys(each.item.split(" (")[0] for each in figures if each.id in CHECKS))


def chapters_of_figure() -> list[str]:
    """Name the chapters of hung1984 that have a Figure III-1."""
    figures = [e for e in load_statements() if e.document == "hung1984" and e.kind == "figure"]
    return list(dict.fromkeys(e.chapter for e in figures if e.item.startswith("Figure III-1")))


@cache
def reference_norms() -> float:
    """Return the largest relative change of the error norms if an inverse of 20 digits replaces the true one."""
    reference = exact(linalg.inv(FloatFormat(10, 20).array(example.MATRIX)))
    apart = []
    for places in example.PLACES:
        sample = Sample(FloatFormat(10, places + 1).array(example.MATRIX), False)
        norm = column_sum_norm(sample.reduction.solution - reference)
        apart.append(float(abs(norm / column_sum_norm(sample.error) - 1)))
    return max(apart)


CHECKS = read(__name__, globals(), vars(inversion_table))
