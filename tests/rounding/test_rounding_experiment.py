"""gpbnb.report.rounding.experiment: what is computed, beside what oracles compute, and beside its bounds."""

from __future__ import annotations

import math
from fractions import Fraction

import numpy as np
import pytest

from gpbnb.arithmetic.bounds import gamma_probabilistic
from gpbnb.arithmetic.formats import FloatFormat
from gpbnb.arithmetic.rounding import Rounding
from gpbnb.report.rounding import experiment
from tests import oracles

NEAREST, CHOP = Rounding.NEAREST, Rounding.CHOP
FOUR = FloatFormat(10, 4)
SORTS = ("sum", "product", "dot", "matrix sum", "chain", "example")


def arithmetic(fmt: FloatFormat) -> oracles.Numbers:
    return oracles.Numbers.of(fmt)


def survey(sort):
    return experiment.survey(sort, repeats=2, seed=7)


# -- a trial is what it says ----------------------------------------------------------------------


def recomputed(sort, trial):
    """Computed and true value of a trial, by the oracles; matrices as lists."""
    fl = arithmetic(trial.fmt)
    inputs = [x.to_fractions().tolist() for x in trial.inputs]
    match sort:
        case "sum":
            return fl.total(inputs[0]), sum(inputs[0])
        case "product":
            value = Fraction(1)
            for x in inputs[0]:
                value = fl.r(value * x)
            for y in inputs[1]:
                value = fl.r(value / y)
            return value, math.prod(inputs[0]) / Fraction(math.prod(inputs[1]))
        case "dot":
            return fl.dot(*inputs), sum(a * b for a, b in zip(*inputs, strict=True))
        case "matrix sum":
            a, b = inputs
            true = [[p + q for p, q in zip(*rows, strict=True)] for rows in zip(a, b, strict=True)]
            return [[fl.r(x) for x in row] for row in true], true
        case _:
            value, true = inputs[0], np.array(inputs[0], dtype=object)
            for matrix in inputs[1 : None if sort == "chain" else 3]:
                value, true = fl.times(value, matrix), true @ np.array(matrix, dtype=object)
            if sort == "example":
                pairs = [zip(*rows, strict=True) for rows in zip(value, inputs[3], strict=True)]
                value = [[fl.r(p + q) for p, q in row] for row in pairs]
                true = true + np.array(inputs[3], dtype=object)
            return value, true.tolist()


@pytest.mark.parametrize("sort", SORTS)
def test_trials_are_what_the_oracles_compute(sort):
    for trial in survey(sort)[::5]:
        value, true = recomputed(sort, trial)
        found, exact = trial.computed.to_fractions(), trial.true
        if isinstance(value, list):
            assert found.tolist() == value
            assert exact.tolist() == true
            difference = np.array(value, dtype=object) - np.array(true, dtype=object)
            assert trial.error == max(abs(difference).sum(axis=0))
        else:
            assert found == value
            assert exact == true
            assert trial.error == (abs(value / true - 1) if sort == "product" else abs(value - true))


# -- sweeps: which bounds hold --------------------------------------------------------------------

#: Bound, and a floor of the largest error over bound in the sweep, so that nothing holds vacuously.
HOLD = {
    "sum": {"1984 (18)": 0.6, "1984 (18), coarse": 0.6, "weights": 0.6, "strict": 0.6},
    "product": {"1982 (20)": 0.6, "1984 (20)": 0.3, "strict": 0.6},
    "dot": {"(26)": 0.6, "strict": 0.5},
    "matrix sum": {"(24)": 0.8},
    "chain": {"(32)": 0.5, "strict": 0.5},
    "example": {"corrected": 0.5, "strict": 0.5},
}
FAIL = {"sum": {"1982 (18)"}, "chain": {"(31)"}, "example": {"Examples"}}


@pytest.mark.parametrize("sort", SORTS)
def test_bounds_in_a_sweep(sort):
    trials = survey(sort)
    found = {each.bound: each for each in experiment.bound_statistics(trials)}
    assert found.keys() == HOLD[sort].keys() | FAIL.get(sort, set())
    for bound, floor in HOLD[sort].items():
        assert found[bound].violations == 0
        assert floor < found[bound].largest <= 1
        assert all(trial.error <= trial.bounds[bound] for trial in trials if bound in trial.bounds)
        if bound != "strict":
            assert found[bound].trials == len(trials)
    for bound in FAIL.get(sort, ()):
        assert found[bound].violations > 0
        assert found[bound].largest > 1
        assert found[bound].worst.violates(bound)


# -- the law of the square root -------------------------------------------------------------------


@pytest.mark.parametrize("kind", [*experiment.KINDS, "constant"])
@pytest.mark.parametrize("rule", Rounding.documented())
def test_errors_are_those_of_each_sum(kind, rule):
    fmt, n = FloatFormat(10, 3, rule), 7
    found = experiment.sum_errors(fmt, kind, n, 5, np.random.default_rng(6))
    rng = np.random.default_rng(6)
    if kind == "constant":
        x = np.repeat(experiment.random_numbers(rng, fmt, (5, 1), "like signs").to_fractions(), n, axis=1)
    else:
        x = experiment.random_numbers(rng, fmt, (5, n), kind).to_fractions()
    for terms, error in zip(x.tolist(), found, strict=True):
        exact = arithmetic(fmt).total(terms) - sum(terms)
        assert error == float(exact / (sum(map(abs, terms)) * fmt.unit_roundoff))
    assert (abs(found) <= n - 1).all()


def test_the_root_n_law_holds_where_its_assumptions_do_and_fails_where_not():
    def beyond(kind, rule):
        fmt = FloatFormat(2, 11, rule)
        law = gamma_probabilistic(999, fmt.unit_roundoff, 1e-5) / float(fmt.unit_roundoff)
        return np.mean(abs(experiment.sum_errors(fmt, kind, 1000, 40, np.random.default_rng(2))) > law)

    assert beyond("like signs", NEAREST) == beyond("mixed signs", NEAREST) == 0
    assert beyond("constant", NEAREST) > 0.05  # five times what the law grants
    assert beyond("like signs", CHOP) > 0.1


# -- counterexamples ------------------------------------------------------------------------------


def test_three_numbers_exceed_18_of_1982():
    trial = experiment.sum_trial(FloatFormat(10, 2).array(["5.6", "5.9", "-11"]))
    assert trial.computed.to_fractions() == 1
    assert trial.true == Fraction(1, 2)
    assert trial.bounds["1982 (18)"] == Fraction(1, 20)
    assert trial.ratio("1982 (18)") == 10
    assert not trial.violates("1984 (18)")


EVEN = [FloatFormat(*each) for each in ((2, 1), (2, 2), (2, 3), (2, 11), (10, 1), (10, 2), (10, 8), (16, 1), (16, 6))]


def tie_sum(fmt, terms):
    beta = fmt.unit_roundoff
    return experiment.sum_trial(fmt.array([1, beta, *[-beta] * (terms - 2)]))


@pytest.mark.parametrize("fmt", EVEN)
def test_ties_exceed_18_of_1984_by_the_closed_form(fmt):
    beta = fmt.unit_roundoff
    for n in (2, 3, 4, 5, 6, 7, 9, 20, 60):
        trial = tie_sum(fmt, n)
        assert trial.computed.to_fractions() == 1 + 2 * beta
        assert trial.error == (n - 1) * beta
        ratio = trial.error / trial.bounds["1984 (18)"]
        if (n - 3) * beta <= 1:
            assert ratio == 2 / (2 - (n - 4) * beta)
        assert trial.violates("1984 (18)") == (n >= 5 and (3 * n - 8) * beta < 4)
        assert not trial.violates("weights")
        if "strict" in trial.bounds:
            assert not trial.violates("strict")
    assert tie_sum(fmt, 5).violates("1984 (18)")
    assert tie_sum(fmt, 4).bounds["1984 (18)"] == 3 * beta  # just reached


@pytest.mark.parametrize(
    "fmt", [FloatFormat(b, t, r) for b, t in ((2, 6), (3, 4), (10, 4), (16, 3)) for r in Rounding.documented()]
)
def test_a_product_that_cancels_exceeds_31_by_the_base_to_the_digits(fmt):
    unit = Fraction(1, fmt.base ** (fmt.precision - 1))
    row, column = fmt.array([[1 + unit, -(1 + 2 * unit)]]), fmt.array([[1 + unit], [1]])
    trial = experiment.chain_trial([row, column])
    assert trial.computed.to_fractions().tolist() == [[0]]
    assert trial.error == unit**2
    assert trial.error / trial.bounds["(31)"] == 1 / (2 * fmt.unit_roundoff)
    assert not trial.violates("(32)")


def test_twenty_factors_exceed_both_bounds_of_products_and_twelve_products_exceed_26():
    """A search found them; the strict bounds hold."""
    two, three = FloatFormat(10, 2), FloatFormat(2, 3)
    product = experiment.product_trial(two.array([14, 75, *[96] * 18]), two.array([]))
    assert [product.violates(name) for name in ("1982 (20)", "1984 (20)", "strict")] == [True, True, False]
    a = three.array([10, 12, "2.5", "2.5", 10, 5, 5, 5, 10, 10, 10, 40])
    dot = experiment.dot_trial(a, three.array([6] * 12))
    assert (dot.computed.to_fractions(), dot.true) == (1280, 732)
    assert dot.violates("(26)")
    assert dot.error <= 12 * three.unit_roundoff * dot.true
