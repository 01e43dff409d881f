"""gpbnb.bounds.inverse: the fewest digits in which an inverse is within a tolerance."""

from __future__ import annotations

from fractions import Fraction

import numpy as np
import pytest

from gpbnb.arithmetic import linalg
from gpbnb.arithmetic.formats import FloatFormat
from gpbnb.arithmetic.kernels import backends
from gpbnb.arithmetic.rational import true_inverse
from gpbnb.arithmetic.rounding import Rounding
from gpbnb.bounds import inverse as bounds

NEAREST, CHOP = Rounding.NEAREST, Rounding.CHOP


@pytest.fixture(autouse=True)
def _without_loops(monkeypatch):
    """Answers are the same with loops, which take seconds to compile."""
    monkeypatch.setattr(backends, "LOOPS_AFTER", 10**9)


def fractions_of(matrix):
    return np.array([[Fraction(int(v.p), int(v.q)) for v in row] for row in matrix.tolist()], dtype=object)


def column_sum(a):
    return max(abs(a).sum(axis=0))


class TestSmallestPrecision:
    HILBERT = np.array([[Fraction(1, i + j + 1) for j in range(5)] for i in range(5)], dtype=object)

    @pytest.mark.parametrize(("tolerance", "base", "rounding"), [(0.5, 10, NEAREST), (1e-9, 2, CHOP)])
    @pytest.mark.parametrize("name", ["hilbert", "far from its origin", "in unequal units"])
    def test_it_is_the_first_of_all_precisions_that_meets_the_tolerance_with_the_next(
        self, name, tolerance, base, rounding
    ):
        times = range(100, 111)  # a quadratic fit: its condition number is 2e14, and 4e7 when the units are changed
        fit = [[sum(Fraction(t) ** (i + j) for t in times) for j in range(3)] for i in range(3)]
        unequal = [[Fraction(2), Fraction(1, 2**40)], [Fraction(1, 2**40), Fraction(3, 2**80)]]
        matrix = {"hilbert": self.HILBERT, "far from its origin": np.array(fit), "in unequal units": np.array(unequal)}
        given = matrix[name]
        found = bounds.smallest_precision(given, tolerance, base, rounding)
        inverse = fractions_of(true_inverse(given))
        errors = {}
        for precision in range(1, found.fmt.precision + 2):
            try:
                x = linalg.inv(FloatFormat(base, precision, rounding).array(given), pivot=True)
            except np.linalg.LinAlgError:
                continue
            errors[precision] = column_sum(x.to_fractions() - inverse) / column_sum(inverse)
        meets = [t for t, error in errors.items() if error <= Fraction(tolerance)]
        first = next(t for t in meets if t + 1 in meets)
        assert found.fmt == FloatFormat(base, first, rounding)
        assert errors[first] <= Fraction(found.error) <= errors[first] * (1 + Fraction(1, 2**52))
