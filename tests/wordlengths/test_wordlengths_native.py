"""gpbnb.report.wordlengths.study: the emulation against numbers of other types, computed one by one."""

from __future__ import annotations

import math
import operator
from decimal import ROUND_DOWN, ROUND_HALF_UP, Context, Decimal, localcontext
from fractions import Fraction

import numpy as np
import pytest
from small_filter import run

from gpbnb.arithmetic.algebra import Algebra
from gpbnb.arithmetic.formats import FloatFormat
from gpbnb.arithmetic.rounding import Rounding
from gpbnb.filters.forms import Form
from gpbnb.filters.kalman_step import StepModel, kalman_step
from gpbnb.filters.model import LinearModel
from gpbnb.filters.run import reference
from gpbnb.report.wordlengths import study
from gpbnb.wordlength import examples

TILT = examples.tilt()
Z = examples.tilt_measurements(300)


class Single:
    """NumPy's float32 with ties away from zero, as in the documents; `moved` counts the results that this changed."""

    moved = 0
    away = True

    def __init__(self, value):
        self.value = np.float32(value)

    def rounded(self, other, operation):
        if isinstance(other, np.ndarray):
            return NotImplemented
        a, b = self.value, other.value if isinstance(other, Single) else np.float32(other)
        result = operation(a, b)
        assert result.dtype == np.float32
        exact = operation(Fraction(float(a)), Fraction(float(b)))
        beyond = np.nextafter(result, np.float32(math.copysign(math.inf, exact)))
        if self.away and Fraction(float(result)) + Fraction(float(beyond)) == 2 * exact:  # a tie, rounded towards zero
            Single.moved += 1
            result = beyond
        return type(self)(result)

    def __add__(self, other):
        return self.rounded(other, operator.add)

    def __sub__(self, other):
        return self.rounded(other, operator.sub)

    def __rsub__(self, other):
        return type(self)(other) - self

    def __mul__(self, other):
        return self.rounded(other, operator.mul)

    def __rmul__(self, other):
        return type(self)(other) * self

    def __truediv__(self, other):
        return self.rounded(other, operator.truediv)

    def __rtruediv__(self, other):
        return type(self)(other) / self


class Even(Single):
    """NumPy's float32."""

    away = False


def innovation_form(given, z):
    """Estimates (steps, n) of the innovation form, in the number type of the matrices by letter and of z (steps, m)."""
    x, P, estimates = given["x0"][:, np.newaxis], given["P0"], np.empty((len(z), len(given["x0"])), z.dtype)
    algebra = Algebra(lambda n: np.eye(n, dtype=P.dtype))
    for k, measured in enumerate(z):
        model = StepModel(*(given[letter][k % len(given[letter])] for letter in ("Phi", "H", "Q", "R")))
        x, _, P = kalman_step(algebra, Form.INNOVATION, model, x, P, measured[:, np.newaxis])
        estimates[k] = x[:, 0]
    return estimates


def native(model, z, dtype):
    """The innovation form in a NumPy type, with ties to even and the limited range of a processor."""
    with np.errstate(all="ignore"):
        given = {letter: values.astype(dtype) for letter, values in model.to_float().items()}
        return innovation_form(given, np.asarray(z, dtype=np.float64).astype(dtype)).astype(np.float64)


def in_numbers(model, number):
    """What :func:`innovation_form` is given, in numbers of another kind."""
    letters = ("Phi", "H", "Q", "R", "x0", "P0")
    return {letter: np.frompyfunc(number, 1, 1)(getattr(model, letter)) for letter in letters}


def emulated(model, z, fmt, form=Form.INNOVATION):
    return run(fmt, form, model, z).checkpoints().x


def test_the_emulation_is_the_processors_float32_but_for_ties(monkeypatch):
    """Digit for digit, operation by operation; and with ties to even as well, until the first tie."""
    monkeypatch.setattr(Single, "moved", 0)
    fmt, z = FloatFormat(2, 24), Z[:100]
    stored = TILT.rounded(fmt)
    ours = emulated(stored, z, fmt)
    plain = native(stored, z, np.float32)
    given = in_numbers(stored, lambda entry: Single(float(entry)))
    first = innovation_form(given, np.frompyfunc(Single, 1, 1)(z[:1]))
    assert Single.moved == 0  # no tie in the first step
    assert [float(x.value) for x in first[0]] == plain[0].tolist()
    assert list(map(Fraction, plain[0].tolist())) == ours[0].tolist()
    found = innovation_form(given, np.frompyfunc(Single, 1, 1)(z))
    assert [[Fraction(float(x.value)) for x in row] for row in found] == ours.tolist()
    assert Single.moved > 100
    assert (plain[1:] != ours[1:].astype(float)).any()


@pytest.mark.parametrize("m", [2, 3])
def test_arrays_of_a_type_are_computed_as_its_numbers_one_by_one(m):
    rng = np.random.default_rng(3)
    dense = LinearModel(
        rng.standard_normal((3, 3)) / 3, rng.standard_normal((m, 3)), np.eye(3), 2 * np.eye(m), [1, 2, 3], np.eye(3)
    )
    z = rng.standard_normal((40, m))
    found = innovation_form(in_numbers(dense, lambda entry: Even(float(entry))), np.frompyfunc(Even, 1, 1)(z))
    assert [[float(x.value) for x in row] for row in found] == native(dense, z, np.float32).tolist()


def test_a_type_of_numpy_has_a_range_and_the_errors_of_its_digits():
    true = reference(TILT, Z, range(1, 301)).x.astype(float)
    single, double = (np.abs(native(TILT, Z, each) - true).max(axis=0) for each in (np.float32, np.float64))
    assert (double < 1e-12).all()
    assert ((single > 1e-8) & (single < 1e-4)).all()
    # A variance of 4e2 and 1e6 units, squared, is beyond binary16: 65504.
    assert not np.isfinite(native(study.rescaled(TILT, (1, 1000, 1)), Z, np.float16)).all()
    assert np.isfinite(native(study.rescaled(TILT, (1, 1000, 1)), Z, np.float32)).all()


@pytest.mark.parametrize(
    ("rounding", "name"), [(Rounding.NEAREST, ROUND_HALF_UP), (Rounding.CHOP, ROUND_DOWN)], ids=["nearest", "chop"]
)
def test_the_emulation_is_that_of_decimal(rounding, name):
    fmt, z = FloatFormat(10, 8, rounding), np.round(Z[:100], 4)
    stored = TILT.rounded(fmt)
    measured = fmt.array([[repr(each) for each in row] for row in z.tolist()])

    def number(entry):
        return Decimal(entry.numerator) / Decimal(entry.denominator)

    with localcontext(Context(prec=8, rounding=name)):
        found = innovation_form(in_numbers(stored, number), np.frompyfunc(number, 1, 1)(measured.to_fractions()))
    assert [list(map(Fraction, row)) for row in found] == emulated(stored, measured, fmt).tolist()
