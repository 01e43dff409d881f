"""NumPy's functions for arrays of a format, each with the order of its operations.

Every operation is rounded once, unless a function says that it rounds nothing. Sums run from left to right. For
elementary functions, such as the exponential, float64 or Arb gives an interval that contains the exact value. It is
shrunk until all numbers in it round to the same result, so these results are correctly rounded, too.
"""

from __future__ import annotations

import math
import operator
from collections.abc import Callable, Iterable, Sequence
from fractions import Fraction
from typing import Any

import numpy as np
from flint import arb, ctx, fmpz

from gpbnb.arithmetic.exits import stays
from gpbnb.arithmetic.flags import uncounted
from gpbnb.arithmetic.kernels.backends import Floats
from gpbnb.arithmetic.rational import exact
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
    "floor_divide": operator.floordiv,
}
"""Functions whose exact value is a Fraction."""

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
_LONGEST = 1 << 20  # bits of a rational power that is formed exactly; a longer one is no number of a format, and no tie
_FARTHEST = 1 << 25  # exponent of the largest and smallest result that is written out
_DOUBT = 2.0**-48  # relative error that no float64 function of NumPy reaches: 16 units of the last digit or more
_MOST_DIGITS = 44  # bits of a format for which such an interval seldom contains a tie
_FEWEST = 2.0**-900  # sizes from here to its inverse are not rounded to fewer digits in float64


class DomainError(ValueError):
    """An argument at which a function has no finite real value."""


@stays
def elementary(name: str, *arrays: Any) -> Any:
    r"""Apply a function of :data:`ELEMENTARY` or :data:`ELEMENTARY_PAIRS` to each entry, correctly rounded.

    Functions of two numbers broadcast. The number zero has no sign: ``np.arctan2(0, x)`` is :math:`\pi` for each
    negative x, and 0 for the others. ``np.float_power(x, y)`` takes any y if x > 0, whole numbers y if x < 0, and
    y >= 0 if x = 0, with :math:`0^0 = 1`. Arguments of any size are reduced exactly. A result that differs from a
    number or tie of the format by less than about :math:`2^{-65000}` of its size is refused.

    Raises
    ------
    DomainError : an entry at which the function has no finite real value.
    ValueError : an entry that is refused.
    OverflowError : a result beyond the range of the format; the message names the function and the entry.

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
    shape = arrays[0].shape
    if quick is None:
        return _by_arb(name, arrays, np.ndindex(shape), np.empty(shape, dtype=object))
    result, doubtful = quick
    if not doubtful.any():
        return result
    exactly = np.empty(shape, dtype=object)
    exactly[~doubtful] = 0
    return np.where(doubtful, _by_arb(name, arrays, map(tuple, np.argwhere(doubtful).tolist()), exactly), result)


def _broadcast(arrays: tuple[Any, ...]) -> tuple[Any, ...]:
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
    if name not in _BY_FLOAT64 or fmt.rounding is Rounding.STOCHASTIC or digits > _MOST_DIGITS:
        return None
    if not all(isinstance(x.backend, Floats) for x in arrays):
        return None
    with np.errstate(all="ignore"):
        y = np.asarray(getattr(np, name)(*(x.components[0] for x in arrays))) + 0.0  # no zero has a sign
        doubt = 0.0 if name in _EXACT else _DOUBT
        usual = (np.abs(y) >= _FEWEST) & (np.abs(y) <= 1 / _FEWEST)
        y = np.where(usual | (doubt == 0), y, 1.0)
        low, high = (fmt.backend.from_numbers(y * (1 + side * doubt), exactly=False) for side in (-1, 1))
    if low is None or high is None:
        return None
    result = arrays[0].from_components(fmt.backend, low, fmt)
    return result, (low[0] != high[0]) | (~usual & (doubt > 0))


def _by_arb(name: str, arrays: Any, indices: Iterable[tuple[int, ...]], rounded: Any) -> Any:
    """Fill in the correctly rounded values at some indices, and return the array of the format."""
    values: Any = [np.asarray(x.to_fractions(), dtype=object) for x in arrays]
    fmt = arrays[0].format
    for index in indices:
        place = f" at {list(index)}" if index else ""
        try:
            rounded[index] = _rounded(name, [each[index] for each in values], fmt, place)
        except OverflowError as error:
            raise OverflowError(f"np.{name}{place}: {error}") from None
    return fmt.array(rounded) if rounded.shape else fmt.array(rounded.item())


def _rounded(name: str, values: Sequence[Fraction], fmt: Any, place: str) -> Fraction:
    if (whole := _rational(name, values)) is not None:
        return Fraction(fmt.round(whole))
    function = _ENCLOSURES.get(name) or getattr(arb, name)
    return rounded_enclosure(
        lambda: function(*(arb(value.numerator) / arb(value.denominator) for value in values)),
        fmt,
        lambda: f"np.{name} of {' and '.join(map(_shown, values))}{place}",
    )


def rounded_enclosure(enclosure: Callable[[], Any], fmt: Any, what: Callable[[], str]) -> Fraction:
    """Round an irrational number correctly, of which Arb computes an interval in the precision that is set.

    Raises
    ------
    DomainError : the interval stays infinite; `what` names the number.
    ValueError : the interval contains a tie in every precision.
    """
    kernel, before, bits = fmt.kernel, ctx.prec, 128
    drawn = getattr(kernel, "count", None)

    def rounded(end: Any) -> Fraction:
        if drawn is not None:
            kernel.count = drawn  # so that stochastic rounding compares both ends with the same random bits
        return Fraction(fmt.round(_exactly(end, fmt)))

    finite = False
    try:
        while bits <= _MOST_BITS:
            ctx.prec = bits
            ball = enclosure()
            finite = ball.is_finite()
            if finite:
                with uncounted():
                    low, high = rounded(ball.lower()), rounded(ball.upper())
                if low == high:
                    return rounded(ball.lower()) if fmt.backend.special else low
            elif bits > 1024:
                break
            bits *= 2
    finally:
        ctx.prec = before
    if finite:
        raise ValueError(f"got {what()}; needed an argument that is further from a tie")
    raise DomainError(f"got {what()}; needed an argument for which the result is finite and real")


def _shown(value: Fraction) -> str:
    try:
        return repr(float(value))
    except OverflowError:
        return f"about 2**{value.numerator.bit_length() - value.denominator.bit_length()}"


def _rational(name: str, values: Sequence[Fraction]) -> Fraction | None:
    """Return a value that is rational, which no ball can separate from a tie; None where it is irrational, or none."""
    x, y = values[0], values[-1]
    if name in _EXACT:
        return Fraction(_EXACT[name](*values))
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
    if not x or not y:
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


def _exactly(end: Any, fmt: Any) -> Fraction:
    significand, exponent = (int(part) for part in end.mid().man_exp())
    size, limits = exponent + significand.bit_length(), fmt.limits
    if significand and limits and limits.overflow != "wrap" and (size < 0 or limits.overflow != "raise"):
        digits = fmt.base.bit_length() * (abs(limits.emin) + fmt.precision)
        reach = digits + limits.largest.numerator.bit_length()
        size = max(-reach, min(reach, size))  # beyond the range, all sizes round alike
        exponent = size - significand.bit_length()
    if significand and abs(size) > _FARTHEST:
        raise OverflowError(
            f"got a result of about 2**{size}; needed one in the range of the format, between 2**-{_FARTHEST} and "
            f"2**{_FARTHEST} in size"
        )
    return Fraction(significand) * Fraction(2) ** exponent


def remainder(x: Any, y: Any) -> Any:
    r"""Return :math:`x - y\lfloor x/y \rfloor` for each pair, rounded once; it has the sign of y.

    The exact value is ``np.fmod(x, y)``, which needs no rounding, or its sum with y, which is rounded. A small negative
    x may therefore give y itself.

    Raises
    ------
    ZeroDivisionError : a divisor is zero.

    Examples
    --------
    An angle between -180 and 180 degrees:

    >>> from gpbnb import BINARY32
    >>> angle = BINARY32.array([190, -190, 540.5])
    >>> ((angle + 180) % 360 - 180).to_float()
    array([-170. ,  170. , -179.5])
    """
    r = fmod(x, y)
    opposite = ((r < 0) & (y > 0)) | ((r > 0) & (y < 0))
    return r + np.where(opposite, y, r.operand(0))


def fmod(x: Any, y: Any) -> Any:
    r"""Return :math:`x - y\,\mathrm{trunc}(x/y)` for each pair, as C does; it has the sign of x and is exact."""
    _check_divisor(y)
    return elementary("fmod", x, y)


def floor_divide(x: Any, y: Any) -> Any:
    r"""Return :math:`\lfloor x/y \rfloor` of the exact quotient of each pair, rounded once."""
    _check_divisor(y)
    return elementary("floor_divide", x, y)


def _check_divisor(y: Any) -> None:
    if y.backend.records:
        return  # the run of the tape checks it
    zero = np.argwhere(y == 0)
    if len(zero):
        at = f" at {zero[0].tolist()} of the divisor" if zero.shape[1] else ""
        raise ZeroDivisionError(f"got a division by zero{at}; needed a divisor other than zero; test y == 0 before")


@stays
def decimals(x: Any, count: int = 0) -> Any:
    """Round each entry to a number of decimals, ties to even, and the result once more into the format.

    With no decimals, the result is exact: the nearest whole number.
    """
    places = operator.index(count)
    if not places:
        return elementary("rint", x)
    rounded = np.frompyfunc(lambda value: round(value, places), 1, 1)(x.to_fractions())
    return x.format.array(rounded)


def copysign(x: Any, y: Any) -> Any:
    """Return entries of the size of x with the sign of y; zero counts as positive in a format where it has no sign."""
    other = np.signbit(x) != np.signbit(y)
    return np.where(other, -np.where(other, x, x.operand(0)), x)


def select(x: Any, conditions: Any, choices: Any, default: Any = 0) -> Any:
    """Return at each place the entry of the first choice whose condition holds, or the default; nothing is rounded.

    Raises
    ------
    ValueError : lists of different lengths, or a choice that the format does not hold.
    """
    if len(conditions) != len(choices):
        raise ValueError(
            f"select: got {len(conditions)} conditions and {len(choices)} choices; needed one condition for each choice"
        )
    found = x.operand(default)
    for condition, choice in zip(reversed(conditions), reversed(choices), strict=True):
        found = np.where(condition, x.operand(choice), found)
    return found


def cross(x: Any, a: Any, b: Any) -> Any:
    """Return the cross products of vectors of length 3 along the last axis.

    Each component, such as a[1] b[2] - a[2] b[1], takes two multiplications and one subtraction, each rounded.

    Raises
    ------
    ValueError : vectors of another length.
    """
    a, b = x.operand(a), x.operand(b)
    if a.shape[-1:] != (3,) or b.shape[-1:] != (3,):
        raise ValueError(f"cross: got shapes {a.shape} and {b.shape}; needed vectors of length 3 along the last axis")
    following, last = [1, 2, 0], [2, 0, 1]
    return a[..., following] * b[..., last] - a[..., last] * b[..., following]


def lines(x: Any, axis: int | None) -> Any:
    """Return the entries with the axis of a reduction moved to the front; all in one row if there is none.

    Raises
    ------
    TypeError : several axes, or an axis that is not an int.
    numpy.exceptions.AxisError : there is no such axis.
    """
    if axis is None:
        return x.reshape(-1)
    try:
        first = operator.index(axis)
    except TypeError:
        raise TypeError(f"axis: got {axis!r}; needed an int or None; reduce one axis at a time") from None
    return x.moved(lambda a: np.moveaxis(a, first, 0))


def kept(x: Any, found: Any, axis: int | None, keepdims: bool) -> Any:
    """Return the result of a reduction; if `keepdims` is set, keep the axis with length 1."""
    if not keepdims:
        return found
    shape = [1] * x.ndim
    if axis is not None:
        shape = list(x.shape)
        shape[operator.index(axis)] = 1
    return found.reshape(tuple(shape))


def mean(x: Any, axis: int | None = None, keepdims: bool = False) -> Any:
    """Return the sum from left to right, divided by the number of entries, which is first rounded into the format."""
    count = len(lines(x, axis))
    if not count:
        raise ValueError("got the mean of no entries; needed at least one")
    return x.sum(axis, keepdims) / x.format.array(count)


def largest(x: Any, axis: int | None = None, keepdims: bool = False) -> Any:
    """Return the largest entry; nothing is rounded."""
    return kept(x, _chosen(x, axis, operator.gt), axis, keepdims)


def smallest(x: Any, axis: int | None = None, keepdims: bool = False) -> Any:
    """Return the smallest entry; nothing is rounded."""
    return kept(x, _chosen(x, axis, operator.lt), axis, keepdims)


def _chosen(x: Any, axis: int | None, better: Callable[[Any, Any], Any]) -> Any:
    left = lines(x, axis)
    if not len(left):
        raise ValueError("got an empty array for min or max; needed at least one entry")
    while len(left) > 1:
        half = len(left) // 2
        first, second, rest = left[:half], left[half : 2 * half], left[2 * half :]
        left = np.concatenate([np.where(_or_nan(better(second, first), second), second, first), rest])
    return left[0]


def argmax(x: Any, axis: int | None = None, keepdims: bool = False) -> Any:
    """Return the index of the largest entry, the first of equal ones."""
    return np.argmax(_or_nan(x == largest(x, axis, keepdims=True), x), axis=axis, keepdims=keepdims)


def argmin(x: Any, axis: int | None = None, keepdims: bool = False) -> Any:
    """Return the index of the smallest entry, the first of equal ones."""
    return np.argmax(_or_nan(x == smallest(x, axis, keepdims=True), x), axis=axis, keepdims=keepdims)


@stays
def argsort(x: Any, axis: int | None = -1) -> Any:
    """Return the indices that sort entries in ascending order; equal entries keep their order."""
    given = x.reshape(-1) if axis is None else x
    keys = given.backend.sort_keys(given.components) if given.ndim else None
    if keys is not None:
        return np.lexsort(keys, axis=-1 if axis is None else axis)
    return np.argsort(np.asarray(x.to_fractions(), dtype=object), axis=axis, kind="stable")


def sort(x: Any, axis: int | None = -1) -> Any:
    """Sort entries in ascending order along an axis; nothing is rounded."""
    order = argsort(x, axis)
    return x.moved(lambda a: np.take_along_axis(a, order, axis=axis))


def maximum(a: Any, b: Any) -> Any:
    """Return the larger entry of two arrays at each place, or NaN if one of them is NaN; nothing is rounded."""
    return np.where(_or_nan(a > b, a), a, b)


def minimum(a: Any, b: Any) -> Any:
    """Return the smaller entry of two arrays at each place, or NaN if one of them is NaN; nothing is rounded."""
    return np.where(_or_nan(a < b, a), a, b)


def fmax(a: Any, b: Any) -> Any:
    """Return the larger entry of two arrays at each place, or the other one if one of them is NaN."""
    return np.where(_or_nan(a > b, b), a, b)


def fmin(a: Any, b: Any) -> Any:
    """Return the smaller entry of two arrays at each place, or the other one if one of them is NaN."""
    return np.where(_or_nan(a < b, b), a, b)


def _or_nan(chosen: Any, x: Any) -> Any:
    """Choose also the entries that are NaN, in a format that has it."""
    return chosen | special("isnan", x) if x.backend.special else chosen


def special(question: str, x: Any) -> Any:
    """Answer "isnan", "isinf", "isfinite" or "signbit" for each entry."""
    if x.backend.special:
        return getattr(np, question)(x.backend.signs(x.components))[()]
    return x < 0 if question == "signbit" else np.full(x.shape, question == "isfinite")[()]


def sign(x: Any) -> Any:
    """Return -1, 0 or 1 for each entry, in the format.

    Raises
    ------
    ValueError : 1 is not a number of the format, as in fixed point without integer bits.
    """
    rest = np.where(special("isnan", x), x, x.operand(0)) if x.backend.special else x.operand(0)
    return np.where(x > 0, 1, np.where(x < 0, -1, rest))


def full_like(x: Any, fill: Any) -> Any:
    """Return an array of the shape of `x` with one number of its format at each place; nothing is rounded."""
    return np.broadcast_to(x.operand(fill), x.shape)


def diff(x: Any, times: int = 1, axis: int = -1) -> Any:
    """Return the differences of neighbours, each one subtraction, ``x[k + 1] - x[k]``; repeat this `times` times."""
    if isinstance(times, bool) or operator.index(times) < 0:
        raise ValueError(f"diff: got n={times}; needed a whole number, at least 0")
    if not x.ndim:
        raise ValueError("diff: got a single number; needed at least one axis")
    given = lines(x, axis)
    for _ in range(times):
        given = given[1:] - given[:-1]
    return given.moved(lambda a: np.moveaxis(a, 0, axis))


@stays
def isclose(a: Any, b: Any, rtol: Any = 1e-5, atol: Any = 1e-8) -> Any:
    r"""Whether :math:`|a-b| \le \text{atol} + \text{rtol}\,|b|` at each place, computed exactly from any numbers.

    Raises
    ------
    TypeError, ValueError : entries that are not finite numbers.
    """
    first, second, relative, absolute = map(exact, (a, b, rtol, atol))
    return np.asarray(abs(first - second) <= absolute + relative * abs(second), dtype=bool)[()]


def clip(x: Any, low: Any = None, high: Any = None) -> Any:
    """Replace entries below `low` by `low` and above `high` by `high`; nothing is rounded."""
    if low is not None:
        low = x.operand(low)
        x = np.where(x < low, low, x)
    if high is not None:
        high = x.operand(high)
        x = np.where(x > high, high, x)
    return x


def cumsum(x: Any, axis: int | None = None) -> Any:
    """Return partial sums from left to right; each adds one entry to the sum before."""
    given = lines(x, axis)
    if not len(given):
        return x
    if (components := given.backend.scan(given.components)) is not None:
        whole: Any = given.from_components(given.backend, components, given.format)
        return whole if axis is None else whole.moved(lambda a: np.moveaxis(a, 0, axis))
    sums = [given[0]]
    for line in given[1:]:
        sums.append(sums[-1] + line)
    whole = np.stack(sums)
    return whole if axis is None else whole.moved(lambda a: np.moveaxis(a, 0, axis))


def trace(x: Any) -> Any:
    """Return the sum of the diagonal, from left to right."""
    if x.ndim != 2:
        raise ValueError(f"trace: got shape {x.shape}; needed a matrix")
    return np.diagonal(x).sum()


def kron(x: Any, a: Any, b: Any) -> Any:
    """Return the Kronecker product, with one multiplication for each entry; missing axes come first, with length 1."""
    a, b = x.operand(a), x.operand(b)
    axes = max(a.ndim, b.ndim)
    outer, inner = ((1,) * (axes - each.ndim) + each.shape for each in (a, b))
    pairs = list(zip(outer, inner, strict=True))
    whole = a.reshape([n for p, _ in pairs for n in (p, 1)]) * b.reshape([n for _, q in pairs for n in (1, q)])
    return whole.reshape(tuple(p * q for p, q in pairs))


def power(x: Any, exponent: Any) -> Any:
    r"""Raise entries to a power: multiply for a single whole number, and round other powers correctly.

    A single whole exponent, such as 3, gives :math:`(x x) x` with each multiplication rounded; a negative one gives 1
    divided by the positive power. All other exponents, one number or an array, give the exact power rounded once, as
    ``np.float_power`` does for each exponent; see :func:`elementary` for the range of arguments.

    Raises
    ------
    TypeError : an exponent that is not a number.
    ValueError : a single whole number beyond 1000 in size, or a power that is not finite and real.
    """
    if isinstance(exponent, (bool, np.bool_, str)):
        raise TypeError(f"got the exponent {exponent!r}; needed a number, or an array of numbers")
    count = _whole(exponent)
    if count is None:
        return elementary("float_power", x, x.operand(exponent))
    if abs(count) > 1000:
        raise ValueError(
            f"got the exponent {count}; needed a whole number from -1000 to 1000; for others use np.float_power"
        )
    if count == 0:
        return full_like(x, 1)
    result = x
    for _ in range(abs(count) - 1):
        result = result * x
    return result if count > 0 else 1 / result


@stays
def _whole(exponent: Any) -> int | None:
    """Return a single whole number, plain or of a format; None for all other exponents."""
    if getattr(exponent, "ndim", 0):
        return None
    value = exponent.to_fractions() if hasattr(exponent, "to_fractions") else exponent
    try:
        return int(value) if value == int(value) else None
    except (TypeError, ValueError, OverflowError):
        return None


def norm(x: Any, order: Any = None, axis: int | None = None, keepdims: bool = False) -> Any:
    """Return a norm, by default the root of the sum of squares, of all entries or along an axis.

    With `order` 1 or infinity, the norm of a vector is the sum or the largest of the absolute values; that of a matrix
    is the largest column sum or row sum. Sums run from left to right.

    Raises
    ------
    ValueError : an unknown order.
    """
    along = x.ndim == 1 or axis is not None
    if order is None or (order == 2 and along):
        found = np.sqrt((x * x).sum(axis))
    elif order in (1, np.inf) and (along or x.ndim == 2):
        size = abs(x)
        if not along:
            found = largest(size.sum(0 if order == 1 else 1))
        else:
            found = size.sum(axis) if order == 1 else largest(size, axis)
    else:
        raise ValueError(
            f"got a norm of order {order!r} and shape {x.shape}; needed None, 1 or infinity, or 2 of a vector"
        )
    return kept(x, found, axis, keepdims)


def einsum(x: Any, subscripts: Any, *operands: Any) -> Any:
    """Multiply entries, and sum the products from left to right.

    A letter that occurs twice in an operand selects its diagonal: ``"ii"`` is a trace. Products are formed in the order
    of the operands. The sum runs over the indices that do not appear in the result, in the order in which they first
    appear; the last index runs fastest.

    Raises
    ------
    ValueError : subscripts without letters for each axis, a diagonal of axes of different lengths, or an ellipsis.
    """
    if not isinstance(subscripts, str) or "." in subscripts:
        raise ValueError(f"einsum: got subscripts {subscripts!r}; needed text such as 'ij,jk->ik', without an ellipsis")
    left, arrow, result = subscripts.replace(" ", "").partition("->")
    inputs, arrays = left.split(","), [x.operand(each) for each in operands]
    if not arrow:
        result = "".join(sorted(c for c in set(left) - {","} if left.count(c) == 1))
    fits = len(inputs) == len(arrays) and all(
        len(letters) == array.ndim
        and letters.isalpha() | (not letters)
        and len(set(zip(letters, array.shape, strict=True))) == len(set(letters))
        for letters, array in zip(inputs, arrays, strict=False)
    )
    if not fits or len(set(result)) != len(result) or not set(result) <= set(left):
        raise ValueError(
            f"einsum: got {subscripts!r} and shapes {[array.shape for array in arrays]}; needed one "
            "letter for each axis, a repeated one only for axes of equal length, and none twice in the result"
        )
    summed = [c for c in dict.fromkeys(left) if c not in {*result, ","}]
    order = [*result, *summed]
    product = None
    for letters, array in map(_diagonal, inputs, arrays):
        moved = array.transpose([letters.index(c) for c in order if c in letters])
        sizes = iter(moved.shape)
        wide = moved.reshape(tuple(next(sizes) if c in letters else 1 for c in order))
        product = wide if product is None else product * wide
    if product is None:
        raise ValueError("einsum: got no operands; needed at least one")
    if not summed:
        return product
    kept_shape, count = product.shape[: len(result)], math.prod(product.shape[len(result) :])
    return product.reshape((*kept_shape, count)).sum(len(result))


def _diagonal(letters: str, array: Any) -> tuple[str, Any]:
    """Take the diagonal of the axes that share a letter, until each letter stands for one axis."""
    for letter in dict.fromkeys(letters):
        while letters.count(letter) > 1:
            first = letters.index(letter)
            second = letters.index(letter, first + 1)
            array = np.diagonal(array, axis1=first, axis2=second)
            letters = letters[:first] + letters[first + 1 : second] + letters[second + 1 :] + letter
    return letters, array
