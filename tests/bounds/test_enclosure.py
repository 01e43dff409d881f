"""Gains that never repeat: the step against the compiled filter, its error bounds, and limits that no run leaves."""

from __future__ import annotations

from fractions import Fraction

import numpy as np
import pytest
from flint import arb

from gpbnb.arithmetic.algebra import Algebra
from gpbnb.arithmetic.formats import FloatFormat
from gpbnb.arithmetic.rational import exact
from gpbnb.arithmetic.rounding import Rounding
from gpbnb.bounds.enclosure import FORMS, Enclosed, enclose
from gpbnb.bounds.envelope import FilterLimits
from gpbnb.bounds.guarantee import Guarantee, guarantee, limits
from gpbnb.filters.forms import Form
from gpbnb.filters.kalman_step import StepModel, gain, predicted, updated
from gpbnb.filters.model import LinearModel
from gpbnb.filters.run import Run, reference_states
from gpbnb.report.guarantees import derivation
from gpbnb.report.kalman.exact_step import exact_step
from gpbnb.wordlength.examples import cyclic

FORMATS = [FloatFormat(2, 12), FloatFormat(2, 24, Rounding.CHOP), FloatFormat(10, 5)]


class Rounded:
    """A number whose operations are rounded, slow and obvious."""

    def __init__(self, value: Fraction, fmt: FloatFormat) -> None:
        self.value, self.fmt = value, fmt

    def _made(self, value: Fraction) -> Rounded:
        return Rounded(self.fmt.round(value), self.fmt)

    def __add__(self, other: Rounded) -> Rounded:
        return self._made(self.value + other.value)

    def __sub__(self, other: Rounded) -> Rounded:
        return self._made(self.value - other.value)

    def __mul__(self, other: Rounded) -> Rounded:
        return self._made(self.value * other.value)

    def __truediv__(self, other: Rounded) -> Rounded:
        return self._made(self.value / other.value)


def two_measurements() -> LinearModel:
    """Three states in a cycle of two measurement matrices, with correlated noise."""
    rng = np.random.default_rng(4)
    H = [exact(np.round(rng.standard_normal((2, 3)) * 64) / 64) for _ in range(2)]
    return LinearModel(
        Phi=exact([["0.9", "0.25", "0"], ["-0.25", "0.875", "0.125"], ["0", "0", "0.75"]]),
        H=np.array(H),
        Q=exact([["0.5", "0.125", "0"], ["0.125", "0.25", "0"], ["0", "0", "0.125"]]),
        R=exact([["1", "0.25"], ["0.25", "2"]]),
        x0=exact(["0", "0", "0"]),
        P0=exact([["3", "0", "0"], ["0", "2", "0"], ["0", "0", "1"]]),
    )


def phase(stored: LinearModel, k: int) -> list[np.ndarray]:
    return [each[k % len(each)] for each in (stored.Phi, stored.H, stored.Q, stored.R)]


@pytest.mark.parametrize("fmt", FORMATS)
@pytest.mark.parametrize("form", FORMS)
def test_a_step_has_the_digits_of_the_compiled_filter(form: Form, fmt: FloatFormat) -> None:
    stored = two_measurements().rounded(fmt)
    run = Run(stored, fmt, form, range(1, 9))
    run.take(np.zeros((8, 2)))
    K, P = run.exactly(run.G), run.exactly(run.C)
    as_rounded = np.vectorize(lambda value: Rounded(value, fmt), otypes=[object])
    plain = np.vectorize(lambda each: each.value, otypes=[object])
    algebra = Algebra(lambda n: as_rounded(exact(np.eye(n, dtype=int))))
    for k in range(1, 8):
        model = StepModel(*map(as_rounded, phase(stored, k)))
        V = predicted(algebra, model.Phi, as_rounded(P[k - 1]), model.Q)
        computed = gain(algebra, model.H, model.R, V).K
        assert (plain(computed) == K[k]).all()
        assert (plain(updated(algebra, form, model, V, computed)) == P[k]).all()


@pytest.mark.parametrize("fmt", FORMATS)
@pytest.mark.parametrize("form", FORMS)
def test_a_step_is_as_near_to_the_exact_one_as_its_bounds_say(form: Form, fmt: FloatFormat) -> None:
    stored, unit = two_measurements().rounded(fmt), float(fmt.unit_roundoff) * (1 + 2.0**-50)
    run = Run(stored, fmt, form, range(1, 12))
    run.take(np.zeros((11, 2)))
    K, P = run.exactly(run.G), run.exactly(run.C)
    as_enclosed = np.vectorize(
        lambda value: Enclosed(arb(int(value.numerator)) / arb(int(value.denominator)), unit), otypes=[object]
    )
    errors = np.vectorize(lambda each: each.error)
    algebra, tightest = Algebra(lambda n: as_enclosed(exact(np.eye(n, dtype=int)))), 0.0
    for k in range(1, 11):
        before = (P[k - 1] + P[k - 1].T) / 2
        if (before != P[k - 1]).any():
            continue  # the oracle takes symmetric covariances
        model = StepModel(*map(as_enclosed, phase(stored, k)))
        V = predicted(algebra, model.Phi, as_enclosed(P[k - 1]), model.Q)
        computed = gain(algebra, model.H, model.R, V).K
        covariance = updated(algebra, form, model, V, computed)
        true = exact_step(*phase(stored, k), stored.x0, P[k - 1], exact(["0", "0"]))
        for found, here, bounds in ((K[k], true.gain, computed), (P[k], true.P, covariance)):
            ratio = np.abs((found - here).astype(float)) / errors(bounds)
            assert ratio.max() <= 1
            tightest = max(tightest, float(ratio.max()))
    assert tightest == 0 or tightest > 1e-2


def test_numbers_with_a_bound_divide_only_by_what_is_not_zero() -> None:
    one, near = Enclosed(arb(1), 2.0**-24), Enclosed(arb(0, 1e-3), 2.0**-24)
    with pytest.raises(ZeroDivisionError, match="may be zero"):
        one / near
    off = Enclosed(arb("0.5"), 2.0**-24, 0.5)
    with pytest.raises(ZeroDivisionError, match="may be zero"):
        one / off
    assert (one - one).error == 0
    assert (off * one) is off


@pytest.mark.parametrize("form", FORMS)
@pytest.mark.parametrize("fmt", FORMATS)
def test_no_gain_leaves_its_limits(form: Form, fmt: FloatFormat) -> None:
    stored = two_measurements().rounded(fmt)
    run = Run(stored, fmt, form, range(1, 4001))
    run.take(np.zeros((4000, 2)))
    found = enclose(stored, run, fmt, form)
    assert found is not None
    assert found.start % stored.cycle == 0
    K, P = (run.exactly(each).astype(np.float64) for each in (run.G, run.C))
    known = K[found.start - 2 : found.start]
    for k in range(found.start, 4000):
        assert (np.abs(K[k] - known[k % 2]) <= found.gain[k % 2]).all()
        assert (np.abs(P[k - 1] - found.center[k % 2]) <= found.covariance[k % 2]).all()
    # Not vacuous: the limits are a few thousand units of the last place at most, seen from the largest gain.
    assert found.gain.max() < 5000 * float(fmt.unit_roundoff) * np.abs(K).max()


def test_other_forms_and_gains_that_fall_for_ever_have_no_enclosure() -> None:
    fmt, given = FloatFormat(2, 24), two_measurements()
    stored = given.rounded(fmt)
    run = Run(stored, fmt, Form.HUNG, range(1, 301))
    run.take(np.zeros((300, 2)))
    assert enclose(stored, run, fmt, Form.HUNG) is None
    constant = LinearModel([[1]], [[1]], [[0]], [[1]], [0], [[1]])
    run = Run(constant, fmt, Form.INNOVATION, range(1, 1001))
    run.take(np.zeros((1000, 1)))
    assert enclose(constant, run, fmt, Form.INNOVATION) is None


@pytest.fixture(scope="module")
def never_repeating() -> tuple[LinearModel, FloatFormat, FilterLimits, Guarantee]:
    """Ten states, a cycle of 13."""
    given, fmt, within = cyclic(10, 2, 13, 0.8), FloatFormat(2, 24), limits(10, 2, measurement=50)
    return given, fmt, within, guarantee(given, fmt, within, most=1000)


def test_a_filter_whose_gain_never_repeats_has_a_guarantee_for_ever(never_repeating) -> None:
    """No run with random or steady inputs leaves the bound."""
    given, fmt, within, found = never_repeating
    assert found.for_ever
    assert found.schedule.repeat is None
    assert found.schedule.enclosed == 130
    assert "; the gain stays within known limits from step 130" in str(found)
    repeating = guarantee(given, fmt, within, Form.UD)
    assert repeating.schedule.enclosed is None
    # The gains may lie anywhere within their limits, which costs a factor of about forty.
    assert (found.bound < 100 * repeating.bound).all()
    stored, rng, steps = given.rounded(fmt), np.random.default_rng(11), 1500
    signs = np.sign(rng.standard_normal((steps // 50, 2)))
    for z in (rng.uniform(-50, 50, (steps, 2)), np.repeat(50 * signs, 50, axis=0)):
        measured, run = fmt.array(z), Run(stored, fmt, Form.INNOVATION, range(1, steps + 1))
        run.take(measured)
        true = reference_states(stored, measured.to_fractions()).sum(axis=-1)
        ratios = np.abs(run.exactly(run.X)[..., 0].astype(float) - true) / found.bound
        assert ratios.max() <= 1
        assert ratios.max() > 1e-3


def test_limits_of_the_coefficients_begin_with_the_enclosure(never_repeating) -> None:
    given = never_repeating[-1].schedule
    assert given.enclosed is not None
    assert given.settled
    assert given.first > given.enclosed
    assert (given.offsets[: given.enclosed] == 0).all()
    assert (given.offsets[given.enclosed :, -20:] > 0).all()
    assert (given.offsets[:, :-20] == 0).all()


def test_joseph_s_form_forgives_errors_of_the_gain() -> None:
    assert derivation.joseph().holds
