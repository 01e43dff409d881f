"""One filter for many measurement records at once.

Covariance and gain do not depend on the measurements. They are computed once a step, and the estimates of all records
are the columns of one matrix. Each record gets the digits that a run of its own would give.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numba import njit
from numba.extending import overload
from numpy.typing import NDArray

from gpbnb.arithmetic.formats import FloatFormat
from gpbnb.arithmetic.kernels.scalar import load
from gpbnb.arithmetic.kernels.tags import Decimal, DoubleDouble, ShortDecimal
from gpbnb.kalman.experiment import Form, Run, _note, _step, _workspace
from gpbnb.kalman.model import LinearModel

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


@njit(cache=True, nogil=True)
def carry(
    fmt: Any, form: int, model: Any, z: Any, first: int, x: Any, P: Any, marks: Any, kept: Any, notes: Any, out: Any
) -> None:
    """Go on from the step `first` by as many as z has; after each step, the first states of all records are put out."""
    work = _workspace(x, P, model[3][0], model[2][0], model[5][0], z[0])
    X, G, C = kept
    for step in range(z.shape[0]):
        answer = _step(fmt, form, model, first + step, z[step], x, P, work)
        if not _note(fmt, first + step, answer, x, work[1][0], P, marks, X, G, C, notes):
            return
        for i in range(out.shape[1]):
            for j in range(out.shape[2]):
                out[step, i, j] = _as_float(fmt, load(fmt, x, (i, j)))


@njit(cache=True, nogil=True)
def update_largest(computed: Any, true: Any, steps: int, largest: Any) -> None:
    """Raise `largest` (states, records) to the largest difference of any of the first steps; NaN counts as infinite."""
    for step in range(steps):
        for i in range(largest.shape[0]):
            for j in range(largest.shape[1]):
                error = abs(computed[step, i, j] - true[step, i, j])
                if not error <= largest[i, j]:
                    largest[i, j] = error if error == error else np.inf


class Records(Run):
    """A filter whose gain serves the estimates of many records.

    Parameters
    ----------
    model, fmt, form : as of :class:`Run`; not the UD form, which computes gain and estimate together.
    records : how many.

    Raises
    ------
    ValueError : the UD form, or no records.
    """

    def __init__(self, model: LinearModel, fmt: FloatFormat | None, form: Form, records: int) -> None:
        if form is Form.UD or records < 1:
            raise ValueError(
                f"got the {form} form and {records} records; needed at least one record, and a form whose gain does "
                "not depend on the measurements: any but UD"
            )
        super().__init__(model, fmt, form, ())
        self.records = records
        self.x = np.ascontiguousarray(np.repeat(self.x, records, axis=1))
        self.X = np.zeros((0, *self.x.shape), self.x.dtype)

    def carry(self, z: NDArray[np.float64], states: int) -> NDArray[np.float64]:
        """Take the next measurements of all records.

        Parameters
        ----------
        z : (steps, m, records).
        states : how many of the first states to return.

        Returns
        -------
        estimates : (steps, states, records), the nearest float64; NaN from the step on at which the filter stopped.
        """
        if np.ndim(z) != 3 or np.shape(z)[1:] != (self.model.m, self.records):
            raise ValueError(f"got measurements of shape {np.shape(z)}; needed (steps, {self.model.m}, {self.records})")
        out = np.full((len(z), states, self.records), np.nan)
        if self.stopped or not len(z):
            return out
        before = self.steps
        kept = (self.marks, (self.X, self.G, self.C), self.notes)
        try:
            carry(self.tag, int(self.form), self._parts, self._packed(z), before, self.x, self.P, *kept, out)
        except (OverflowError, ZeroDivisionError):
            self.notes[3] = self.steps + 1
        out[self.steps - before :] = np.nan
        return out
