"""Section 9: inner products, matrix products, and chains of matrix products."""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from fractions import Fraction
from functools import cache
from typing import Any

import numpy as np

from gpbnb.arithmetic.formats import FloatFormat
from gpbnb.arithmetic.rational import column_sum_norm, exact
from gpbnb.report.ledger.checks.rounding.instances import (
    BETA,
    FOUR,
    Matrix,
    fractions,
    judge,
    numbered,
    relations,
    small,
)
from gpbnb.report.ledger.checks.rounding.instances import surveyed as found_in_survey
from gpbnb.report.ledger.checks.rounding.instances import surveyed_bounds as statistics
from gpbnb.report.ledger.checks.rounding.matrices import norm
from gpbnb.report.ledger.checks.rounding.registry import CHECKS
from gpbnb.report.ledger.checks.rounding.sums import worst_twenty
from gpbnb.report.ledger.finding import Finding, Verdict, answer, compare
from gpbnb.report.ledger.html import chapter
from gpbnb.report.ledger.registry import both
from gpbnb.report.ledger.statements import Statement
from gpbnb.report.rounding import derivation, experiment, theory

ROOT = "product-error-relative-to-product"


@cache
def derived() -> bool:
    """Whether SymPy confirms the derivations of (26) and (32)."""
    return derivation.dots().holds and derivation.chains().holds


# -- section 9.1: inner products ------------------------------------------------------------------


def rounded_dot(a: Sequence[Fraction], b: Sequence[Fraction], epsilon: Sequence[Fraction]) -> Fraction:
    """Return an inner product in the order of section 9.1, with errors numbered as in that section."""
    errors = iter(epsilon)
    computed = a[0] * b[0] * (1 + next(errors))
    for p, q in zip(a[1:], b[1:], strict=True):
        term = p * q * (1 + next(errors))
        computed = (computed + term) * (1 + next(errors))
    return computed


def _dot_names(a: list[Fraction], b: list[Fraction], epsilon: list[Fraction]) -> dict[str, Any]:
    true = sum((p * q for p, q in zip(a, b, strict=True)), start=Fraction(0))
    computed = rounded_dot(a, b, epsilon)
    return {
        "n": Fraction(len(a)), "a": numbered(a), "b": numbered(b), "epsilon": numbered(epsilon), "beta": BETA,
        "I": true, "I_hat": computed, "I_tilde": computed - true, "fl": {true: computed}.__getitem__,
    }  # fmt: skip


@cache
def dots(sizes: tuple[int, ...]) -> tuple[dict[str, Any], ...]:
    """Return inner products with random errors, and with products of one sign whose errors are all β."""
    rng = np.random.default_rng(26)
    instances = []
    for n in sizes:
        for _ in range(6):
            a, b = fractions(rng, n), fractions(rng, n)
            instances.append(_dot_names(a, b, small(rng, 2 * n - 1)))
            instances.append(_dot_names([abs(x) for x in a], [abs(x) for x in b], [BETA] * (2 * n - 1)))
    return tuple(instances)


@CHECKS.add(*both("s9-1.unnumbered-3-vector-inner-product"))
def three_products(printed: Statement) -> Finding:
    found = judge(relations(printed), dots((3,)))
    exact_line, *rounded = relations(printed)
    hats = [{**names, "I": names["I_hat"]} for names in dots((3,))]
    only_hat = bool(rounded) and judge([exact_line], dots((3,))).holds and judge(rounded, hats).holds
    return compare(
        found.right,
        f"{found}" + ("; with $\\hat I$ for the computed value, it holds in all instances" if only_hat else ""),
        Verdict.MISPRINT if only_hat else Verdict.WRONG,
        otherwise_note="the hat is missing on the computed value $\\hat I$, so $I$ stands for two quantities",
    )


@CHECKS.add(*both("s9-1.unnumbered-i"))
def dot_error(printed: Statement) -> Finding:
    found = judge(relations(printed), dots((3,)), first_order=True)
    extra = [{**names, "I_tilde": names["I_tilde"] + names["a"][2] * names["b"][2]} for names in dots((3,))]
    left_over = judge(relations(printed), extra, first_order=True)
    return compare(
        found.right,
        f"{found}; the weight of $a_2b_2$ is $\\epsilon_2+\\epsilon_3+\\epsilon_5$",
        Verdict.MISPRINT if left_over.holds else Verdict.WRONG,
        note="to first order",
        otherwise_note="the printed 1 is left over from the line above; the bound that follows is right",
    )


@cache
def dot_weights(n: int) -> list[int]:
    """Count the roundings of each product in an inner product, from its derived first-order error."""
    error, products, eps = derivation.dot_error(n)
    return [derivation.roundings_of(error, product, eps) for product in products]


@cache
def worst_twelve() -> float:
    """Return the largest error / bound (26) for an inner product of 12 terms in three bits."""
    return experiment.worst_sum(FloatFormat(2, 3), 12, range(-5, 4), products=True).ratio("(26)")


@CHECKS.add(*both("s9-1.unnumbered-3-vector-bound"), *both("eq26"))
def dot_bound(printed: Statement) -> Finding:
    three = "3-vector" in printed.id
    found = judge(relations(printed), dots((3,) if three else (2, 4, 6)), first_order=True)
    holds, text = found_in_survey("dot", "(26)")
    weights = dot_weights(3 if three else 6)
    restored = "; the scan seems to show $n$ before the brace, but (27) shows that $n$ belongs to the first product"
    return compare(
        found.right and holds and derived(),
        f"{found}; the weights of {len(weights)} products are {', '.join(map(str, weights))}; {text}",
        note=(
            "the bound holds to first order but is not strict: the error of an inner product of 12 "
            f"products in three bits can be {worst_twelve():.3f} times the bound"
        )
        + (restored if printed.id == "hung1982.III.eq26" else ""),
    )


@CHECKS.add(*both("s9-1.relative-inner-product-error"))
def relative_dot() -> Finding:
    rng = np.random.default_rng(26)
    fmt = FloatFormat(10, 6)
    holds = True
    for _ in range(200):
        a, b = experiment.random_numbers(rng, fmt, (2, 5))
        true = sum(a.to_fractions() * b.to_fractions())
        bound = theory.relative_dot_bound(a, b, fmt.unit_roundoff)
        holds &= abs((a @ b).to_fractions() / true - 1) <= bound
    return answer(
        bool(holds),
        "$|\\tilde I/I|\\le\\gamma_n\\,|a|^T|b|\\,/\\,|a^Tb|$, $\\gamma_n=n\\beta/(1-n\\beta)$",
        f"see the {chapter('rounding')}, section on inner products",
    )


# -- section 9.2: products of two matrices --------------------------------------------------------


def rounded_product(a: Any, b: Any, errors: Any) -> Any:
    """Return a matrix product whose entries are inner products; ``errors(count)`` gives the errors of an entry."""
    n = a.shape[1]
    return exact([[rounded_dot(list(row), list(column), errors(2 * n - 1)) for column in b.T] for row in a])


def _dominated(shape: tuple[int, int]) -> Any:
    """Return a matrix whose first entry is far larger than the others, so that products attain their bounds."""
    matrix = np.full(shape, Fraction(1, 10**4), dtype=object)
    matrix[0, 0] = Fraction(1)
    return matrix


def _random_matrix(rng: np.random.Generator, shape: tuple[int, int]) -> Any:
    return np.array(fractions(rng, shape[0] * shape[1]), dtype=object).reshape(shape)


@cache
def matrix_products() -> tuple[dict[str, Any], ...]:
    """Products of an m × n and an n × p matrix with random errors, with errors that are all β, and of zeros."""
    rng = np.random.default_rng(28)
    instances = []
    for m, n, p in ((2, 3, 2), (3, 4, 2), (2, 5, 3)):
        cases = [(_random_matrix(rng, (m, n)), _random_matrix(rng, (n, p)), lambda k: small(rng, k)) for _ in range(3)]
        cases.append((_dominated((m, n)), _dominated((n, p)), lambda k: [BETA] * k))
        cases.append((0 * cases[0][0], 0 * cases[0][1], lambda k: [BETA] * k))
        cases.append((abs(cases[0][0]), abs(cases[0][1]), lambda k: [BETA] * k))
        for a, b, errors in cases:
            error = rounded_product(a, b, errors) - a @ b
            entry: dict[str, Any] = {
                name: {(i + 1, j + 1): value for (i, j), value in np.ndenumerate(matrix)}
                for name, matrix in (("a", a), ("b", b), ("c_tilde", error))
            }
            weights = np.diag([n, *range(n, 1, -1)])
            instances.append(
                {**entry, "n": Fraction(n), "i": Fraction(m), "j": Fraction(p), "beta": BETA, "norm": norm,
                 "positive": a is cases[-1][0],
                 "bracket": abs, "A": Matrix(a), "B": Matrix(b), "C_tilde": Matrix(error), "D": Matrix(weights)}
            )  # fmt: skip
    return tuple(instances)


def _long_products() -> list[dict[str, Any]]:
    """Return the products with at least four terms in each entry, so that the printed dots have a meaning.

    Where all numbers and errors are positive, each entry attains its bound.
    """
    return [
        {**each, "diag": lambda *numbers: Matrix(np.diag(numbers)), "tight": each["positive"]}
        for each in matrix_products()
        if each["n"] >= 4
    ]


@CHECKS.add("hung1982.III.eq27")
def entry_bound(printed: Statement) -> Finding:
    found = judge(relations(printed), _long_products(), first_order=True)
    return compare(found.right and derived(), f"{found}", note="to first order")


@CHECKS.add("hung1982.III.s9-2.unnumbered-c")
def entry_bounds(printed: Statement) -> Finding:
    found = judge(relations(printed), _long_products(), first_order=True)
    n = 5
    d = [n, *range(n, 1, -1)]
    return compare(
        found.right and derived(),
        f"{found}; for $n={n}$, the diagonal of $D$ is {', '.join(map(str, d))}, and its norm is {max(d)}",
        note="to first order; the diagonal of $D$ is restored from the weights of (27), since only one entry of it is "
        "legible and the page is missing from hung1984",
    )


@CHECKS.add(*both("eq28"))
def matmul_bound(printed: Statement) -> Finding:
    instances = []
    for names in matrix_products():
        # The second form expresses β by b and t, as (8) with forty-one digits.
        instances.append({**names, "b": Fraction(10), "t": Fraction(41), "beta": Fraction(1, 2) / 10**40})
        instances[-1]["C_tilde"] = Fraction(1, 2) * names["C_tilde"]
    found = judge(relations(printed), instances, first_order=True)
    violations, trials = _survey_of_products()
    return compare(
        found.right and violations == 0,
        f"{found}; {violations} violations in {trials} random products of 11 bits",
        note="the bound is strict, as Jeannerod and Rump proved in 2013",
    )


@cache
def _survey_of_products() -> tuple[int, int]:
    rng, fmt = np.random.default_rng(28), FloatFormat(2, 11)
    trials = [
        experiment.chain_trial(list(experiment.random_numbers(rng, fmt, (2, n, n))))
        for n in (1, 2, 3, 5)
        for _ in range(20)
    ]
    return sum(trial.violates("(32)") for trial in trials), len(trials)


# -- section 9.2: chains --------------------------------------------------------------------------


def _chain_names(factors: list[Any], errors: Any) -> dict[str, Any]:
    products = [factors[0]]
    computed = [factors[0]]
    for factor in factors[1:]:
        products.append(products[-1] @ factor)
        computed.append(rounded_product(computed[-1], factor, errors))
    count = len(factors)
    rounded = {
        Matrix(left @ factor): value
        for left, factor, value in zip(computed[:-1], factors[1:], computed[1:], strict=True)
    }

    def fl(argument: Matrix) -> Matrix:
        for true, value in rounded.items():
            if true.entries.shape == argument.entries.shape and np.all(true.entries == argument.entries):
                return Matrix(value)
        raise LookupError("this product is not computed")

    return {
        "N": Fraction(count), "M": {i + 1: Matrix(f) for i, f in enumerate(factors)}, "norm": norm, "fl": fl,
        "d": {i + 1: Fraction(f.shape[1]) for i, f in enumerate(factors[:-1])}, "beta": BETA, "epsilon": BETA,
        "P_hat": {i + 1: Matrix(p) for i, p in enumerate(computed)},
        "P_tilde": {i + 1: Matrix(c - p) for i, (c, p) in enumerate(zip(computed, products, strict=True))},
    }  # fmt: skip


@cache
def chains() -> tuple[dict[str, Any], ...]:
    """Return chains of three matrices: random ones, one that cancels, some that attain (32), and one of zeros."""
    rng = np.random.default_rng(32)
    shapes = ((2, 3), (3, 4), (4, 2))
    instances = [
        _chain_names([_random_matrix(rng, shape) for shape in shapes], lambda k: small(rng, k)) for _ in range(4)
    ]
    for sizes, scales in (((2, 3, 4, 2), (2, 3, 5)), ((2, 4, 3, 2), (5, 3, 2))):
        factors = [_dominated(shape) * scale for shape, scale in zip(itertools.pairwise(sizes), scales, strict=True)]
        instances.append(_chain_names(factors, lambda k: [BETA] * k))
    row, column = exact([["1.001", "-1.002"]]), exact([["1.001"], ["1"]])
    instances.append(_chain_names([row, column, exact([["1"]])], lambda k: [BETA, -BETA] * (k // 2) + [BETA]))
    instances.append(_chain_names([exact([[0]])] * 3, lambda k: [BETA] * k))
    return tuple(instances)


def cancelling_product() -> experiment.Trial:
    """Return the smallest counterexample to (30), a row and a column in 4 digits whose product cancels."""
    return experiment.chain_trial([FOUR.array([["1.001", "-1.002"]]), FOUR.array([["1.001"], ["1"]])])


def _error_of_the_shortcut() -> tuple[bool, str]:
    """Whether (31) has no violation, and how often and how far errors of chains exceed it."""
    survey, worst = statistics("chain")["(31)"], cancelling_product()
    holds = survey.violations == 0 and derivation.chain_shortcut() == 0 and not worst.violates("(31)")
    return holds, (
        f"(31) has {survey.violations} violations in {survey.trials} random chains; the error of "
        f"$1.001\\cdot1.001-1.002\\cdot1$ in four digits is {worst.ratio('(31)'):.0f} times the bound"
    )


_SHORTCUT = (
    "(28) bounds a norm; the error is not a multiple of the product, because the product may cancel while the error "
    "remains"
)


def _chain_claim(printed: Statement, note: str) -> Finding:
    found = judge(relations(printed), chains(), first_order=True)
    return compare(
        found.right, f"{found}; {_error_of_the_shortcut()[1]}", Verdict.WRONG, otherwise_note=note, root=ROOT
    )


@CHECKS.add(*both("s9-2.claim-28-implies"))
def implied(printed: Statement) -> Finding:
    holds, text = _error_of_the_shortcut()
    meanings = {"implies": holds, "is equivalent to": False, "does not imply": not holds}
    return compare(printed.claims("step", meanings), text, Verdict.WRONG, otherwise_note=_SHORTCUT, root=ROOT)


@CHECKS.add(*both("s9-2.p-2-line"), *both("s9-2.p-3-line"), *both("eq30"))
def chain_shortcut(printed: Statement) -> Finding:
    return _chain_claim(printed, f"{_SHORTCUT}; in norms, $\\|M_1\\|\\|M_2\\|\\cdots$ replaces the product, as in (32)")


@CHECKS.add(*both("eq31"))
def chain_error(printed: Statement) -> Finding:
    return _chain_claim(
        printed,
        "the error follows from the error in (30); also, a tilde is missing on the left side of (31)"
        "; (32) is right, since norms of the factors replace the product",
    )


@CHECKS.add("hung1982.III.s9-2.cross-reference-to-28")
def reference_28(printed: Statement) -> Finding:
    number = printed.says("equation").strip("()")
    cited, meant = CHECKS.get(f"hung1982.III.eq{number}"), CHECKS.get("hung1982.III.eq28")
    return compare(
        cited is matmul_bound,
        "the bound for a matrix product is (28); equation (38) belongs to section 10",
        Verdict.MISPRINT if meant is matmul_bound else Verdict.WRONG,
        otherwise_note="(28) is meant, as hung1984 prints it",
    )


@CHECKS.add(*both("eq32"))
def chain_bound(printed: Statement) -> Finding:
    found = judge(relations(printed), chains(), first_order=True)
    holds, text = found_in_survey("chain", "(32)")
    worst = worst_twenty()
    matrices = [worst.inputs[0].format.array([[x]]) for x in worst.inputs[0].to_fractions()]
    return compare(
        found.right and holds and derived(),
        f"{found}, derived to first order for every $N$; {text}",
        note="the bound is right to first order although (30) and (31) are wrong, because the norms of "
        "the errors add up; it is not strict, since the error for 20 matrices of size 1 × 1 in two "
        f"digits is {experiment.chain_trial(matrices).ratio('(32)'):.2f} times the bound",
    )


# -- section 9.2: the examples --------------------------------------------------------------------


def _example_names(factors: list[Any], d: Any, errors: Any, size: int) -> dict[str, Any]:
    a, b, c = factors
    computed = rounded_product(rounded_product(a, b, errors), c, errors) + d
    rounded = exact([[x * (1 + errors(1)[0]) for x in row] for row in computed])
    true = a @ b @ c + d
    return {
        "A": Matrix(a), "B": Matrix(b), "C": Matrix(c), "D": Matrix(d), "R": Matrix(true), "R_hat": Matrix(rounded),
        "R_tilde": Matrix(rounded - true), "n": Fraction(size), "m": Fraction(a.shape[1]), "r": Fraction(b.shape[1]),
        "beta": BETA, "epsilon": BETA, "norm": norm,
    }  # fmt: skip


@cache
def example_instances(rectangular: bool = False) -> tuple[dict[str, Any], ...]:
    """Return instances of R = ABC + D: random ones, one whose AB cancels, some that attain their bound, and zero."""
    rng = np.random.default_rng(9)
    instances = []
    for sizes in ((2, 2, 2, 2), (3, 3, 3, 3), (2, 3, 4, 2)) if rectangular else ((2,) * 4, (3,) * 4):
        shapes = [*itertools.pairwise(sizes), (sizes[0], sizes[-1])]
        *factors, d = (_random_matrix(rng, shape) for shape in shapes)
        instances.append(_example_names(factors, d, lambda k: small(rng, k), sizes[0]))
        *factors, d = map(_dominated, shapes)
        instances.append(_example_names(factors, d, lambda k: [BETA] * k, sizes[0]))
    a, b = exact([["1.001", "-1.002"], [0, 0]]), exact([["1.001", 0], [1, 0]])
    one = exact(np.eye(2, dtype=int))
    instances.append(_example_names([a, b, one], 0 * one, lambda k: [BETA, -BETA] * (k // 2) + [BETA], 2))
    instances.append(_example_names([0 * one] * 3, 0 * one, lambda k: [BETA] * k, 2))
    return tuple(instances)


@cache
def _examples_in_four_digits() -> str:
    found = statistics("example")["Examples"]
    a = FOUR.array([["1.001", "-1.002"], [0, 0]])
    b, one = FOUR.array([["1.001", 0], [1, 0]]), FOUR.array(np.eye(2, dtype=int))
    trial = experiment.example_trial(a, b, one, one * 0)
    corrected = statistics("example")["corrected"].violations
    return (
        f"the printed bound fails in {found.violations} of {found.trials} random trials, and by a "
        f"factor of {trial.ratio('Examples'):.0f} in a constructed example; the corrected bound "
        f"$\\beta[(m+r)\\|A\\|\\|B\\|\\|C\\|+\\|ABC+D\\|]$ fails in {corrected}"
    )


@CHECKS.add(*both("s9-2.claim-24-and-31"))
def joint_use(printed: Statement) -> Finding:
    corrected = statistics("example")["corrected"]
    meanings = {"can be used jointly": corrected.violations == 0, "must be used jointly": False}
    return compare(
        printed.claims("use", meanings),
        f"with (32) in place of (31), the joint bound $\\beta[(m+r)\\|A\\|\\|B\\|\\|C\\|+\\|ABC+D\\|]$ fails in "
        f"{corrected.violations} of {corrected.trials} random trials",
        note="the method that the sentence names is sound; but applied to (31) as printed, it gives the bounds in the "
        "examples, which fail",
    )


@CHECKS.add(*both("s9-2.example-1"), *both("s9-2.example-2"))
def examples(printed: Statement) -> Finding:
    found = judge(relations(printed), example_instances("example-2" in printed.id), first_order=True)
    return compare(
        found.right,
        f"{found}; {_examples_in_four_digits()}",
        Verdict.WRONG,
        otherwise_note="the bound rests on (31): it has $\\|ABC\\|$ where $\\|A\\|\\|B\\|\\|C\\|$ is required, as in "
        "(32); section 12 makes the same mistake from (102) on",
        root=ROOT,
    )


@CHECKS.add(*both("s9-2.closing-remark"))
def closing_remark(printed: Statement) -> Finding:
    beta = FOUR.unit_roundoff
    matrices = [exact(np.full(shape, 1)) for shape in ((2, 3), (3, 5), (5, 2))]
    ratio = theory.chain_bound(matrices, beta) / (beta * math.prod(map(column_sum_norm, matrices)))
    wide, narrow = exact(np.full((1, 9), 1)), exact(np.full((1, 2), 1))
    same = theory.matrix_sum_bound(wide, wide, beta) == theory.matrix_sum_bound(narrow, narrow, beta)
    involved = {3 + 5: "all the interface dimensions", 5: "the largest interface dimension alone"}
    return compare(
        printed.says("addition") == ("does not involve" if same else "involves")
        and printed.says("product") == involved.get(int(ratio), ""),
        (
            f"for matrices of size 2 × 3, 3 × 5 and 5 × 2, the factor in (32) is $3+5={ratio}$; bound "
            "(24) has no such factor"
        ),
    )
