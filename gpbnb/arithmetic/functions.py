"""NumPy's functions for arrays of a format, each with the order of its operations.

Every operation is rounded once, unless a function says that it rounds nothing. Sums run from left to right. For
elementary functions, such as the exponential, Arb computes an enclosing ball and shrinks it until all numbers in the
ball round to the same result, so these results are correctly rounded, too.
"""

from __future__ import annotations

import operator
from collections.abc import Callable
from fractions import Fraction
from typing import Any

import numpy as np
from flint import arb, ctx

ELEMENTARY = (
    "exp", "expm1", "log", "log1p", "sin", "cos", "tan", "arcsin", "arccos", "arctan", "sinh", "cosh", "tanh",
)  # fmt: skip
"""Functions of one number that Arb allows to round correctly."""

_ARB_NAMES = {"arcsin": "asin", "arccos": "acos", "arctan": "atan"}
_MOST_BITS = 1 << 16


def elementary(name: str, x: Any) -> Any:
    """Apply a function of :data:`ELEMENTARY` to each entry, correctly rounded.

    Raises
    ------
    ValueError : an entry at which the function has no finite real value.
    """
    values: Any = np.asarray(x.to_fractions(), dtype=object)
    rounded = np.empty(values.shape, dtype=object)
    for index in np.ndindex(values.shape):
        rounded[index] = _rounded(name, values[index], x.format)
    return x.format.array(rounded) if values.shape else x.format.array(rounded.item())


def _rounded(name: str, value: Fraction, fmt: Any) -> Fraction:
    before, bits = ctx.prec, 128
    try:
        while bits <= _MOST_BITS:
            ctx.prec = bits
            ball = getattr(arb(value.numerator) / arb(value.denominator), _ARB_NAMES.get(name, name))()
            if ball.is_finite():
                low, high = (fmt.round(_exactly(end)) for end in (ball.lower(), ball.upper()))
                if low == high:
                    return Fraction(low)
            elif bits > 1024:
                break
            bits *= 2
    finally:
        ctx.prec = before
    raise ValueError(f"got np.{name} of {float(value)!r}; needed an argument for which the result is finite and real")


def _exactly(end: Any) -> Fraction:
    significand, exponent = end.mid().man_exp()
    return Fraction(int(significand)) * Fraction(2) ** int(exponent)


def kept(x: Any, found: Any, axis: Any, keepdims: bool) -> Any:
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
    count = x.size if axis is None else x.shape[operator.index(axis)]
    if not count:
        raise ValueError("got the mean of no entries; needed at least one")
    return kept(x, x.sum(axis) / x.format.array(count), axis, keepdims)


def largest(x: Any, axis: int | None = None, keepdims: bool = False) -> Any:
    """Return the largest entry; nothing is rounded."""
    return kept(x, _chosen(x, axis, operator.gt), axis, keepdims)


def smallest(x: Any, axis: int | None = None, keepdims: bool = False) -> Any:
    """Return the smallest entry; nothing is rounded."""
    return kept(x, _chosen(x, axis, operator.lt), axis, keepdims)


def _chosen(x: Any, axis: int | None, better: Callable[[Any, Any], Any]) -> Any:
    lines = x.reshape(-1) if axis is None else x.moved(lambda a: np.moveaxis(a, axis, 0))
    if not len(lines):
        raise ValueError("got an empty array for min or max; needed at least one entry")
    while len(lines) > 1:
        half = len(lines) // 2
        first, second, rest = lines[:half], lines[half : 2 * half], lines[2 * half :]
        lines = np.concatenate([np.where(better(second, first), second, first), rest])
    return lines[0]


def sort(x: Any, axis: int = -1) -> Any:
    """Sort entries in ascending order along an axis; nothing is rounded."""
    order = np.argsort(np.asarray(x.to_fractions(), dtype=object), axis=axis, kind="stable")
    return x.moved(lambda a: np.take_along_axis(a, order, axis=axis))


def clip(x: Any, low: Any = None, high: Any = None) -> Any:
    """Replace entries below `low` by `low` and above `high` by `high`; nothing is rounded."""
    if low is not None:
        x = np.where(x < low, x.operand(low), x)
    if high is not None:
        x = np.where(x > high, x.operand(high), x)
    return x


def cumsum(x: Any, axis: int | None = None) -> Any:
    """Return partial sums from left to right; each adds one entry to the sum before."""
    lines = x.reshape(-1) if axis is None else x.moved(lambda a: np.moveaxis(a, axis, 0))
    if not len(lines):
        return x
    sums = [lines[0]]
    for line in lines[1:]:
        sums.append(sums[-1] + line)
    whole: Any = np.stack(sums)
    return whole if axis is None else whole.moved(lambda a: np.moveaxis(a, 0, axis))


def trace(x: Any) -> Any:
    """Return the sum of the diagonal, from left to right."""
    if x.ndim != 2:
        raise ValueError(f"trace: got shape {x.shape}; needed a matrix")
    return np.diagonal(x).sum()


def kron(x: Any, a: Any, b: Any) -> Any:
    """Return the Kronecker product of two matrices, with one multiplication for each entry."""
    a, b = x.operand(a), x.operand(b)
    if a.ndim != 2 or b.ndim != 2:
        raise ValueError(f"kron: got shapes {a.shape} and {b.shape}; needed two matrices")
    whole = a[:, None, :, None] * b[None, :, None, :]
    return whole.reshape(a.shape[0] * b.shape[0], a.shape[1] * b.shape[1])


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


def norm(x: Any, order: Any = None, axis: int | None = None) -> Any:
    """Return a norm, by default the root of the sum of squares, of all entries or along an axis.

    With `order` 1 or infinity, the norm of a vector is the sum or the largest of the absolute values; that of a matrix
    is the largest column sum or row sum. Sums run from left to right.

    Raises
    ------
    ValueError : another order.
    """
    if order is None or (order == 2 and (x.ndim == 1 or axis is not None)):
        return np.sqrt((x * x).sum(axis))
    size = abs(x)
    if order == 1:
        return size.sum(axis) if x.ndim == 1 or axis is not None else largest(size.sum(0))
    if order == np.inf:
        return largest(size, axis) if x.ndim == 1 or axis is not None else largest(size.sum(1))
    raise ValueError(f"got a norm of order {order!r} and shape {x.shape}; needed None, 1 or infinity, or 2 of a vector")


def einsum(x: Any, subscripts: Any, *operands: Any) -> Any:
    """Multiply entries, and sum the products from left to right.

    Products are formed in the order of the operands. The sum runs over the indices that do not appear in the result, in
    the order in which they first appear; the last index runs fastest.

    Raises
    ------
    ValueError : subscripts without letters for each axis, an index that an operand repeats, or an ellipsis.
    """
    if not isinstance(subscripts, str) or "." in subscripts:
        raise ValueError(f"einsum: got subscripts {subscripts!r}; needed text such as 'ij,jk->ik', without an ellipsis")
    left, arrow, result = subscripts.replace(" ", "").partition("->")
    inputs, arrays = left.split(","), [x.operand(each) for each in operands]
    if not arrow:
        result = "".join(sorted(c for c in set(left) - {","} if left.count(c) == 1))
    fits = len(inputs) == len(arrays) and all(
        len(letters) == array.ndim and len(set(letters)) == len(letters) and letters.isalpha() | (not letters)
        for letters, array in zip(inputs, arrays, strict=False)
    )
    if not fits or len(set(result)) != len(result) or not set(result) <= set(left):
        raise ValueError(
            f"einsum: got {subscripts!r} and shapes {[array.shape for array in arrays]}; needed one "
            "letter for each axis and no letter twice in an operand"
        )
    summed = [c for c in dict.fromkeys(left) if c not in {*result, ","}]
    order = [*result, *summed]
    product = None
    for letters, array in zip(inputs, arrays, strict=True):
        moved = array.transpose([letters.index(c) for c in order if c in letters])
        sizes = iter(moved.shape)
        wide = moved.reshape(tuple(next(sizes) if c in letters else 1 for c in order))
        product = wide if product is None else product * wide
    if product is None:
        raise ValueError("einsum: got no operands; needed at least one")
    if not summed:
        return product
    return product.reshape((*product.shape[: len(result)], -1)).sum(len(result))
