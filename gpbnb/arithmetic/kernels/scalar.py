"""One set of scalar operations for compiled loops, in every arithmetic.

A loop is written once, with a tag of :mod:`gpbnb.arithmetic.kernels.tags` as its first argument. numba compiles it
for the type of the tag::

    @compiled
    def decay(fmt, factor, x):
        f = load(fmt, factor, 0)
        for k in range(1, len(x)):
            store(fmt, x, k, multiply(fmt, f, load(fmt, x, k - 1)))

Each operation rounds the exact result once and agrees digit for digit with
:class:`gpbnb.arithmetic.kernels.exact.ExactKernel`. ``DoubleDouble`` is only
loaded and stored. A number that
leaves the range of its backend never passes unnoticed: an operation on integers, in base 10 or in ``Wide``, raises
OverflowError; a float64 outside 2**-960 ... 2**1023 becomes NaN, later operations keep it, and ``store`` and
``compare`` raise OverflowError. Callers must pass numbers of the format;
:mod:`gpbnb.arithmetic.kernels.backends` makes the arrays.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numba import types
from numba.extending import overload

from gpbnb.arithmetic.kernels import decimal, shortdecimal, wide
from gpbnb.arithmetic.kernels.bits import start
from gpbnb.arithmetic.kernels.careful import carefully
from gpbnb.arithmetic.kernels.compiling import INLINE, borrowing
from gpbnb.arithmetic.kernels.tags import (
    ADD,
    DIVIDE,
    MULTIPLY,
    NEGATIVE,
    PAIRS,
    ROUND,
    SUBTRACT,
    Decimal,
    DoubleDouble,
    Float,
    ShortDecimal,
    Wide,
)

_MODULES = {
    Decimal: decimal,
    ShortDecimal: shortdecimal,
    Wide: wide,
}

BEYOND = "got a result beyond the range of float64; needed 2**-960 <= |x| < 2**1023; scale the numbers, or use base 10"


def _tag(fmt: Any) -> Any:
    """The class of a tag, from its numba type."""
    return getattr(fmt, "instance_class", None)


def _only_compiled(name: str) -> TypeError:
    return TypeError(f"got a call of {name} from Python; needed one from a function compiled by numba")


# -- operations on two numbers and on one -------------------------------------------------------------


def add(fmt: Any, a: Any, b: Any) -> Any:
    """fl(a + b)."""
    raise _only_compiled("add")


def subtract(fmt: Any, a: Any, b: Any) -> Any:
    """fl(a - b)."""
    raise _only_compiled("subtract")


def multiply(fmt: Any, a: Any, b: Any) -> Any:
    """fl(a * b)."""
    raise _only_compiled("multiply")


def quotient(fmt: Any, a: Any, b: Any) -> Any:
    """fl(a / b), where the caller has made sure that b is not zero: without a branch, so that loops are vectorized."""
    raise _only_compiled("quotient")


def root(fmt: Any, a: Any) -> Any:
    """fl(sqrt(a)), where the caller has made sure that a is not negative; not for numbers that are float64."""
    raise _only_compiled("root")


def round_(fmt: Any, x: Any) -> Any:
    """Round a float64 (base 2, 16), a pair ``m * 10**e`` (base 10), a number of Wide, or the sum of two float64."""
    raise _only_compiled("round_")


def negative(fmt: Any, a: Any) -> Any:
    """-a, exact."""
    raise _only_compiled("negative")


def compare(fmt: Any, a: Any, b: Any) -> Any:
    """-1, 0 or 1 if a is less than, equal to or greater than b; raises OverflowError if one is out of range."""
    raise _only_compiled("compare")


def less(fmt: Any, a: Any, b: Any) -> Any:
    """Whether a < b; see :func:`compare`."""
    raise _only_compiled("less")


def zero(fmt: Any) -> Any:
    """The number 0."""
    raise _only_compiled("zero")


def load(fmt: Any, array: Any, index: Any) -> Any:
    """The number at an index, an int or a tuple of them."""
    raise _only_compiled("load")


def store(fmt: Any, array: Any, index: Any, x: Any) -> None:
    """Store a number at an index; raises OverflowError if it is out of range."""
    raise _only_compiled("store")


def put(fmt: Any, array: Any, index: Any, x: Any) -> None:
    """Like :func:`store`, but unchecked."""
    raise _only_compiled("put")


def lost(fmt: Any, x: Any) -> Any:
    """Whether a number has left the range of its backend."""
    raise _only_compiled("lost")


def _of_floats(code: int) -> Any:
    """Return the function of an operation on float64."""

    @borrowing(forceinline=True)
    def operate(fmt: Any, a: Any, b: Any) -> Any:
        return carefully(fmt, start(fmt.random), code, a, b, a)

    return operate


_FLOATS = {
    "add": _of_floats(ADD), "subtract": _of_floats(SUBTRACT), "multiply": _of_floats(MULTIPLY),
    "quotient": _of_floats(DIVIDE), "round_": _of_floats(ROUND), "negative": _of_floats(NEGATIVE),
}  # fmt: skip


def _implementation(fmt: Any, name: str) -> Any:
    if _tag(fmt) is Float:
        return _FLOATS.get(name)
    return getattr(_MODULES.get(_tag(fmt)), {"quotient": "divide", "root": "sqrt"}.get(name, name), None)


def fused(fmt: Any, a: Any, b: Any, c: Any) -> Any:
    """fl(a * b + c), rounded once; only for ``Wide``."""
    raise _only_compiled("fused")


@overload(fused, strict=False, jit_options=INLINE)
def _overloaded_fused(fmt: Any, a: Any, b: Any, c: Any) -> Any:
    function = _implementation(fmt, "fused")
    return None if function is None else lambda fmt, a, b, c: function(fmt, a, b, c)


def _overload_two(stub: Callable[..., Any]) -> None:
    @overload(stub, strict=False, jit_options=INLINE)
    def choose(fmt: Any, a: Any, b: Any) -> Any:
        function = _implementation(fmt, stub.__name__)
        return None if function is None else lambda fmt, a, b: function(fmt, a, b)


def _overload_one(stub: Callable[..., Any]) -> None:
    @overload(stub, strict=False, jit_options=INLINE)
    def choose(fmt: Any, x: Any) -> Any:
        function = _implementation(fmt, stub.__name__)
        if _tag(fmt) is Float:
            return lambda fmt, x: function(fmt, x, x)
        return None if function is None else lambda fmt, x: function(fmt, x)


for _operation in (add, subtract, multiply, quotient):
    _overload_two(_operation)
for _stub in (root, round_, negative):
    _overload_one(_stub)


@overload(compare, strict=False, jit_options=INLINE)
def _compare(fmt: Any, a: Any, b: Any) -> Any:
    if _tag(fmt) is Float:

        def of_floats(fmt: Any, a: Any, b: Any) -> Any:
            if a != a or b != b:
                raise OverflowError(BEYOND)
            return (a > b) - (a < b)

        return of_floats
    function = _implementation(fmt, "compare")
    return lambda fmt, a, b: function(fmt, a, b)


@overload(less, strict=False, jit_options=INLINE)
def _less(fmt: Any, a: Any, b: Any) -> Any:
    return lambda fmt, a, b: compare(fmt, a, b) < 0


@overload(zero, strict=False, jit_options=INLINE)
def _zero(fmt: Any) -> Any:
    if _tag(fmt) in PAIRS:
        return lambda fmt: (np.int64(0), np.int64(0))
    if _tag(fmt) is DoubleDouble:
        return lambda fmt: (0.0, 0.0)
    if _tag(fmt) is Wide:
        return lambda fmt: wide.zero()
    return lambda fmt: 0.0


# -- arrays ------------------------------------------------------------------------------------------
# A tuple of arrays, such as (significands, exponents) or (high, low), works as well as one array with a last axis of
# the same length.


@overload(load, strict=False, jit_options=INLINE)
def _load(fmt: Any, array: Any, index: Any) -> Any:
    if _tag(fmt) is Float:
        return lambda fmt, array, index: array[index]
    if _tag(fmt) is Wide:
        return _load_wide(array, index)
    if isinstance(array, types.BaseTuple):
        return lambda fmt, array, index: (array[0][index], array[1][index])
    if isinstance(index, types.Integer):
        return lambda fmt, array, index: (array[index, 0], array[index, 1])
    return lambda fmt, array, index: (array[(*index, 0)], array[(*index, 1)])


def _load_wide(array: Any, index: Any) -> Any:
    number = wide.number
    if isinstance(array, types.BaseTuple):
        return lambda fmt, array, index: number(fmt, array[0][index], array[1][index], array[2][index])
    if isinstance(index, types.Integer):
        return lambda fmt, array, index: number(fmt, array[index, 0], array[index, 1], array[index, 2])
    return lambda fmt, array, index: number(fmt, array[(*index, 0)], array[(*index, 1)], array[(*index, 2)])


def _put_wide(array: Any, index: Any) -> Any:
    parts = wide.parts

    def in_three(fmt: Any, array: Any, index: Any, x: Any) -> None:
        array[0][index], array[1][index], array[2][index] = parts(fmt, x)

    def at_integer(fmt: Any, array: Any, index: Any, x: Any) -> None:
        array[index, 0], array[index, 1], array[index, 2] = parts(fmt, x)

    def at_tuple(fmt: Any, array: Any, index: Any, x: Any) -> None:
        array[(*index, 0)], array[(*index, 1)], array[(*index, 2)] = parts(fmt, x)

    if isinstance(array, types.BaseTuple):
        return in_three
    return at_integer if isinstance(index, types.Integer) else at_tuple


@overload(put, strict=False, jit_options=INLINE)
def _overloaded_put(fmt: Any, array: Any, index: Any, x: Any) -> Any:
    def of_floats(fmt: Any, array: Any, index: Any, x: Any) -> None:
        array[index] = x

    def in_two(fmt: Any, array: Any, index: Any, x: Any) -> None:
        array[0][index] = x[0]
        array[1][index] = x[1]

    def at_integer(fmt: Any, array: Any, index: Any, x: Any) -> None:
        array[index, 0] = x[0]
        array[index, 1] = x[1]

    def at_tuple(fmt: Any, array: Any, index: Any, x: Any) -> None:
        array[(*index, 0)] = x[0]
        array[(*index, 1)] = x[1]

    if _tag(fmt) is Float:
        return of_floats
    if _tag(fmt) is Wide:
        return _put_wide(array, index)
    if isinstance(array, types.BaseTuple):
        return in_two
    return at_integer if isinstance(index, types.Integer) else at_tuple


@overload(lost, strict=False, jit_options=INLINE)
def _lost(fmt: Any, x: Any) -> Any:
    if _tag(fmt) in (*PAIRS, Wide):
        return lambda fmt, x: False
    if _tag(fmt) is DoubleDouble:
        return lambda fmt, x: x[0] != x[0]
    return lambda fmt, x: x != x


@overload(store, strict=False, jit_options=INLINE)
def _store(fmt: Any, array: Any, index: Any, x: Any) -> Any:
    def checked(fmt: Any, array: Any, index: Any, x: Any) -> None:
        if lost(fmt, x):
            raise OverflowError(BEYOND)
        put(fmt, array, index, x)

    return checked
