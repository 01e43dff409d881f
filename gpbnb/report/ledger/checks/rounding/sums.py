"""Section 6: sums, products and quotients."""

from __future__ import annotations

from fractions import Fraction
from functools import cache
from typing import Any

import numpy as np
import sympy as sp

from gpbnb.arithmetic.formats import FloatFormat
from gpbnb.report.ledger.checks.rounding.instances import (
    BETA,
    FOUR,
    fractions,
    judge,
    numbered,
    relations,
    small,
    surveyed,
)
from gpbnb.report.ledger.checks.rounding.instances import surveyed_bounds as statistics
from gpbnb.report.ledger.checks.rounding.registry import CHECKS
from gpbnb.report.ledger.finding import Finding, Verdict, compare
from gpbnb.report.ledger.registry import both
from gpbnb.report.ledger.statements import Statement
from gpbnb.report.rounding import derivation, experiment, theory


def _sum_names(x: list[Fraction], epsilon: list[Fraction]) -> dict[str, Any]:
    """Return a sum and its computed value, where the k-th addition has the relative error ``epsilon[k]``."""
    computed = x[0]
    for term, e in zip(x[1:], epsilon, strict=True):
        computed = (computed + term) * (1 + e)
    s = sum(x, start=Fraction(0))
    return {
        "n": Fraction(len(x)), "x": numbered(x), "s": s, "s_hat": computed, "s_tilde": computed - s, "beta": BETA,
        "errors": numbered(epsilon), "epsilon": abs((computed - s) / s),
    }  # fmt: skip


@cache
def sums(n: int | None = None) -> tuple[dict[str, Any], ...]:
    """Return sums of n terms, or of 3, 4 and 6 terms: random ones, and sums that attain the bounds (18)."""
    rng = np.random.default_rng(18)
    instances = []
    for count in (n,) if n else (3, 4, 6):
        worst = [BETA] * (count - 1)
        alternating = [Fraction(10), Fraction(3), *(Fraction(-1 - j % 2) for j in range(2, count))]
        equal = [Fraction(1, 2)] * 2 + [Fraction(1)] * (count - 2)
        instances += [_sum_names(alternating, worst) | {"tight": True}, _sum_names(equal, worst)]
        instances += [_sum_names(fractions(rng, count), small(rng, count - 1)) for _ in range(6)]
        instances += [_sum_names(fractions(rng, count), worst) for _ in range(6)]
    return tuple(instances)


@CHECKS.add(*both("s6.unnumbered-4-term-sum"), *both("s6.unnumbered-s"))
def four_terms(printed: Statement) -> Finding:
    instances = [{**names, "epsilon": names["errors"]} for names in sums(4)]
    found = judge(relations(printed), instances, first_order=printed.id.endswith("unnumbered-s"))
    return compare(
        found.right,
        f"{found} of terms and rounding errors, compared with the sum computed step by step",
        note="to first order" if printed.id.endswith("unnumbered-s") else "",
    )


@cache
def derived() -> bool:
    """Whether SymPy confirms the derivation of (18)."""
    return derivation.sums().holds


@cache
def _coarse_is_wider() -> bool:
    """Whether the last member of (18), which uses the largest term for all, is never smaller than the one before."""
    return all(
        theory.printed_sum_bound_coarse(trial.inputs[0], trial.fmt.unit_roundoff) >= trial.bounds["1984 (18)"]
        for trial in experiment.survey("sum")
    )


@cache
def _tie() -> float:
    """Return error / (18) of a sum of 100 terms in four digits whose additions are all ties."""
    return experiment.tie_sum(FOUR, 100).ratio("1984 (18)")


@CHECKS.add("hung1984.II.s6.unnumbered-4-term-bound", "hung1984.II.eq18")
def sum_bound_1984(printed: Statement) -> Finding:
    found = judge(relations(printed), sums(4) if "4-term" in printed.id else sums(), first_order=True)
    holds, text = surveyed("sum", "1984 (18)")
    wider, tie = _coarse_is_wider(), _tie()
    return compare(
        found.right and holds and wider and derived(),
        f"{found}, derived to first order for every $n$; {text}",
        note="the bound holds to first order but is not strict: for 100 terms in four digits, $1, \\beta, "
        f"-\\beta, \\dots, -\\beta$, the error exceeds it by {tie - 1:.1%}",
    )


@cache
def _like_signs() -> tuple[int, int]:
    """Count the violations of (18) of 1982 by sums of terms of one sign, and the sums."""
    like = [
        experiment.sum_trial(experiment.random_numbers(np.random.default_rng(seed), fmt, (5,), "like signs"))
        for fmt in experiment.SURVEYED
        for seed in range(20)
    ]
    return sum(trial.violates("1982 (18)") for trial in like), len(like)


@CHECKS.add("hung1982.III.s6.unnumbered-4-term-bound", "hung1982.III.eq18")
def sum_bound_1982(printed: Statement) -> Finding:
    found = judge(relations(printed), sums(4) if "4-term" in printed.id else sums(), first_order=True)
    random = statistics("sum")["1982 (18)"]
    violations, count = _like_signs()
    return compare(
        found.right,
        f"{found}; the bound $(n-1)\\beta$ fails in {random.violations} of {random.trials} random "
        f"sums, by a factor of up to {random.largest:.2g}, and in {violations or 'none'} of {count} "
        "sums whose terms all have the same sign",
        Verdict.WRONG,
        otherwise_note="the step drops $-x_3\\epsilon_1-x_4(\\epsilon_1+\\epsilon_2)$ as if this term could only "
        "reduce the error, which is true only if all terms have the same sign; hung1984 (18) "
        "corrects it",
        root="sum-bound-ignores-cancellation",
    )


def _quotient_names(
    x: list[Fraction], y: list[Fraction], epsilon: list[Fraction], eta: list[Fraction]
) -> dict[str, Any]:
    """Return a product divided by a product, computed from left to right, with the error of each operation."""
    true = computed = x[0]
    for factor, e in zip(x[1:], epsilon, strict=True):
        true, computed = true * factor, computed * factor * (1 + e)
    for divisor, e in zip(y, eta, strict=True):
        true, computed = true / divisor, computed / divisor * (1 + e)
    return {
        "n": Fraction(len(x)), "m": Fraction(len(y)), "x": numbered(x), "y": numbered(y), "beta": BETA,
        "Q": true, "Q_hat": computed, "Q_tilde": computed - true, "epsilon_": abs(computed / true - 1),
        "epsilon": abs(computed / true - 1), "errors": numbered(epsilon), "eta": numbered(eta),
    }  # fmt: skip


@cache
def quotients(sizes: tuple[tuple[int, int], ...]) -> tuple[dict[str, Any], ...]:
    """Return quotients of n factors and m divisors, with random errors and with errors that are all β."""
    rng = np.random.default_rng(20)
    instances = []
    for n, m in sizes:
        for _ in range(4):
            x, y = fractions(rng, n), fractions(rng, m)
            instances.append(_quotient_names(x, y, small(rng, n - 1), small(rng, m)))
            instances.append(_quotient_names(x, y, [BETA] * (n - 1), [BETA] * m))
    return tuple(instances)


@CHECKS.add(*both("s6.unnumbered-q-example"))
def quotient_example(printed: Statement) -> Finding:
    instances = [{**names, "epsilon": names["errors"]} for names in quotients(((2, 1),))]
    found = judge(relations(printed), instances, first_order=True)
    error, eps = derivation.quotient_error(2, 1)
    return compare(
        found.right and bool(sp.expand(error - sum(eps)) == 0),
        f"{found}; the relative error is ${sp.latex(error)}$, at most $2\\beta$",
        note="to first order" if printed.document == "hung1984" else "the verdict covers only what is legible",
    )


@cache
def worst_twenty() -> experiment.Trial:
    """Return the twenty factors of two digits whose product has the largest relative error."""
    return experiment.worst_product(FloatFormat(10, 2), 20)


SIZES = ((2, 1), (1, 2), (3, 0), (4, 3))


@CHECKS.add(*both("eq20"))
def product_bound(printed: Statement) -> Finding:
    found = judge(relations(printed), quotients(SIZES), first_order=True)
    holds, text = surveyed("product", "1982 (20)")
    counted = all(len(derivation.quotient_error(n, m)[1]) == n + m - 1 for n, m in SIZES)
    worst = worst_twenty()
    exceeded = ", ".join(f"{worst.ratio(f'{year} (20)'):.2f} times the bound of {year}" for year in (1982, 1984))
    return compare(
        found.right and holds and counted,
        f"there are ${sp.latex(derivation.product_operations())}$ roundings, so 2 for $x_1x_2/y_1$; "
        f"the printed bound {found}; for $(n+m-1)\\beta$, {text}",
        Verdict.INCONSISTENT if found.holds else Verdict.WRONG,
        note=(
            "the bound holds to first order but is not strict: the error for 20 factors of two digits "
            f"can be {exceeded}"
        ),
        otherwise_note="the bound is too large by 2β and contradicts the report's own example, $2\\beta$ for "
        "$x_1x_2/y_1$, and hung1982 (20); even so it is not strict: the error for 20 factors of two "
        f"digits can be {exceeded}",
    )
