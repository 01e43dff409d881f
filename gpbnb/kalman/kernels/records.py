"""Compiled: one gain for the estimates of many records, and the largest of their errors."""

from __future__ import annotations

from typing import Any

import numpy as np
from numba.extending import overload

from gpbnb.arithmetic.kernels.compiling import compiled
from gpbnb.arithmetic.kernels.scalar import load
from gpbnb.arithmetic.kernels.tags import Decimal, DoubleDouble, ShortDecimal
from gpbnb.kalman.kernels.step import filter_step, record_step, workspace

_POWERS = np.array([10.0**k for k in range(23)])  # exact


def _as_float(fmt: Any, a: Any) -> Any:
    """A number of a format as a float64, with an error of two roundings at most."""
    raise TypeError("got a call of _as_float from Python; needed one from a function compiled by numba")


@overload(_as_float, strict=False, jit_options={"forceinline": True})
def _overloaded_as_float(fmt: Any, a: Any) -> Any:
    tag = getattr(fmt, "instance_class", None)

    def of_pair(fmt: Any, a: Any) -> Any:
        m, e = np.float64(a[0]), a[1]
        if -22 <= e <= 0:
            return m / _POWERS[-e]
        return m * _POWERS[e] if 0 < e <= 22 else m * 10.0**e

    if tag is DoubleDouble:
        return lambda fmt, a: a[0]
    return of_pair if tag in (Decimal, ShortDecimal) else lambda fmt, a: a


@compiled
def advance_records(
    fmt: Any,
    form: int,
    model: Any,
    z: Any,
    first: int,
    x: Any,
    P: Any,
    checkpoint_steps: Any,
    kept: Any,
    notes: Any,
    out: Any,
) -> None:
    """Take as many steps as z has; after each, write the first states of all records to `out`."""
    work = workspace(x, P, model[3][0], model[2][0], model[5][0], z[0])
    X, G, C = kept
    for step in range(z.shape[0]):
        answer = filter_step(fmt, form, model, first + step, z[step], x, P, work)
        if not record_step(fmt, first + step, answer, x, work[1][0], P, checkpoint_steps, X, G, C, notes):
            return
        for i in range(out.shape[1]):
            for j in range(out.shape[2]):
                out[step, i, j] = _as_float(fmt, load(fmt, x, (i, j)))


@compiled
def update_largest(computed: Any, true: Any, largest: Any) -> None:
    """Raise `largest` (states, records) to the largest difference of any step; NaN counts as infinite."""
    for step in range(computed.shape[0]):
        for i in range(largest.shape[0]):
            for j in range(largest.shape[1]):
                error = abs(computed[step, i, j] - true[step, i, j])
                if not error <= largest[i, j]:
                    largest[i, j] = error if error == error else np.inf
