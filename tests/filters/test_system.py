"""gpbnb.filters.system: linear filters against rounded Fractions, and their bounds."""

from __future__ import annotations

from fractions import Fraction

import numpy as np
import pytest

from gpbnb import required_precision
from gpbnb.arithmetic.formats import FloatFormat
from gpbnb.arithmetic.rational import exact
from gpbnb.bounds.guarantee import limits
from gpbnb.filters.system import LinearSystem, is_stable


@pytest.mark.parametrize("basis", ["bound", "guarantee"])
def test_a_bound_counts_inputs_that_float64_does_not_hold(basis):
    """An input just above 1 is rounded up to the next number of a format, twice as far as one just below."""
    u = 1 + Fraction(1, 10**20)
    delay = LinearSystem([[0]], [[1]], [[1]])
    z, within = ([[u]] * 5, None) if basis == "bound" else (5, limits(measurement=u))
    found = required_precision(delay, z, 0.0008, basis=basis, rounding="up", within=within)
    outputs = delay.outputs([[u]] * 5, FloatFormat(2, found.digits, "up"))[1:, 0]
    error = max(abs(exact(y).sum() - u) for y in outputs)
    assert 0.999 < error / Fraction(dict(found.tried)[found.digits] * 0.0008) <= 1


def test_a_tolerance_that_float64_does_not_hold_is_not_exceeded():
    """The bound of storing an input of 1 in t bits is 2**-t: one digit less does not meet a tolerance just below."""
    delay, within = LinearSystem([[0]], [[1]], [[1]]), limits(measurement=1)
    largest = required_precision(delay, 5, 2.0**-12, basis="guarantee", within=within)
    bound = Fraction(dict(largest.tried)[largest.digits]) / 2**12
    for tolerance, more in ((bound, 0), (bound - Fraction(1, 10**30), 1)):
        asked = required_precision(delay, 5, tolerance, basis="guarantee", within=within)
        assert asked.digits == largest.digits + more


# -- stability -------------------------------------------------------------------------------------------------------


def companion(roots):
    """Return a companion matrix with the given eigenvalues, exact."""
    p = [Fraction(1)]
    for root in roots:
        p = [a - Fraction(root) * b for a, b in zip([*p, 0], [0, *p], strict=True)]
    A = np.full((len(roots), len(roots)), Fraction(0), dtype=object)
    A[0] = [-each for each in p[1:]]
    for i in range(1, len(roots)):
        A[i, i - 1] = Fraction(1)
    return A


@pytest.mark.parametrize(
    ("roots", "stable"),
    [
        ((0, 0, 0), True),
        (("1/2", "-1/2", "1/3"), True),
        ((1,), False),
        ((-1, "1/2"), False),
        (("1/2", "3/2"), False),
        ((Fraction(2**60 - 1, 2**60), "-99/100", "1/2", 0), True),
        ((Fraction(2**60 + 1, 2**60), "-99/100", "1/2", 0), False),
        ((2, "1/2"), False),  # a root and its inverse: the first and the last coefficient are equal
    ],
)
def test_stability_is_decided_exactly(roots, stable):
    assert is_stable(companion(roots)) == stable
