"""inversion.procedure: the boxes of Figure III-1, digit for digit and against their formulas written out."""

from __future__ import annotations

from fractions import Fraction

import numpy as np
import oracles
import pytest

from gpbnb.arithmetic import linalg
from gpbnb.arithmetic.formats import FloatFormat
from gpbnb.arithmetic.rounding import Rounding
from gpbnb.report.inversion import procedure, theory
from gpbnb.report.inversion.procedure import FORMS, NORMS, Reading

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
    slow = oracles.Arithmetic(fmt.base, fmt.precision, fmt.rounding is Rounding.NEAREST)
    for a in samples(fmt):
        n = len(a)
        identity = [[Fraction(int(i == j)) for j in range(n)] for i in range(n)]
        _, upper, right, order = slow.eliminate(a.to_fractions().tolist(), identity, pivot)
        triangular = procedure.triangularize(a, pivot)
        rights = procedure.transform(triangular, fmt.array(np.eye(n, dtype=int)))
        assert triangular.order.tolist() == order
        assert triangular.upper.to_fractions().tolist() == upper
        assert rights[-1].to_fractions().tolist() == right
        solution = procedure.substitute(triangular.upper, rights[-1])
        assert solution.to_fractions().tolist() == slow.inv(a.to_fractions().tolist(), pivot)
        assert len(triangular.stages) == len(rights) == n


@each_pivoting
def test_each_stage_comes_from_the_one_before(pivot):
    fl = oracles.Arithmetic(10, 4, True).fl
    for a in samples(FOUR, (3, 5)):
        stages, rights, _ = procedure.reduce(a, pivot)
        n = len(a)
        for k in range(n - 1):
            old, new = stages[k].to_fractions(), stages[k + 1].to_fractions()
            b_old, b_new = rights[k].to_fractions(), rights[k + 1].to_fractions()
            assert (new[: k + 1] == old[: k + 1]).all()
            for i in range(k + 1, n):
                m = -fl(old[i, k] / old[k, k])
                assert (new[i, :k] == 0).all()
                assert new[i, k] == 0
                assert (
                    new[i, k + 1 :].tolist()
                    == [fl(p + fl(m * q)) for p, q in zip(old[i], old[k], strict=True)][k + 1 :]
                )
                assert b_new[i].tolist() == [fl(p + fl(m * q)) for p, q in zip(b_old[i], b_old[k], strict=True)]
        if pivot:
            assert stages[0].to_fractions().tolist() != a.to_fractions().tolist()


def by_hand(reduction, beta, signed):
    """Everything for n = 3, entry by entry, from (47)-(54), (81), (82), (91), (92) and (95)."""
    stages = [part.to_fractions() for part in reduction.stages]
    rights = [part.to_fractions() for part in reduction.rights]
    x = reduction.solution.to_fractions()
    size = (lambda v: v) if signed else abs
    minus = -1 if signed else 1
    upper, right = stages[2], rights[2]
    matrix, sides = np.zeros((3, 3), dtype=object), np.zeros((3, 3), dtype=object)
    for i in (1, 2):
        for j in (1, 2):
            matrix[i, j] += beta * (3 * size(stages[1][i, j]) + minus * 2 * size(stages[0][i, j]))
        for j in range(3):
            sides[i, j] += beta * (3 * size(rights[1][i, j]) + minus * 2 * size(rights[0][i, j]))
    matrix[2, 2] += beta * (3 * size(stages[2][2, 2]) + minus * 2 * size(stages[1][2, 2]))
    for j in range(3):
        sides[2, j] += beta * (3 * size(rights[2][2, j]) + minus * 2 * size(rights[1][2, j]))
    matrix[0, 1] += 4 * beta * size(upper[0, 1])
    matrix[0, 2] += 3 * beta * size(upper[0, 2])
    matrix[1, 2] += 3 * beta * size(upper[1, 2])
    for j in range(3):
        for i, count in enumerate((3, 2, 1)):
            sides[i, j] += count * beta * size(right[i, j])
    e = sides + minus * (matrix @ (x if signed else abs(x)))
    return matrix, sides, e, upper, x


def column_sum(a):
    return max(sum(abs(a[i, j]) for i in range(len(a))) for j in range(len(a)))


def back_substituted(upper):
    """The inverse of a triangular matrix of three rows, in formulas."""
    (a, b, c), (_, d, e), (_, _, f) = upper
    return np.array([[1 / a, -b / (a * d), (b * e - c * d) / (a * d * f)], [0, 1 / d, -e / (d * f)], [0, 0, 1 / f]])


@pytest.mark.parametrize("rounding", Rounding.documented())
@pytest.mark.parametrize("signed", [True, False])
def test_the_errors_for_three_rows_written_out(signed, rounding):
    fmt = FloatFormat(10, 4, rounding)
    a = fmt.array(EXAMPLE)
    reduction, beta = procedure.reduce(a), fmt.unit_roundoff
    matrix, sides, e, upper, x = by_hand(reduction, beta, signed)
    change = theory.perturbation(procedure.as_fractions(reduction), beta, signed)
    assert (change.matrix == matrix).all()
    assert (change.right == sides).all()
    fronts = {False: x, True: back_substituted(upper)}
    for triangular, front in fronts.items():
        chart = evaluated(a, reading=Reading(signed, "chart", triangular))
        assert chart.bound == column_sum(front @ e if signed else abs(front) @ e)
        assert chart.relative_bound == chart.bound / column_sum(x)
        assert isinstance(chart.bound, Fraction)
        product = evaluated(a, reading=Reading(signed, "(96)", triangular))
        assert product.bound == column_sum(front) * column_sum(e)
    assert evaluated(a).reading == Reading(True, "chart", False, "column sum")


def test_norms_throughout_for_three_rows_written_out():
    a, beta = FOUR.array(EXAMPLE), FOUR.unit_roundoff
    reduction = procedure.reduce(a)
    stages = [part.to_fractions() for part in reduction.stages]
    rights = [part.to_fractions() for part in reduction.rights]
    x, upper = reduction.solution.to_fractions(), stages[2]

    def lower_right(m, k, columns=True):
        block = m.copy()
        block[:k] = 0
        if columns:
            block[:, :k] = 0
        return column_sum(block)

    steps = [(3, 1, 1), (2, 0, 1), (3, 2, 2), (2, 1, 2)]
    first = sum(w * lower_right(stages[i], k) for w, i, k in steps)
    second = max(4 * abs(upper[0, 1]), 3 * (abs(upper[0, 2]) + abs(upper[1, 2])))
    right = sum(w * lower_right(rights[i], k, False) for w, i, k in steps)
    last = column_sum(np.diag([3, 2, 1]) @ rights[2])
    expected = beta * column_sum(x) * ((first + second) * column_sum(x) + right + last)
    assert evaluated(a, reading=Reading(False, "norms throughout")).bound == expected


@pytest.mark.parametrize("reading", list(procedure.readings()), ids=str)
def test_float64_is_near_the_exact_value(reading):
    for a in samples(FloatFormat(2, 24), (1, 2, 4)):
        floats, beta = procedure.as_floats(procedure.reduce(a, pivot=True)), float(a.format.unit_roundoff)
        exact = float(evaluated(a, True, reading).bound)
        quick = float(next(procedure.evaluate_all(floats, beta, [reading])).bound)
        # Some hundred operations on numbers that cancel by less than a thousand: 1e5 units of 1e-16.
        assert quick == pytest.approx(exact, rel=1e-11, abs=0)


def test_there_are_fifty_readings():
    names = [str(reading) for reading in procedure.readings()]
    assert len(names) == len(set(names)) == 2 * 2 * 2 * 5 + 2 * 5
    assert names[0] == "signed, chart, A"
    assert str(Reading(False, "(96)", True, "row sum")) == "sizes, (96), A_T, row sum"


def test_norms():
    a = np.array([[3.0, -4.0], [0.0, 1.0]])
    assert {name: float(norm(a)) for name, norm in NORMS.items()} == {
        "column sum": 5.0,
        "row sum": 7.0,
        "largest entry": 4.0,
        "Frobenius": pytest.approx(26**0.5),
        "spectral": pytest.approx(np.linalg.svd(a)[1][0]),
    }


class TestInvariance:
    def test_rows_in_another_order_with_pivoting(self):
        rng = np.random.default_rng(6)
        for a in samples(FOUR, (3, 5)):
            shuffled = a[rng.permutation(len(a))]
            for reading in (Reading(), Reading(False, "(96)", True)):
                assert evaluated(a, True, reading).bound == evaluated(shuffled, True, reading).bound

    def test_powers_of_the_base(self):
        a = FOUR.array(EXAMPLE)
        for form in FORMS:
            reading = Reading(False, form)
            scaled = evaluated(FOUR.array(a.to_fractions() * 1000), reading=reading)
            assert scaled.bound == evaluated(a, reading=reading).bound / 1000
            assert scaled.relative_bound == evaluated(a, reading=reading).relative_bound

    def test_bounds_are_in_proportion_to_the_unit_error(self):
        reduction = procedure.as_fractions(procedure.reduce(FOUR.array(EXAMPLE)))
        readings = [reading for reading in procedure.readings() if reading.norm == "column sum"]
        betas = Fraction(1, 1000), Fraction(1, 10)
        small, large = (procedure.evaluate_all(reduction, beta, readings) for beta in betas)
        assert all(b.bound == 100 * a.bound for a, b in zip(small, large, strict=True))


def test_a_single_number():
    # Nothing to eliminate: only the division by a and the error of b, delta b = beta: 1/a * beta.
    three = FOUR.array([["3"]])
    assert procedure.reduce(three).solution.to_fractions().item() == Fraction(3333, 10000)
    assert evaluated(three).bound == Fraction(3333, 10000) * FOUR.unit_roundoff


class TestRefused:
    def test_readings(self):
        with pytest.raises(ValueError, match=r"form: got 'norm'; needed one of chart, \(96\), norms throughout"):
            Reading(form="norm")
        with pytest.raises(ValueError, match="norm: got 'max'; needed one of column sum"):
            Reading(norm="max")

    def test_matrices(self):
        with pytest.raises(TypeError, match="needed a FloatArray"):
            procedure.reduce([[1, 2], [3, 4]])
        with pytest.raises(ValueError, match="needed a square matrix"):
            evaluated(FOUR.array([[1, 2]]))
        with pytest.raises(np.linalg.LinAlgError, match="zero pivot"):
            evaluated(FOUR.array([[0, 1], [1, 0]]))
        assert evaluated(FOUR.array([[0, 1], [1, 0]]), pivot=True).bound > 0


def test_the_inverse_is_that_of_linalg():
    for a in samples(FOUR):
        assert np.array_equal(procedure.reduce(a, True).solution, linalg.inv(a, True))
