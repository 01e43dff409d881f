"""Sentences between the equations of sections 1 to 9: small claims."""

from __future__ import annotations

from fractions import Fraction
from functools import cache

import numpy as np

from gpbnb.arithmetic.rational import exact
from gpbnb.report.ledger.checks.rounding.instances import all_numbers, judge, relations
from gpbnb.report.ledger.checks.rounding.registry import CHECKS
from gpbnb.report.ledger.finding import Finding, compare
from gpbnb.report.ledger.registry import both
from gpbnb.report.ledger.statements import Statement


@cache
def kept_terms() -> dict[str, bool]:
    """Whether the rounded number is one term of (2), up to a unit of the last digit, for all samples of all formats."""
    units = [(names, names["b"] ** (names["e"] - names["t"])) for names in all_numbers()]
    first = all(abs((each["x_hat"] - each["u"] * each["b"] ** each["e"]) / unit) in (0, 1) for each, unit in units)
    second = all(abs((each["x_hat"] - each["v"] * unit) / unit) in (0, 1) for each, unit in units)
    return {"second": first, "first": second}


@CHECKS.add(*both("s2.claim-drops-off"))
def drops_off(printed: Statement) -> Finding:
    dropped = kept_terms()
    return compare(
        dropped[printed.says("term")],
        f"in all {len(all_numbers())} instances the rounded number is the first term of (2), or differs from it by one "
        "unit of the last digit",
    )


@CHECKS.add(*both("s4.claim-v-below-one"))
def v_below_one(printed: Statement) -> Finding:
    found = judge(relations(printed), all_numbers())
    return compare(found.right, f"{found}, with $v$ up to {float(max(abs(each['v']) for each in all_numbers())):g}")


@CHECKS.add(*both("s9.inner-products"))
def inner_products(printed: Statement) -> Finding:
    rng = np.random.default_rng(9)
    a, b = exact(rng.integers(-9, 10, (3, 4))), exact(rng.integers(-9, 10, (4, 2)))
    product = a @ b
    pairs = [(i, j) for i in range(3) for j in range(2)]
    of_vectors = {
        "inner products of vector pairs": [sum(p * q for p, q in zip(a[i], b[:, j], strict=True)) for i, j in pairs],
        "sums of vector pairs": [
            sum((p + q for p, q in zip(a[i], b[:, j], strict=True)), Fraction(0)) for i, j in pairs
        ],
    }
    return compare(
        of_vectors[printed.says("elements")] == [product[i, j] for i, j in pairs],
        f"for random matrices of size 3 × 4 and 4 × 2, each of the {len(pairs)} elements is the inner product of a row "
        "and a column",
    )
