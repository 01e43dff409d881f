"""Compiled conversion of a run's numbers to double-double."""

from __future__ import annotations

from typing import Any

import numpy as np
from numba.extending import overload

from gpbnb.arithmetic.kernels import doubledouble, tags
from gpbnb.arithmetic.kernels.compiling import compiled
from gpbnb.arithmetic.kernels.scalar import load
from gpbnb.arithmetic.kernels.tags import PAIRS, DoubleDouble

_POWERS = np.array([10.0**k for k in range(23)])  # exact


def widened(fmt: Any, a: Any) -> Any:
    """Convert a number to double-double: exactly in bases 2 and 16, within four roundings in base 10."""
    raise TypeError("got a call of widened from Python; needed one from a function compiled by numba")


@overload(widened, strict=False, jit_options={"forceinline": True, "no_cfunc_wrapper": True})
def _overloaded_widened(fmt: Any, a: Any) -> Any:
    tag = getattr(fmt, "instance_class", None)

    def of_float(fmt: Any, a: Any) -> Any:
        return a, 0.0

    def of_pair(fmt: Any, a: Any) -> Any:
        high = np.float64(a[0])
        x, e = (high, np.float64(a[0] - np.int64(high))), a[1]
        while e > 0:
            x = doubledouble.operate(tags.MULTIPLY, x, (_POWERS[min(e, 22)], 0.0))
            e -= min(e, 22)
        while e < 0:
            x = doubledouble.operate(tags.DIVIDE, x, (_POWERS[min(-e, 22)], 0.0))
            e += min(-e, 22)
        return x

    if tag is DoubleDouble:
        return lambda fmt, a: a
    return of_pair if tag in PAIRS else of_float


@compiled
def widen(fmt: Any, packed: Any, wide: Any) -> None:
    """Convert the packed numbers of a format, (k, n, m), to double-double, (k, n, m, 2)."""
    for k in range(wide.shape[0]):
        for i in range(wide.shape[1]):
            for j in range(wide.shape[2]):
                wide[k, i, j, 0], wide[k, i, j, 1] = widened(fmt, load(fmt, packed, (k, i, j)))
