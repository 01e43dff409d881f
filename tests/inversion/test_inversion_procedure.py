"""inversion.procedure: the boxes of Figure III-1, digit for digit and against their formulas written out."""

from __future__ import annotations

from fractions import Fraction

import numpy as np
import pytest

from gpbnb.arithmetic.formats import FloatFormat
from gpbnb.arithmetic.rounding import Rounding
from gpbnb.report.inversion import procedure
from gpbnb.report.inversion.procedure import Reading
from tests import oracles

FORMATS = [FloatFormat(b, t, r) for b, t in ((2, 8), (3, 5), (10, 4), (16, 3)) for r in Rounding.documented()]
each_format = pytest.mark.parametrize("fmt", FORMATS, ids=str)
each_pivoting = pytest.mark.parametrize("pivot", [False, True], ids=["in order", "pivoting"])
EXAMPLE = [["3.235", "-1.234", "3.256"], ["1.023", "-5.235", "0.921"], ["1.336", "2.120", "-8.235"]]
FOUR = FloatFormat(10, 4)


def evaluated(a, pivot=False, reading=None):
    """The exact bound of one reading."""
    reduction = procedure.as_fractions(procedure.reduce(a, pivot))
    return next(procedure.evaluate_all(reduction, a.format.unit_roundoff, (reading or Reading(),)))


def samples(fmt, sizes=(1, 2, 3, 5)):
    rng = np.random.default_rng([fmt.base, fmt.precision])
    for n in sizes:
        yield fmt.array(rng.normal(size=(n, n)))


@each_format
@each_pivoting
def test_the_computation_is_that_of_the_slow_loops(fmt, pivot):
    slow = oracles.Numbers.of(fmt)
    for a in samples(fmt):
        n = len(a)
        identity = [[Fraction(int(i == j)) for j in range(n)] for i in range(n)]
        _, upper, right, order = slow.eliminate(a.to_fractions().tolist(), identity, pivot)
        stages, rights, solution = procedure.reduce(a, pivot)
        assert stages[0].to_fractions().tolist() == a.to_fractions()[order].tolist()
        assert stages[-1].to_fractions().tolist() == upper
        assert rights[-1].to_fractions().tolist() == right
        assert solution.to_fractions().tolist() == slow.inv(a.to_fractions().tolist(), pivot)
        assert len(stages) == len(rights) == n


def test_float64_is_near_the_exact_value():
    for reading in list(procedure.readings()):
        for a in samples(FloatFormat(2, 24), (1, 2, 4)):
            floats, beta = procedure.as_floats(procedure.reduce(a, pivot=True)), float(a.format.unit_roundoff)
            exact = float(evaluated(a, True, reading).bound)
            quick = float(next(procedure.evaluate_all(floats, beta, [reading])).bound)
            # Some hundred operations on numbers that cancel by less than a thousand: 1e5 units of 1e-16.
            assert quick == pytest.approx(exact, rel=1e-11, abs=0)
