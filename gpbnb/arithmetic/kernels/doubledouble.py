"""The reference arithmetic: unevaluated sums of two float64, with a relative error below 2**-102 per operation.

A number is ``(high, low)`` with high = fl(high + low). The algorithms and their error bounds, u = 2**-53, are those of
Joldes, Muller and Popescu, Tight and rigorous error bounds for basic building blocks of double-word arithmetic, ACM
TOMS 44 (2017): 3 u**2 for sums, 4 u**2 for products and 15 u**2 for quotients; and of Lefevre et al., ACM TOMS 49
(2023): 25/8 u**2 for square roots.

A result below 2**-850, which may be less accurate, or of at least 2**1000 becomes NaN, and later results stay NaN.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from gpbnb.arithmetic.kernels.bits import fma, select
from gpbnb.arithmetic.kernels.compiling import inner

LEAST, LIMIT = 2.0**-850, 2.0**1000


@inner(forceinline=True)
def two_sum(a: Any, b: Any) -> Any:
    s = a + b
    c = s - a
    return s, (a - (s - c)) + (b - c)


@inner(forceinline=True)
def _fast_two_sum(a: Any, b: Any) -> Any:
    s = a + b
    return s, b - (s - a)


@inner(forceinline=True)
def _within_range(high: Any, low: Any, exact_zero: Any) -> Any:
    size = abs(high)
    within = ((size >= LEAST) & (size < LIMIT)) | (exact_zero & (size == 0.0))
    return select(within, high + 0.0, np.nan), select(within, low + 0.0, np.nan)


@inner(forceinline=True)
def add(fmt: Any, a: Any, b: Any) -> Any:
    s, e = two_sum(a[0], b[0])
    t, f = two_sum(a[1], b[1])
    s, e = _fast_two_sum(s, e + t)
    s, e = _fast_two_sum(s, e + f)
    return _within_range(s, e, s == 0.0)


@inner(forceinline=True)
def opposite(fmt: Any, a: Any) -> Any:
    return 0.0 - a[0], 0.0 - a[1]


negative = opposite


@inner(forceinline=True)
def subtract(fmt: Any, a: Any, b: Any) -> Any:
    return add(fmt, a, opposite(fmt, b))


@inner(forceinline=True)
def multiply(fmt: Any, a: Any, b: Any) -> Any:
    p = a[0] * b[0]
    e = fma(a[0], b[0], -p)
    e += fma(a[0], b[1], fma(a[1], b[0], a[1] * b[1]))
    p, e = _fast_two_sum(p, e)
    return _within_range(p, e, (a[0] == 0.0) | (b[0] == 0.0))


@inner(error_model="numpy", forceinline=True)
def divide(fmt: Any, a: Any, b: Any) -> Any:
    q = a[0] / b[0]
    p = b[0] * q
    e = fma(b[0], q, -p)
    p, e = _fast_two_sum(p, fma(b[1], q, e))
    q, low = _fast_two_sum(q, ((a[0] - p) + (a[1] - e)) / b[0])
    return _within_range(q, low, a[0] == 0.0)


@inner(error_model="numpy", forceinline=True)
def sqrt(fmt: Any, a: Any) -> Any:
    if a[0] == 0.0:
        return 0.0, 0.0
    s = math.sqrt(a[0])
    s, low = _fast_two_sum(s, (fma(-s, s, a[0]) + a[1]) / (2.0 * s))
    return _within_range(s, low, a[0] == 0.0)


@inner(forceinline=True)
def round_(fmt: Any, x: Any) -> Any:
    high, low = two_sum(x[0], x[1])
    return _within_range(high, low, x[0] == 0.0 and x[1] == 0.0)


@inner(forceinline=True)
def compare(fmt: Any, a: Any, b: Any) -> Any:
    high = (a[0] > b[0]) - (a[0] < b[0])
    return high if high != 0 else (a[1] > b[1]) - (a[1] < b[1])


@inner(forceinline=True)
def load(fmt: Any, floats: Any, k: Any) -> Any:
    """The pair k."""
    return floats[2 * k], floats[2 * k + 1]


@inner(forceinline=True)
def put(fmt: Any, floats: Any, k: Any, x: Any) -> None:
    floats[2 * k], floats[2 * k + 1] = x
