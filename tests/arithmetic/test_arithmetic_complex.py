"""Complex arrays and the Fourier transform, digit for digit against loops over Fractions."""

from __future__ import annotations

import pickle
from fractions import Fraction

import gmpy2
import numpy as np
import pytest
from oracles import rounded, square_root

from gpbnb import BINARY16, BINARY32, BINARY64, ComplexArray, FixedFormat, FloatFormat, fft, required_precision

FORMATS = [FloatFormat(2, 11), FloatFormat(2, 24, "chop"), FloatFormat(10, 5), FloatFormat(16, 4, "chop")]


class Rounded:
    """Operations on pairs of Fractions, each rounded once, from the definition of each."""

    def __init__(self, fmt):
        self.fl = lambda x: rounded(Fraction(x), fmt.base, fmt.precision, fmt.rounding.value == "nearest")
        self.root = lambda x: square_root(x, fmt.base, fmt.precision, fmt.rounding.value == "nearest")

    def add(self, x, y):
        return self.fl(x[0] + y[0]), self.fl(x[1] + y[1])

    def subtract(self, x, y):
        return self.fl(x[0] - y[0]), self.fl(x[1] - y[1])

    def multiply(self, x, y):
        fl = self.fl
        real = fl(fl(x[0] * y[0]) - fl(x[1] * y[1]))
        return real, fl(fl(x[0] * y[1]) + fl(x[1] * y[0]))

    def divide(self, x, y):
        fl = self.fl
        square = fl(fl(y[0] * y[0]) + fl(y[1] * y[1]))
        real, imag = fl(fl(x[0] * y[0]) + fl(x[1] * y[1])), fl(fl(x[1] * y[0]) - fl(x[0] * y[1]))
        return fl(real / square), fl(imag / square)

    def size(self, x):
        return self.root(self.fl(self.fl(x[0] * x[0]) + self.fl(x[1] * x[1])))

    def factor(self, k, half, inverse):
        """exp(-i pi k / half) from MPFR with 400 bits, which decides the rounding of every factor here."""
        with gmpy2.context(gmpy2.get_context(), precision=400):
            angle = gmpy2.const_pi() * k / half
            exact = [Fraction(*map(int, each.as_integer_ratio())) for each in (gmpy2.cos(angle), -gmpy2.sin(angle))]
        if 2 * k == half:
            exact = [Fraction(0), Fraction(-1)]
        real, imag = map(self.fl, exact)
        return real, -imag if inverse else imag

    def transform(self, x, inverse=False):
        """The recursion of the docstring, written as a recursion."""
        if len(x) == 1:
            return x
        half = len(x) // 2
        even, odd = self.transform(x[::2], inverse), self.transform(x[1::2], inverse)
        turned = [odd[k] if k == 0 else self.multiply(odd[k], self.factor(k, half, inverse)) for k in range(half)]
        return [self.add(*pair) for pair in zip(even, turned, strict=True)] + [
            self.subtract(*pair) for pair in zip(even, turned, strict=True)
        ]


def numbers(fmt, count, seed):
    rng = np.random.default_rng(seed)
    z = ComplexArray(fmt.array(rng.normal(size=count)), fmt.array(rng.normal(size=count)))
    return z, pairs(z)


def pairs(z):
    return list(zip(z.real.to_fractions().ravel(), z.imag.to_fractions().ravel(), strict=True))


@pytest.mark.parametrize("fmt", FORMATS, ids=str)
def test_every_operation_is_rounded_as_stated(fmt):
    x, of_x = numbers(fmt, 60, 1)
    y, of_y = numbers(fmt, 60, 2)
    loops = Rounded(fmt)
    for name, found in (("add", x + y), ("subtract", x - y), ("multiply", x * y), ("divide", x / y)):
        assert pairs(found) == [getattr(loops, name)(a, b) for a, b in zip(of_x, of_y, strict=True)]
    assert abs(x).to_fractions().tolist() == [loops.size(a) for a in of_x]
    assert pairs(x.conj()) == [(a, -b) for a, b in of_x]
    assert pairs(-x) == [(-a, -b) for a, b in of_x]
    real = y.real
    assert (
        pairs(x * real)
        == pairs(real * x)
        == [(loops.fl(a * c), loops.fl(b * c)) for (a, b), (c, _) in zip(of_x, of_y, strict=True)]
    )
    assert pairs(x / real) == [(loops.fl(a / c), loops.fl(b / c)) for (a, b), (c, _) in zip(of_x, of_y, strict=True)]
    assert (
        pairs(x + real) == pairs(real + x) == [(loops.fl(a + c), b) for (a, b), (c, _) in zip(of_x, of_y, strict=True)]
    )
    assert pairs(real - x) == [(loops.fl(c - a), -b) for (a, b), (c, _) in zip(of_x, of_y, strict=True)]
    assert pairs(real / x) == [loops.divide((c, Fraction(0)), a) for a, (c, _) in zip(of_x, of_y, strict=True)]
    assert pairs(2j * x) == pairs(x * 2j) == [loops.multiply(a, (Fraction(0), Fraction(2))) for a in of_x]
    assert pairs(1 / x) == [loops.divide((Fraction(1), Fraction(0)), a) for a in of_x]


@pytest.mark.parametrize("fmt", FORMATS, ids=str)
@pytest.mark.parametrize("n", [1, 2, 4, 8, 64])
@pytest.mark.parametrize("inverse", [False, True])
def test_the_transform_is_its_recursion(fmt, n, inverse):
    x, of_x = numbers(fmt, n, n)
    loops = Rounded(fmt)
    wanted = loops.transform(of_x, inverse)
    if inverse:
        count = loops.fl(n)
        wanted = [(loops.fl(a / count), loops.fl(b / count)) for a, b in wanted]
    assert pairs(fft(x, inverse)) == wanted


def test_the_transform_is_that_of_numpy_within_its_errors():
    rng = np.random.default_rng(3)
    z = rng.normal(size=(2, 3, 256)) + 1j * rng.normal(size=(2, 3, 256))
    found = fft(ComplexArray.of(BINARY64, z))
    assert found.shape == z.shape
    # log2(256) stages of a few roundings each, of numbers of size sqrt(256)
    assert abs(found.to_complex() - np.fft.fft(z)).max() < 8 * 4 * 16 * 2.0**-53 * 5
    assert abs(fft(found, inverse=True).to_complex() - z).max() < 8 * 8 * 2.0**-53 * 5
    real = BINARY64.array(z.real[0, 0])
    assert (fft(real) == fft(ComplexArray(real))).all()


def test_the_wordlength_of_a_transform():
    """The answer keeps the tolerance in a loop over Fractions, and one bit less does not."""

    def spectrum(fmt, z):
        found = fft(z)
        return np.stack([found.real, found.imag], axis=1)

    signal = np.sin(np.arange(64) ** 2)
    bits = required_precision(spectrum, 64, 0.001, z=signal).precision

    def error(bits):
        fmt = FloatFormat(2, bits)
        found = Rounded(fmt).transform([(Rounded(fmt).fl(each), Fraction(0)) for each in signal.tolist()])
        return max(abs(complex(*map(float, each)) - true) for each, true in zip(found, np.fft.fft(signal), strict=True))

    assert error(bits) <= 0.001 * np.sqrt(2) < 0.01
    assert error(bits - 2) > 0.001


def test_a_transform_in_fixed_point():
    """Multiples of the unit, rounded to nearest, by Python's integers; the sums need integer bits."""
    fmt = FixedFormat(5, 15)
    rng = np.random.default_rng(4)
    x = ComplexArray(*(fmt.array(rng.integers(-9000, 9000, 16) * Fraction(1, 2**15)) for _ in range(2)))

    class Fixed(Rounded):
        def __init__(self):
            self.fl = lambda v: Fraction(int(abs(v) * 2**15 + Fraction(1, 2)), 2**15) * (1 if v > 0 else -1)

    assert pairs(fft(x)) == Fixed().transform(pairs(x))
    with pytest.raises(OverflowError):
        fft(FixedFormat(0, 15).array([0.9, 0.9]))


def test_shapes_text_and_pickles():
    z = ComplexArray.of(BINARY32, [[1 + 2j, 3], ["0.5", -1j]])
    assert (z.shape, z.ndim, z.size, len(z)) == ((2, 2), 2, 4, 2)
    assert z.T[0, 1].to_complex() == 0.5
    assert z.reshape(4)[-1].to_complex() == -1j
    assert [each.to_complex().tolist() for each in z] == [[1 + 2j, 3], [0.5, -1j]]
    assert (pickle.loads(pickle.dumps(z)) == z).all()
    assert (z == z.to_complex()).all()
    assert not (z != z).any()
    assert repr(z[0]) == f"ComplexArray(['1+2i', '3+0i'], {BINARY32})"
    assert repr(z[1, 1]) == f"ComplexArray('0-1i', {BINARY32})"
    assert (ComplexArray.of(BINARY16, z).to_complex() == z.to_complex()).all()
    assert (np.array([1j, 2]) * z == z * np.array([1j, 2])).all()


@pytest.mark.parametrize(
    ("call", "error", "message"),
    [
        (
            lambda: fft(BINARY32.array([1, 2, 3])),
            ValueError,
            r"got shape \(3,\); needed a power of two along the last a",
        ),
        (lambda: fft(BINARY32.array([])), ValueError, "needed a power of two"),
        (lambda: fft(BINARY32.array(1)), ValueError, "needed a power of two"),
        (lambda: fft([1, 2]), TypeError, "got list; needed a ComplexArray or a FloatArray"),
        (lambda: ComplexArray([1]), TypeError, "real: got list; needed an array of a format"),
        (lambda: ComplexArray(BINARY32.array(1), 2), TypeError, "imag: got int; needed an array of a format"),
        (lambda: ComplexArray(BINARY32.array(1), BINARY16.array(1)), ValueError, "needed one shape and one format"),
        (lambda: ComplexArray(BINARY32.array([1]), BINARY32.array(1)), ValueError, "needed one shape and one format"),
        (lambda: ComplexArray.of(BINARY32, 1 + 0.5j) + 0.1j, ValueError, "got the operand 0.1; needed a number that"),
        (lambda: ComplexArray.of(BINARY32, 1j) / 0, ZeroDivisionError, "got a division by zero"),
        (lambda: setattr(ComplexArray.of(BINARY32, 1j), "real", 2), AttributeError, "got an assignment to real"),
    ],
)
def test_what_is_refused(call, error, message):
    with pytest.raises(error, match=message):
        call()
