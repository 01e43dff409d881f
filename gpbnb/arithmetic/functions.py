"""NumPy's functions for arrays of a format, each with the order of its operations.

Every operation is rounded once, unless a function says that it rounds nothing. Sums run from left to right. For
elementary functions, such as the exponential, Arb computes an enclosing ball and shrinks it until all numbers in the
ball round to the same result, so these results are correctly rounded, too.
"""

from __future__ import annotations

import math
import operator
from collections.abc import Callable
from fractions import Fraction
from typing import Any

import numpy as np
from flint import arb, ctx

from gpbnb.arithmetic.exits import stays
from gpbnb.arithmetic.rational import exact

ELEMENTARY = (
    "exp", "expm1", "log", "log1p", "sin", "cos", "tan", "arcsin", "arccos", "arctan", "sinh", "cosh", "tanh",
)  # fmt: skip
"""Functions of one number that Arb allows to round correctly."""

_ARB_NAMES = {"arcsin": "asin", "arccos": "acos", "arctan": "atan"}
_MOST_BITS = 1 << 16


@stays
def elementary(name: str, x: Any) -> Any:
    """Apply a function of :data:`ELEMENTARY` to each entry, correctly rounded.

    Raises
    ------
    ValueError : an entry at which the function has no finite real value.
    OverflowError : a result beyond the range of the format; the message names the function and the entry.
    """
    values: Any = np.asarray(x.to_fractions(), dtype=object)
    rounded = np.empty(values.shape, dtype=object)
    for index in np.ndindex(values.shape):
        place = f" at {list(index)}" if index else ""
        try:
            rounded[index] = _rounded(name, values[index], x.format, place)
        except OverflowError as error:
            raise OverflowError(f"np.{name}{place}: {error}") from None
    return x.format.array(rounded) if values.shape else x.format.array(rounded.item())


def _rounded(name: str, value: Fraction, fmt: Any, place: str) -> Fraction:
    kernel, before, bits = fmt.kernel, ctx.prec, 128
    drawn = getattr(kernel, "count", None)

    def rounded(end: Any) -> Fraction:
        if drawn is not None:
            kernel.count = drawn  # so that stochastic rounding compares both ends with the same random bits
        return Fraction(fmt.round(_exactly(end)))

    try:
        while bits <= _MOST_BITS:
            ctx.prec = bits
            ball = getattr(arb(value.numerator) / arb(value.denominator), _ARB_NAMES.get(name, name))()
            if ball.is_finite():
                low, high = rounded(ball.lower()), rounded(ball.upper())
                if low == high:
                    return low
            elif bits > 1024:
                break
            bits *= 2
    finally:
        ctx.prec = before
    raise ValueError(
        f"got np.{name} of {float(value)!r}{place}; needed an argument for which the result is finite and real"
    )


def _exactly(end: Any) -> Fraction:
    significand, exponent = end.mid().man_exp()
    return Fraction(int(significand)) * Fraction(2) ** int(exponent)


def lines(x: Any, axis: int | None) -> Any:
    """Return the entries with the axis of a reduction moved to the front; all in one row if there is none.

    Raises
    ------
    TypeError : several axes, or what is not an int.
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
        left = np.concatenate([np.where(better(second, first), second, first), rest])
    return left[0]


def argmax(x: Any, axis: int | None = None, keepdims: bool = False) -> Any:
    """Return the index of the largest entry, the first of equal ones."""
    return np.argmax(x == largest(x, axis, keepdims=True), axis=axis, keepdims=keepdims)


def argmin(x: Any, axis: int | None = None, keepdims: bool = False) -> Any:
    """Return the index of the smallest entry, the first of equal ones."""
    return np.argmin(x != smallest(x, axis, keepdims=True), axis=axis, keepdims=keepdims)


@stays
def argsort(x: Any, axis: int | None = -1) -> Any:
    """Return the indices that sort entries in ascending order; equal entries keep their order."""
    return np.argsort(np.asarray(x.to_fractions(), dtype=object), axis=axis, kind="stable")


def sort(x: Any, axis: int | None = -1) -> Any:
    """Sort entries in ascending order along an axis; nothing is rounded."""
    order = argsort(x, axis)
    return x.moved(lambda a: np.take_along_axis(a, order, axis=axis))


def maximum(a: Any, b: Any) -> Any:
    """Return the larger entry of two arrays at each place; nothing is rounded."""
    return np.where(a > b, a, b)


def minimum(a: Any, b: Any) -> Any:
    """Return the smaller entry of two arrays at each place; nothing is rounded."""
    return np.where(a < b, a, b)


def sign(x: Any) -> Any:
    """Return -1, 0 or 1 for each entry, in the format.

    Raises
    ------
    ValueError : 1 is not a number of the format, as in fixed point without integer bits.
    """
    return np.where(x > 0, 1, np.where(x < 0, -1, x.operand(0)))


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
        x = np.where(x < low, x.operand(low), x)
    if high is not None:
        x = np.where(x > high, x.operand(high), x)
    return x


def cumsum(x: Any, axis: int | None = None) -> Any:
    """Return partial sums from left to right; each adds one entry to the sum before."""
    given = lines(x, axis)
    if not len(given):
        return x
    sums = [given[0]]
    for line in given[1:]:
        sums.append(sums[-1] + line)
    whole: Any = np.stack(sums)
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
    r"""Raise entries to a whole power, from left to right, :math:`((x x)x)\cdots`; for a negative one, divide 1 by it.

    Raises
    ------
    TypeError : an exponent that is not a whole number.
    """
    try:
        if isinstance(exponent, bool):
            raise TypeError
        count = operator.index(exponent)
    except TypeError:
        raise TypeError(
            f"got the exponent {exponent!r}; needed a whole number; for a root see np.sqrt, for others exp and log"
        ) from None
    if abs(count) > 1000:
        raise ValueError(f"got the exponent {count}; needed a whole number from -1000 to 1000")
    if count == 0:
        return x * 0 + 1
    result = x
    for _ in range(abs(count) - 1):
        result = result * x
    return result if count > 0 else 1 / result


def norm(x: Any, order: Any = None, axis: int | None = None, keepdims: bool = False) -> Any:
    """Return a norm, by default the root of the sum of squares, of all entries or along an axis.

    With `order` 1 or infinity, the norm of a vector is the sum or the largest of the absolute values; that of a matrix
    is the largest column sum or row sum. Sums run from left to right.

    Raises
    ------
    ValueError : another order.
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
