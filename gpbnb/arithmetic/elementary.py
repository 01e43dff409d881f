"""Elementary functions of arrays of a format, such as the exponential, each correctly rounded.

Float64 or Arb gives an interval that contains the exact value. It is shrunk until all numbers in it round to the same
result, so this result is correctly rounded.
"""

from __future__ import annotations

import contextlib
import math
import operator
from collections.abc import Callable, Iterable, Sequence
from fractions import Fraction
from typing import Any

import numpy as np
from flint import arb, ctx, fmpz

from gpbnb.arithmetic.exits import stays
from gpbnb.arithmetic.kernels.backends import Floats
from gpbnb.arithmetic.kernels.exact import ExactKernel, Pair
from gpbnb.arithmetic.rounding import Rounding

ELEMENTARY = (
    "exp", "expm1", "exp2", "log", "log1p", "log2", "log10", "cbrt", "sin", "cos", "tan", "arcsin", "arccos", "arctan",
    "sinh", "cosh", "tanh", "arcsinh", "arccosh", "arctanh", "deg2rad", "rad2deg",
)  # fmt: skip
"""Functions of one number that Arb allows to round correctly."""

ELEMENTARY_PAIRS = ("arctan2", "hypot", "float_power")
"""Functions of two numbers that Arb allows to round correctly."""

_EXACT: dict[str, Callable[..., Any]] = {
    "floor": math.floor,
    "ceil": math.ceil,
    "trunc": math.trunc,
    "rint": round,
    "fmod": lambda x, y: x - y * math.trunc(x / y),
    "remainder": operator.mod,
    "floor_divide": operator.floordiv,
}
"""Functions whose exact value is a Fraction."""

_WHOLE = ("floor", "ceil", "trunc", "rint")

_BY_FLOAT64 = frozenset((*ELEMENTARY, *ELEMENTARY_PAIRS, "floor", "ceil", "trunc", "rint", "fmod"))

_ENCLOSURES: dict[str, Callable[..., Any]] = {
    "arcsin": arb.asin,
    "arccos": arb.acos,
    "arctan": arb.atan,
    "arcsinh": arb.asinh,
    "arccosh": arb.acosh,
    "arctanh": arb.atanh,
    "exp2": lambda x: arb(2) ** x,
    "log2": lambda x: x.log() / arb.const_log2(),
    "log10": lambda x: x.log() / arb.const_log10(),
    "cbrt": lambda x: x.root(3) if x >= 0 else -(-x).root(3),
    "deg2rad": lambda x: x * arb.pi() / 180,
    "rad2deg": lambda x: x * 180 / arb.pi(),
    "arctan2": lambda y, x: arb.atan2(y, x),
    "hypot": lambda x, y: (x * x + y * y).sqrt(),
    "float_power": lambda x, y: x**y,
}
"""Arb's functions where it has another name."""

_MOST_BITS = 1 << 16
_LONGEST = 1 << 20  # bits of a rational power that is formed exactly; a longer one that is a tie is refused
_FARTHEST = 1 << 25  # exponent of the largest and smallest result that is written out
# A relative error that no float64 function of NumPy reaches, 16 units of the last digit or more, in both directions.
_DOUBTED = np.array([1 - 2.0**-48, 1 + 2.0**-48])
_MOST_DIGITS = 44  # bits of a format for which such an interval seldom contains a tie
_FEWEST = 2.0**-900  # sizes from here to its inverse are not rounded to fewer digits in float64


class DomainError(ValueError):
    """An argument at which a function has no finite real value."""


@stays
def elementary(name: str, *arrays: Any) -> Any:
    r"""Apply a function of :data:`ELEMENTARY` or :data:`ELEMENTARY_PAIRS` to each entry, correctly rounded.

    Functions of two numbers broadcast. The number zero has no sign: ``np.arctan2(0, x)`` is :math:`\pi` for each
    negative x, and 0 for the others. ``np.float_power(x, y)`` takes any y if x > 0, whole numbers y if x < 0, and
    y >= 0 if x = 0, with :math:`0^0 = 1`. Arguments of sine, cosine and tangent are reduced exactly, up to about
    :math:`2^{65000}` in size. A larger one is refused, and so is a result that differs from a number or tie of the
    format by less than about :math:`2^{-65000}` of its size.

    Examples
    --------
    The product of two quaternions rounds each product and each sum, here from left to right:

    >>> import numpy as np
    >>> from gpbnb import BINARY32
    >>> def times(p, q):
    ...     vector = p[0] * q[1:] + q[0] * p[1:] + np.cross(p[1:], q[1:])
    ...     return np.append(p[0] * q[0] - np.dot(p[1:], q[1:]), vector)
    >>> half = np.deg2rad(BINARY32.array(60)) / 2
    >>> q = np.append(np.cos(half), np.sin(half) * BINARY32.array([0, 0, 1]))
    >>> float(np.linalg.norm(times(q, q)))
    1.0
    """
    arrays = _broadcast(arrays)
    if arrays[0].backend.records:
        return arrays[0].called(name, *arrays)
    quick = _by_float64(name, *arrays)
    if quick is None:
        return _by_arb(name, arrays, np.ndindex(arrays[0].shape))
    result, doubtful = quick
    if not doubtful.any():
        return result
    return np.where(doubtful, _by_arb(name, arrays, map(tuple, np.argwhere(doubtful).tolist())), result)


def _broadcast(arrays: tuple[Any, ...]) -> tuple[Any, ...]:
    if len({each.shape for each in arrays}) == 1:
        return arrays
    shape = np.broadcast_shapes(*(each.shape for each in arrays))
    return tuple(each if each.shape == shape else np.broadcast_to(each, shape) for each in arrays)


def _by_float64(name: str, *arrays: Any) -> tuple[Any, Any] | None:
    """Return results by NumPy's float64, and where they are in doubt; None if the format has too many digits.

    NumPy's functions differ from the exact value by a few units of the last digit. If both ends of an interval that is
    many times wider round to the same number, so does the exact value, as rounding is monotone. Functions whose value
    float64 holds have no doubt.
    """
    fmt = arrays[0].format
    digits = fmt.precision * (fmt.base.bit_length() - 1)
    if name not in _BY_FLOAT64 or fmt.rounding is Rounding.STOCHASTIC:
        return None
    if digits > _MOST_DIGITS and name not in _EXACT:
        return None
    if not all(isinstance(x.backend, Floats) for x in arrays):
        return None
    given = [x.components[0] for x in arrays]
    if arrays[0].size == 1:
        one = _one_by_float64(name, fmt, [x.item() for x in given])
        if one is None:
            return None
        return arrays[0].from_components(fmt.backend, (np.full(given[0].shape, one),), fmt), np.False_
    with np.errstate(all="ignore"):
        y = np.asarray(getattr(np, name)(*given)) + 0.0  # no zero has a sign
        if name in _WHOLE and fmt.limits is None:  # each format has the whole numbers around its numbers
            return arrays[0].from_components(fmt.backend, (y,), fmt), np.False_
        ends, unusual = y[np.newaxis], np.zeros(y.shape, np.bool_)
        if name not in _EXACT:
            size = np.abs(y)
            unusual = ~((size >= _FEWEST) & (size <= 1 / _FEWEST))
            ends = np.multiply.outer(_DOUBTED, np.where(unusual, 1.0, y))
        found = fmt.backend.from_numbers(ends, exactly=False)
    if found is None:
        return None
    low, high = found[0][0], found[0][-1]
    return arrays[0].from_components(fmt.backend, (low,), fmt), (low != high) | unusual


def _one_by_float64(name: str, fmt: Any, given: list[float]) -> float | None:
    """Return the result for one number, or pair of numbers, as :func:`_by_float64` does; None if it is in doubt."""
    with np.errstate(all="ignore"):
        y = float(getattr(np, name)(*given)) + 0.0
    if y == 0 and name in _EXACT:
        return y
    if not _FEWEST <= abs(y) <= 1 / _FEWEST:
        return None
    if name in _WHOLE and fmt.limits is None:
        return y
    try:
        ends = (y,) if name in _EXACT else (y * _DOUBTED[0], y * _DOUBTED[1])
        (m, e), *others = {fmt.kernel.from_ratio(*float(each).as_integer_ratio()) for each in ends}
    except OverflowError:
        return None
    return None if others else math.ldexp(m, e * (fmt.base.bit_length() - 1))


def _by_arb(name: str, arrays: Any, indices: Iterable[tuple[int, ...]]) -> Any:
    """Return the correctly rounded values at some indices, and zero at the others."""
    values: Any = [np.asarray(x.to_fractions(), dtype=object) for x in arrays]
    fmt, shape = arrays[0].format, arrays[0].shape
    significands, exponents = np.zeros(shape, dtype=object), np.zeros(shape, dtype=object)
    for index in indices:
        place = f" at {list(index)}" if index else ""
        try:
            significands[index], exponents[index] = _rounded(name, [each[index] for each in values], fmt, place)
        except OverflowError as error:
            raise OverflowError(f"np.{name}{place}: {error}") from None
    return type(arrays[0]).from_pairs(significands, exponents, fmt)


def _rounded(name: str, values: Sequence[Fraction], fmt: Any, place: str) -> Pair:
    kernel: ExactKernel = fmt.kernel
    if name in _EXACT:
        return kernel.from_ratio(*Fraction(_EXACT[name](*values)).as_integer_ratio())
    enclosure, before, bits = _ENCLOSURES.get(name) or getattr(arb, name), ctx.prec, 128
    while bits < min(kernel.precision * kernel.base.bit_length(), _MOST_BITS):
        bits *= 2
    first, drawn, limits = bits, kernel.count, kernel.limits
    modulus = float(limits.largest - limits.lowest) if limits and limits.overflow == "wrap" else None

    def rounded(end: Any) -> Pair:
        kernel.count = drawn  # so that stochastic rounding compares both ends with the same random bits
        return kernel.from_ratio(*_ratio(end, kernel))

    finite = False
    try:
        while bits <= _MOST_BITS:
            ctx.prec = bits
            ball = enclosure(*(arb(value.numerator) / arb(value.denominator) for value in values))
            finite = ball.is_finite()
            if finite:
                low, high = rounded(ball.lower()), rounded(ball.upper())
                # In a format that wraps around, ends that are a whole range apart round to the same number, too.
                if low == high and (modulus is None or bool(4 * ball.rad() < modulus)):
                    return low
            # If a rational value is a tie, every ball around it contains a tie.
            if bits == first and (whole := _rational(name, values)) is not None:
                kernel.count = drawn
                return kernel.from_ratio(*whole.as_integer_ratio())
            if not finite and bits > 1024:
                break
            bits *= 2
    finally:
        ctx.prec = before
    given = f"np.{name} of {' and '.join(map(_shown, values))}"
    if finite:
        raise ValueError(f"got {given}{place}; needed an argument that is smaller, or further from a tie")
    raise DomainError(f"got {given}{place}; needed an argument for which the result is finite and real")


def _shown(value: Fraction) -> str:
    near = math.inf
    with contextlib.suppress(OverflowError):
        near = float(value)
    if math.isfinite(near) and (near or not value):
        return repr(near)
    return f"about 2**{value.numerator.bit_length() - value.denominator.bit_length()}"


def _rational(name: str, values: Sequence[Fraction]) -> Fraction | None:
    """Return a value that is rational; None where it is irrational, or none."""
    x, y = values[0], values[-1]
    if name == "arctan2":
        return Fraction(0) if not x and y >= 0 else None
    if name == "hypot":
        return _power(x * x + y * y, Fraction(1, 2))
    if name == "cbrt":
        root = _power(abs(x), Fraction(1, 3))
        return -root if root is not None and x < 0 else root
    if name == "exp2":
        return _power(Fraction(2), x)
    if name == "float_power":
        return _power(x, y)
    if name in ("log2", "log10") and x > 0:
        base = 2 if name == "log2" else 10
        long = x if x >= 1 else 1 / x
        count = round(math.log(long.numerator, base)) if long.denominator == 1 else 0
        return Fraction(count if x >= 1 else -count) if long == base**count else None
    return None


def _power(x: Fraction, y: Fraction) -> Fraction | None:
    """Return x to the power y if it is rational and not too long."""
    if not x:
        return Fraction(not y) if y >= 0 else None
    if y.denominator == 1:
        root = x
    else:
        above, below = _root(x.numerator, y.denominator), _root(x.denominator, y.denominator)
        if above is None or below is None:
            return None
        root = Fraction(above, below)
    bits = max(abs(root.numerator), root.denominator).bit_length() - 1
    return root**y.numerator if abs(y.numerator) * bits <= _LONGEST else None


def _root(whole: int, order: int) -> int | None:
    """Return the root of a whole number if it is whole."""
    if whole == 1 or whole < 1 or order > whole.bit_length():
        return 1 if whole == 1 else None
    root = int(fmpz(whole).root(order))
    return root if root**order == whole else None


def _ratio(end: Any, kernel: ExactKernel) -> tuple[int, int]:
    """Return a number of Arb as numerator and denominator; its size is limited to what the format tells apart."""
    significand, exponent = (int(part) for part in end.mid().man_exp())
    size, limits = exponent + significand.bit_length(), kernel.limits
    if significand and limits and limits.overflow != "wrap" and (size < 0 or limits.overflow != "raise"):
        digits = kernel.base.bit_length() * (abs(limits.emin) + kernel.precision)
        reach = digits + limits.largest.numerator.bit_length()
        size = max(-reach, min(reach, size))  # beyond the range, all sizes round alike
        exponent = size - significand.bit_length()
    if significand and abs(size) > _FARTHEST:
        raise OverflowError(
            f"got a result of about 2**{size}; needed one in the range of the format, between 2**-{_FARTHEST} and "
            f"2**{_FARTHEST} in size"
        )
    return (significand << exponent, 1) if exponent >= 0 else (significand, 1 << -exponent)
