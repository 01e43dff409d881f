"""NumPy's functions for arrays of a format, each with the order of its operations.

Every operation is rounded once, unless a function says that it rounds nothing. Sums run from left to right. Elementary
functions are in :mod:`gpbnb.arithmetic.elementary`.
"""

from __future__ import annotations

import math
import operator
from collections.abc import Callable
from typing import Any

import numpy as np

from gpbnb.arithmetic.elementary import elementary
from gpbnb.arithmetic.exits import stays
from gpbnb.arithmetic.rational import exact

MOST_DECIMALS = 100_000
"""Most decimals to round to."""


def remainder(x: Any, y: Any) -> Any:
    r"""Return :math:`x - y\lfloor x/y \rfloor` for each pair, rounded once; it has the sign of y.

    The exact value is ``np.fmod(x, y)``, which needs no rounding, or its sum with y, which is rounded. A small negative
    x may therefore give y itself.

    Examples
    --------
    An angle between -180 and 180 degrees:

    >>> from gpbnb import BINARY32
    >>> angle = BINARY32.array([190, -190, 540.5])
    >>> ((angle + 180) % 360 - 180).to_float()
    array([-170. ,  170. , -179.5])
    """
    if x.backend.records:  # a run of the tape calls this function in its format
        return elementary("remainder", x, y)
    limits = x.format.limits
    if limits is not None and not limits.subnormal:  # what fmod leaves may be flushed to zero
        _check_divisor(y)
        return elementary("remainder", x, y)
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
def rounded(a: Any, decimals: int = 0) -> Any:
    """Round each entry to a number of decimals, ties to even, and the result once more into the format.

    With no decimals, the result is exact: the nearest whole number.
    """
    try:
        places = operator.index(decimals)
    except TypeError:
        raise TypeError(f"decimals: got {decimals!r}; needed a whole number") from None
    if abs(places) > MOST_DECIMALS:
        raise ValueError(f"decimals: got {places}; needed at most {MOST_DECIMALS:,} in size")
    if not places:
        return elementary("rint", a)
    return a.format.array(np.frompyfunc(lambda value: round(value, places), 1, 1)(a.to_fractions()))


def copysign(x: Any, y: Any) -> Any:
    """Return entries of the size of x with the sign of y; zero counts as positive."""
    other = np.signbit(x) != np.signbit(y)
    return np.where(other, -np.where(other, x, x.operand(0)), x)


def select(x: Any, conditions: Any, choices: Any, default: Any = 0) -> Any:
    """Return at each place the entry of the first choice whose condition holds, or the default; nothing is rounded."""
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
    """
    a, b = x.operand(a), x.operand(b)
    if a.shape[-1:] != (3,) or b.shape[-1:] != (3,):
        raise ValueError(f"cross: got shapes {a.shape} and {b.shape}; needed vectors of length 3 along the last axis")
    following, last = [1, 2, 0], [2, 0, 1]
    return a[..., following] * b[..., last] - a[..., last] * b[..., following]


def lines(x: Any, axis: int | None) -> Any:
    """Return the entries with the axis of a reduction moved to the front; all in one row if there is none."""
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


def mean(a: Any, axis: int | None = None, keepdims: bool = False) -> Any:
    """Return the sum from left to right, divided by the number of entries, which is first rounded into the format."""
    count = len(lines(a, axis))
    if not count:
        raise ValueError("got the mean of no entries; needed at least one")
    return a.sum(axis, keepdims) / a.format.array(count)


def var(a: Any, axis: int | None = None, ddof: int = 0, keepdims: bool = False) -> Any:
    """Return the mean square of the differences from :func:`mean`; their number minus `ddof` divides the sum."""
    rest, count = a - mean(a, axis, keepdims=True), len(lines(a, axis))
    if not ddof < count:
        raise ValueError(f"got ddof={ddof} for {count} entries; needed fewer than there are entries")
    return (rest * rest).sum(axis, keepdims) / a.format.array(count - ddof)


def interp(x: Any, at: Any, nodes: Any, values: Any) -> Any:
    r"""Interpolate between increasing nodes :math:`x_k`: :math:`(x - x_k)\frac{f_{k+1} - f_k}{x_{k+1} - x_k} + f_k`.

    Each of the five operations is rounded once. Beyond the first and last node, the values there are returned.
    """
    at, values = x.operand(at), x.operand(values)
    if isinstance(nodes, type(x)):
        raise TypeError("interp: got nodes of a format; needed plain numbers, which each format holds exactly")
    given = exact(nodes)
    if given.ndim != 1 or given.shape != values.shape or len(given) < 2 or not (given[1:] > given[:-1]).all():
        raise ValueError(
            f"interp: got nodes of shape {given.shape} and values of shape {values.shape}; needed as many increasing "
            "nodes as values, two or more"
        )
    made = x.operand(nodes)
    slopes = diff(values) / diff(made)
    node, value, slope = made[0], values[0], slopes[0]
    for k in range(1, len(slopes)):
        beyond = at >= made[k]
        node, value, slope = (
            np.where(beyond, new[k], old) for new, old in ((made, node), (values, value), (slopes, slope))
        )
    inside = slope * (clip(at, made[0], made[-1]) - node) + value
    return np.where(at >= made[-1], values[-1], np.where(at <= made[0], values[0], inside))


def convolve(x: Any, a: Any, v: Any, mode: str = "full") -> Any:
    """Return the sums of products ``a[i] v[k - i]``, each from left to right in i."""
    a, v = x.operand(a), x.operand(v)
    if a.ndim != 1 or v.ndim != 1 or not a.size or not v.size or mode not in ("full", "same", "valid"):
        raise ValueError(
            f"convolve: got shapes {a.shape} and {v.shape} and mode {mode!r}; needed two vectors, and one of 'full', "
            "'same' and 'valid'"
        )
    short, length = sorted((len(a), len(v)))
    first, count = {
        "full": (0, length + short - 1), "same": ((short - 1) // 2, length), "valid": (short - 1, length - short + 1)
    }[mode]  # fmt: skip
    spans = [(k, max(0, k - len(v) + 1), min(k + 1, len(a))) for k in range(first, first + count)]
    turned = np.flip(v)
    return np.stack([a[low:high] @ turned[len(v) - 1 - k + low : len(v) - 1 - k + high] for k, low, high in spans])


def largest(a: Any, axis: int | None = None, keepdims: bool = False) -> Any:
    """Return the largest entry; nothing is rounded."""
    return kept(a, _chosen(a, axis, operator.gt), axis, keepdims)


def smallest(a: Any, axis: int | None = None, keepdims: bool = False) -> Any:
    """Return the smallest entry; nothing is rounded."""
    return kept(a, _chosen(a, axis, operator.lt), axis, keepdims)


def _chosen(x: Any, axis: int | None, better: Callable[[Any, Any], Any]) -> Any:
    left = lines(x, axis)
    if not len(left):
        raise ValueError("got an empty array for min or max; needed at least one entry")
    while len(left) > 1:
        half = len(left) // 2
        first, second, rest = left[:half], left[half : 2 * half], left[2 * half :]
        left = np.concatenate([np.where(better(second, first), second, first), rest])
    return left[0]


def argmax(a: Any, axis: int | None = None, keepdims: bool = False) -> Any:
    """Return the index of the largest entry, the first of equal ones."""
    return np.argmax(a == largest(a, axis, keepdims=True), axis=axis, keepdims=keepdims)


def argmin(a: Any, axis: int | None = None, keepdims: bool = False) -> Any:
    """Return the index of the smallest entry, the first of equal ones."""
    return np.argmax(a == smallest(a, axis, keepdims=True), axis=axis, keepdims=keepdims)


@stays
def argsort(a: Any, axis: int | None = -1) -> Any:
    """Return the indices that sort entries in ascending order; equal entries keep their order."""
    given = a.reshape(-1) if axis is None else a
    keys = given.backend.sort_keys(given.components) if given.ndim else None
    if keys is not None:
        return np.lexsort(keys, axis=-1 if axis is None else axis)
    return np.argsort(np.asarray(a.to_fractions(), dtype=object), axis=axis, kind="stable")


def sort(a: Any, axis: int | None = -1) -> Any:
    """Sort entries in ascending order along an axis; nothing is rounded."""
    order = argsort(a, axis)
    return a.moved(lambda a: np.take_along_axis(a, order, axis=axis))


def maximum(a: Any, b: Any) -> Any:
    """Return the larger entry of two arrays at each place; nothing is rounded."""
    return np.where(a > b, a, b)


def minimum(a: Any, b: Any) -> Any:
    """Return the smaller entry of two arrays at each place; nothing is rounded."""
    return np.where(a < b, a, b)


def every(a: Any, axis: int | None = None, keepdims: bool = False) -> Any:
    """Whether all entries differ from zero."""
    return np.all(a != 0, axis=axis, keepdims=keepdims)


def some(a: Any, axis: int | None = None, keepdims: bool = False) -> Any:
    """Whether an entry differs from zero."""
    return np.any(a != 0, axis=axis, keepdims=keepdims)


def signbit(x: Any) -> Any:
    """Whether each entry is negative."""
    return x < 0


def everywhere(answer: bool, x: Any) -> Any:
    """Return the same answer for each entry, as to "isnan": no number of a format is infinite or NaN."""
    return np.full(x.shape, answer)[()]


def sign(x: Any) -> Any:
    """Return -1, 0 or 1 for each entry, in the format."""
    return np.where(x > 0, 1, np.where(x < 0, -1, x.operand(0)))


def full_like(a: Any, fill_value: Any) -> Any:
    """Return an array of the shape of `a` with one number of its format at each place; nothing is rounded."""
    return np.broadcast_to(a.operand(fill_value), a.shape)


def diff(a: Any, n: int = 1, axis: int = -1) -> Any:
    """Return the differences of neighbours, each one subtraction, ``a[k + 1] - a[k]``; repeat this `n` times."""
    if isinstance(n, bool) or operator.index(n) < 0:
        raise ValueError(f"diff: got n={n}; needed a whole number, at least 0")
    if not a.ndim:
        raise ValueError("diff: got a single number; needed at least one axis")
    given = lines(a, axis)
    for _ in range(n):
        given = given[1:] - given[:-1]
    return given.moved(lambda a: np.moveaxis(a, 0, axis))


@stays
def isclose(a: Any, b: Any, rtol: Any = 1e-5, atol: Any = 1e-8) -> Any:
    r"""Whether :math:`|a-b| \le \text{atol} + \text{rtol}\,|b|` at each place, computed exactly from any numbers."""
    first, second, relative, absolute = map(exact, (a, b, rtol, atol))
    return np.asarray(abs(first - second) <= absolute + relative * abs(second), dtype=bool)[()]


def clip(a: Any, a_min: Any = None, a_max: Any = None) -> Any:
    """Replace entries below `a_min` by `a_min` and above `a_max` by `a_max`; nothing is rounded."""
    if a_min is not None:
        a_min = a.operand(a_min)
        a = np.where(a < a_min, a_min, a)
    if a_max is not None:
        a_max = a.operand(a_max)
        a = np.where(a > a_max, a_max, a)
    return a


def cumsum(a: Any, axis: int | None = None) -> Any:
    """Return partial sums from left to right; each adds one entry to the sum before."""
    given = lines(a, axis)
    if not len(given):
        return a if axis is not None else given
    backend, entries = given.backend, given.components  # which derivatives do not have, and so are refused
    if (components := backend.scan(entries)) is not None:
        whole: Any = given.from_components(backend, components, given.format)
        return whole if axis is None else whole.moved(lambda a: np.moveaxis(a, 0, axis))
    sums = [given[0]]
    for line in given[1:]:
        sums.append(sums[-1] + line)
    whole = np.stack(sums)
    return whole if axis is None else whole.moved(lambda a: np.moveaxis(a, 0, axis))


def trace(a: Any) -> Any:
    """Return the sum of the diagonal, from left to right."""
    if a.ndim != 2:
        raise ValueError(f"trace: got shape {a.shape}; needed a matrix")
    return np.diagonal(a).sum()


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
    ``np.float_power`` does for each exponent; for the range of arguments, see
    :func:`~gpbnb.arithmetic.elementary.elementary`.
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


def norm(x: Any, ord: Any = None, axis: int | None = None, keepdims: bool = False) -> Any:
    """Return a norm, by default the root of the sum of squares, of all entries or along an axis.

    With `ord` 1 or infinity, the norm of a vector is the sum or the largest of the absolute values; that of a matrix
    is the largest column sum or row sum. Sums run from left to right.
    """
    along = x.ndim == 1 or axis is not None
    if ord is None or (ord == 2 and along):
        found = np.sqrt((x * x).sum(axis))
    elif ord in (1, np.inf) and (along or x.ndim == 2):
        size = abs(x)
        if not along:
            found = largest(size.sum(0 if ord == 1 else 1))
        else:
            found = size.sum(axis) if ord == 1 else largest(size, axis)
    else:
        raise ValueError(
            f"got a norm of order {ord!r} and shape {x.shape}; needed None, 1 or infinity, or 2 of a vector"
        )
    return kept(x, found, axis, keepdims)


def einsum(x: Any, subscripts: Any, *operands: Any) -> Any:
    """Multiply entries, and sum the products from left to right.

    A letter that occurs twice in an operand selects its diagonal: ``"ii"`` is a trace. Products are formed in the order
    of the operands. The sum runs over the indices that do not appear in the result, in the order in which they first
    appear; the last index runs fastest.
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
