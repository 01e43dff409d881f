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
from gpbnb.arithmetic.kernels.tags import DIVIDE, MULTIPLY, ROOT, ROUND, SUBTRACT

LEAST, LIMIT = 2.0**-850, 2.0**1000


@inner(forceinline=True)
def two_sum(a: Any, b: Any) -> Any:
    s = a + b
    c = s - a
    return s, (a - (s - c)) + (b - c)


@inner(error_model="numpy", forceinline=True)
def operate(operation: Any, a: Any, b: Any) -> Any:
    """The result of an operation on one or two numbers: a sum, product, quotient, root, rounded sum or the opposite."""
    x, y = a
    c, d = b
    zero = True  # whether a result of zero is exact
    if operation <= SUBTRACT:
        c, d = (-c, -d) if operation == SUBTRACT else (c, d)
        s, e = two_sum(x, c)
        t, f = two_sum(y, d)
        e += t
        high = s + e
        low = (e - (high - s)) + f
    elif operation == MULTIPLY:
        high = x * c
        low = fma(x, c, -high) + fma(x, d, fma(y, c, y * d))
        zero = (x == 0.0) | (c == 0.0)
    elif operation == DIVIDE:
        high = x / c
        t = c * high
        e = fma(d, high, fma(c, high, -t))
        p = t + e
        low = ((x - p) + (y - (e - (p - t)))) / c
        zero = x == 0.0
    elif operation == ROOT:
        high = math.sqrt(x)
        low = 0.0 if x == 0.0 else (fma(-high, high, x) + y) / (2.0 * high)
    elif operation == ROUND:
        high, low = two_sum(x, y)
        zero = (x == 0.0) & (y == 0.0)
    else:
        high, low = -x, -y
    s = high + low
    low -= s - high
    size = abs(s)
    within = ((size >= LEAST) & (size < LIMIT)) | (zero & (size == 0.0))
    return select(within, s + 0.0, np.nan), select(within, low + 0.0, np.nan)


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
