"""Sections 7 and 8: norms, and the sum of two matrices."""

from __future__ import annotations

from collections.abc import Callable
from fractions import Fraction
from functools import cache
from typing import Any

import numpy as np

from gpbnb.arithmetic.rational import column_sum_norm, exact, max_norm, row_sum_norm
from gpbnb.report.ledger.checks.rounding.instances import FOUR, Matrix, fractions, gap, judge, relations, surveyed
from gpbnb.report.ledger.checks.rounding.one_rounding import operations
from gpbnb.report.ledger.checks.rounding.registry import CHECKS
from gpbnb.report.ledger.finding import Finding, Verdict, compare, given
from gpbnb.report.ledger.registry import both
from gpbnb.report.ledger.statements import Statement


def norm(matrix: Matrix) -> Fraction:
    """Return norm (22), the largest column sum; TypeError for anything but a matrix."""
    return column_sum_norm(_matrix(matrix).entries)


def vector_norm(vector: Matrix) -> Fraction:
    """Return norm (21), the largest entry; TypeError for anything but a vector."""
    return max_norm(_matrix(vector).entries)


def _matrix(value: object) -> Matrix:
    if not isinstance(value, Matrix):
        raise TypeError(f"got {value!r}; needed a vector or a matrix")
    return value


def _incompatible() -> str:
    a, x = exact([[1, 1], [0, 0]]), exact([1, 1])
    return (
        f"for the matrix with rows (1, 1), (0, 0) and $x=(1,1)$, $\\|Ax\\|={max_norm(a @ x)}$, but "
        f"$\\|A\\|\\|x\\|={column_sum_norm(a) * max_norm(x)}$ with column sums and "
        f"{row_sum_norm(a) * max_norm(x)} with row sums"
    )


@CHECKS.add("hung1984.II.eq22")
def matrix_norm_defined() -> Finding:
    return given(
        "defines the norm of a matrix as the largest column sum. It is not compatible with the "
        f"vector norm (21), which requires row sums: {_incompatible()}"
    )


@CHECKS.add("hung1982.III.eq22")
def matrix_norm_defined_1982() -> Finding:
    return given(
        "defines the norm of a matrix; the indices are not legible. hung1984 uses the largest column "
        f"sum, which is not compatible with the vector norm (21): {_incompatible()}"
    )


@cache
def norm_instances(shape: tuple[int, ...]) -> tuple[dict[str, Any], ...]:
    """Return pairs of random arrays, a pair of an array and its multiple, and a pair that starts with zero."""
    rng = np.random.default_rng(7)
    size = int(np.prod(shape))

    def random() -> Any:
        return np.array(fractions(rng, size), dtype=object).reshape(shape)

    pairs = [(random(), random()) for _ in range(40)]
    pairs += [(3 * a, a) for a, _ in pairs[:4]] + [(0 * a, a) for a, _ in pairs[:2]]
    pairs.append((exact(np.ones(shape, dtype=int)), exact(np.ones(shape, dtype=int))))
    return tuple(
        {"x": Matrix(a), "y": Matrix(b), "A": Matrix(a), "B": Matrix(b), "a": fractions(rng, 1)[0]} for a, b in pairs
    )


def _norm_properties(printed: Statement, size: Callable[[Matrix], Fraction], shape: tuple[int, ...]) -> Finding:
    instances = [{**names, "norm": size} for names in norm_instances(shape)]
    found = judge(relations(printed), instances)
    zeros = {bool(np.any(names["x"].entries != 0)) for names in instances if size(names["x"]) == 0}
    only = zeros == {False} and "only if" in printed.says("zero")
    return compare(
        found.right and only,
        f"{found}; the norm is zero {'only for zero' if zeros == {False} else 'for other arrays too'}",
    )


@CHECKS.add(*both("s7.vector-norm-properties-i-iv"))
def vector_norm_properties(printed: Statement) -> Finding:
    return _norm_properties(printed, vector_norm, (5,))


@CHECKS.add("hung1984.II.s7.matrix-norm-properties-i-v", "hung1982.III.s7.matrix-norm-properties-i-iv")
def matrix_norm_properties(printed: Statement) -> Finding:
    return _norm_properties(printed, norm, (3, 3))


@CHECKS.add("hung1982.III.s7.norm-property-v")
def norm_property_v(printed: Statement) -> Finding:
    instances = [{**names, "norm": norm} for names in norm_instances((3, 3))]
    found = judge(relations(printed), instances)
    products = [(norm(names["A"] * names["B"]), norm(names["A"]) * norm(names["B"])) for names in instances]
    at_most = sum(left <= right for left, right in products)
    return compare(
        found.right,
        f"the printed relation {found}; with $\\le$ it holds in {at_most}",
        Verdict.MISPRINT if at_most == len(instances) else Verdict.WRONG,
        otherwise_note="$\\le$ is meant, as hung1984 prints it; the scan also shows the $\\le$ of (13) as =",
    )


# -- section 8 ------------------------------------------------------------------------------------


@cache
def rounded_sums() -> tuple[dict[str, Any], ...]:
    """Return sums of matrices in four digits: random ones, differences of nearly equal and equal numbers, and ties."""
    rng = np.random.default_rng(24)

    def random(rows: int, columns: int, power: int) -> Any:
        digits = rng.integers(1000, 10000, (rows, columns)) * rng.choice([-1, 1], (rows, columns))
        return FOUR.array(exact(digits) * Fraction(10) ** power)

    pairs = [(random(n, m, k), random(n, m, 0)) for n, m in ((1, 1), (2, 3), (3, 3)) for k in (-3, -1, 0, 2)]
    pairs += [(FOUR.array([["7.654"]]), FOUR.array([["7.653"]])), (FOUR.array([["1"]]), FOUR.array([["0.0005"]]))]
    pairs.append((FOUR.array([["7.654"]]), FOUR.array([["-7.654"]])))
    instances = []
    for a, b in pairs:
        true = a.to_fractions() + b.to_fractions()
        error = (a + b).to_fractions() - true
        instances.append(
            {"A": Matrix(a.to_fractions()), "B": Matrix(b.to_fractions()), "R": Matrix(error), "norm": norm,
             "beta": gap(10, 4) / 2, "b": Fraction(10), "t": Fraction(4),
             "epsilon": column_sum_norm(error) / column_sum_norm(true) if np.any(true) else Fraction(0)}
        )  # fmt: skip
    return tuple(instances)


@CHECKS.add(*both("eq24"), *both("eq25"))
def matrix_sum(printed: Statement) -> Finding:
    absolute = printed.id.endswith("eq24")
    found = judge(relations(printed), [names for names in rounded_sums() if absolute or names["epsilon"]])
    holds, text = surveyed("matrix sum", "(24)")
    return compare(
        found.right and holds, f"{found}; {text}", note="the bound is strict: by (16), it holds for each entry"
    )


@CHECKS.add(*both("s8.claim-same-as-16"))
def same_as_16(printed: Statement) -> Finding:
    beta = gap(10, 4) / 2
    matrix, single = (max(abs(names["epsilon"]) for names in each) / beta for each in (rounded_sums(), operations()))
    factor = {"the same as": 1, "twice": 2, "half of": Fraction(1, 2)}[printed.says("comparison")]
    return compare(
        abs(matrix - factor * single) < Fraction(1, 100),
        f"the largest relative error is {float(matrix):.4f} β for sums of matrices, and {float(single):.4f} β for "
        "single operations",
    )


@CHECKS.add("hung1984.II.s8.text-after-24")
def beta_after_24(printed: Statement) -> Finding:
    found = judge(relations(printed), [names for names in rounded_sums() if names["epsilon"]])
    beta, step = gap(10, 4) / 2, gap(10, 4)
    return compare(
        found.right,
        f"$\\beta={beta / step}\\,b^{{1-t}}$, measured; the printed formula {found}",
        Verdict.MISPRINT,
        otherwise_note="hung1982 prints $\\frac12$; this scan also shows other digits and letters as $\\epsilon$, "
        "such as the l of $fl$ in section 11",
    )
