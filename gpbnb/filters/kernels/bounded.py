"""Compiled comparison of a run with its steps repeated in double-double, for the contraction bound.

The long functions do not depend on the format of the run, because its results are converted to double-double first. So
they are compiled once, not once for each arithmetic.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numba.extending import overload

from gpbnb.arithmetic.kernels import doubledouble
from gpbnb.arithmetic.kernels.compiling import borrowing, compiled
from gpbnb.arithmetic.kernels.matrices import copy, is_zero, product
from gpbnb.arithmetic.kernels.scalar import add, load, multiply, one, put, store, subtract, zero
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
            x = doubledouble.multiply(DoubleDouble(), x, (_POWERS[min(e, 22)], 0.0))
            e -= min(e, 22)
        while e < 0:
            x = doubledouble.divide(DoubleDouble(), x, (_POWERS[min(-e, 22)], 0.0))
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


@compiled
def symmetric_parts(given: Any, covariances: Any) -> None:
    """Symmetric parts of covariances, (k, n, n, 2)."""
    exactly, half = DoubleDouble(), (0.5, 0.0)
    for k in range(given.shape[0]):
        for i in range(given.shape[1]):
            for j in range(i + 1):
                total = add(exactly, load(exactly, given, (k, i, j)), load(exactly, given, (k, j, i)))
                x = multiply(exactly, total, half)
                put(exactly, covariances, (k, i, j), x)
                put(exactly, covariances, (k, j, i), x)


@compiled
def represented(factors: Any, covariances: Any) -> None:
    """Covariances (k, n, n, 2) that factors represent, of which each matrix has D on its diagonal and U above."""
    exactly, n = DoubleDouble(), factors.shape[1]
    U, UD = np.empty((n, n, 2)), np.empty((n, n, 2))
    for k in range(factors.shape[0]):
        a = factors[k]
        for i in range(n):
            for j in range(n):
                d = load(exactly, a, (j, j))
                u = load(exactly, a, (i, j)) if i < j else one(exactly) if i == j else zero(exactly)
                put(exactly, U, (j, i), u)
                put(exactly, UD, (i, j), multiply(exactly, u, d))
        product(exactly, UD, U, covariances[k])


@borrowing
def _decorrelate(fmt: Any, UR: Any, a: Any, c: Any) -> None:
    """c = the inverse of U times a, by back substitution, where R = U D U'."""
    for j in range(a.shape[1]):
        for i in range(a.shape[0] - 1, -1, -1):
            s = load(fmt, a, (i, j))
            for k in range(i + 1, a.shape[0]):
                u = load(fmt, UR, (i, k))
                if not is_zero(fmt, u):
                    s = subtract(fmt, s, multiply(fmt, u, load(fmt, c, (k, j))))
            store(fmt, c, (i, j), s)


@compiled
def whole_gain(K: Any, H: Any, UR: Any, c: Any) -> None:
    """c = the gain of a step in the UD form, combined from the gains of its single measurements."""
    n, m = K.shape[0], K.shape[1]
    exactly = DoubleDouble()
    copy(exactly, K, c)
    HD = np.empty_like(H)
    _decorrelate(exactly, UR, H, HD)
    for i in range(m):
        for j in range(i):
            s = zero(exactly)
            for k in range(n):
                s = add(exactly, s, multiply(exactly, load(exactly, HD, (i, k)), load(exactly, c, (k, j))))
            for k in range(n):
                x = multiply(exactly, load(exactly, K, (k, i)), s)
                put(exactly, c, (k, j), subtract(exactly, load(exactly, c, (k, j)), x))
    for j in range(1, m):
        for i in range(j):
            u = load(exactly, UR, (i, j))
            for k in range(n):
                x = multiply(exactly, load(exactly, c, (k, i)), u)
                put(exactly, c, (k, j), subtract(exactly, load(exactly, c, (k, j)), x))


@compiled
def residuals(exact_model: Any, exact_z: Any, first: int, x: Any, P: Any, repeated: Any, out: Any) -> None:
    """Residuals for the contraction bound: compare each step of a run with its repetition in double-double.

    Parameters
    ----------
    exact_model : the stored model in double-double, as ``Run.matrices``.
    exact_z : (steps, m, 1, 2), the measurements.
    first : number of steps taken before these.
    x, P : (steps + 1, n, 1, 2) and (steps + 1, n, n, 2), states and symmetric covariances of the run.
    repeated : states and covariances after each repeated step; the covariances are symmetrized in place.
    out : for each step, in float64: the innovation (m,), and the run's state and covariance minus the repeated ones,
        (n,) and (n, n).
    """
    exactly, half = DoubleDouble(), (0.5, 0.0)
    xe, Pe = repeated
    innovation, q, T = out
    n, m = x.shape[1], exact_z.shape[1]
    y, hx = np.empty((m, 1, 2)), np.empty((n, 1, 2))
    Phi, H = exact_model.Phi, exact_model.H
    for step in range(exact_z.shape[0]):
        k = first + step
        product(exactly, Phi[k % Phi.shape[0]], x[step], hx)
        product(exactly, H[k % H.shape[0]], hx, y)
        for i in range(m):
            innovation[step, i] = subtract(exactly, load(exactly, exact_z, (step, i, 0)), load(exactly, y, (i, 0)))[0]
        for i in range(n):
            q[step, i] = subtract(exactly, load(exactly, x, (step + 1, i, 0)), load(exactly, xe, (step, i, 0)))[0]
            for j in range(i):
                total = add(exactly, load(exactly, Pe, (step, i, j)), load(exactly, Pe, (step, j, i)))
                put(exactly, Pe, (step, i, j), multiply(exactly, total, half))
                put(exactly, Pe, (step, j, i), load(exactly, Pe, (step, i, j)))
        for i in range(n):
            for j in range(n):
                error = subtract(exactly, load(exactly, P, (step + 1, i, j)), load(exactly, Pe, (step, i, j)))
                T[step, i, j] = error[0]
