"""One filter for many measurement records at once.

Covariance and gain do not depend on the measurements. They are computed once per step, and the estimates of all
records are the columns of one matrix. Each record gets the same digits as in a separate run.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from gpbnb.arithmetic.formats import FloatFormat
from gpbnb.filters.forms import Form
from gpbnb.filters.kernels.records import pairs_as_floats
from gpbnb.filters.kernels.step import DONE, INDEFINITE, NEXT_CHECKPOINT, STOPPED
from gpbnb.filters.model import LinearModel
from gpbnb.filters.run import Run

_BLOCK = 1024  # steps whose estimates of all records are kept at once


class Records(Run):
    """A filter whose gain serves the estimates of many records.

    Parameters
    ----------
    model, fmt, form : as for :class:`~gpbnb.filters.run.Run`; not the UD form, which computes gain and estimate
        together.
    records : number of records.

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

    def use_measurement_matrices(self, H: NDArray[np.float64], decimals: int | None = None) -> None:
        """Replace the cycle of measurement matrices, (p, m, n), whose entries are rounded into the format.

        Parameters
        ----------
        decimals : if given, entries are first rounded to this number of decimals, which is exact in base 10 and fast.
        """
        if np.shape(H)[1:] != (self.model.m, self.model.n):
            raise ValueError(f"got H of shape {np.shape(H)}; needed (p, {self.model.m}, {self.model.n})")
        if decimals is not None and self.fmt is not None and self.fmt.base == 10:
            packed = self.as_packed(np.rint(H * 10.0**decimals))
            packed[..., 1] -= np.where(packed[..., 0] == 0, 0, decimals)
        else:
            packed = self.as_packed(H)
        transposed = np.ascontiguousarray(np.swapaxes(packed, 1, 2))
        self.matrices = (*self.matrices[:2], packed, transposed, *self.matrices[4:])

    def carry(self, z: NDArray[np.float64], states: int) -> NDArray[np.float64]:
        """Take the next measurements of all records.

        Parameters
        ----------
        z : (steps, m, records).
        states : number of first states to return.

        Returns
        -------
        estimates : (steps, states, records), the nearest float64; NaN from the step on at which the filter stopped.
        """
        if np.ndim(z) != 3 or np.shape(z)[1:] != (self.model.m, self.records):
            raise ValueError(f"got measurements of shape {np.shape(z)}; needed (steps, {self.model.m}, {self.records})")
        out = np.full((len(z), states, self.records), np.nan)
        if self.stopped or not len(z):
            return out
        for begin in range(0, len(z), _BLOCK):
            self._carry_block(self.as_packed(z[begin : begin + _BLOCK]), out[begin : begin + _BLOCK])
            if self.stopped:
                break
        return out

    def _carry_block(self, z: NDArray[Any], out: NDArray[np.float64]) -> None:
        before, notes = self.steps, self.notes.copy()
        X, G, C = (np.empty((len(z), *each.shape[1:]), each.dtype) for each in (self.X, self.G, self.C))
        notes[NEXT_CHECKPOINT] = 0
        try:
            self.advance(z, (np.arange(before + 1, before + len(z) + 1), X, G, C), notes)
        except (OverflowError, ZeroDivisionError):
            notes[STOPPED] = notes[DONE] + 1
        self.notes[[DONE, INDEFINITE, STOPPED]] = notes[[DONE, INDEFINITE, STOPPED]]
        done = slice(0, self.steps - before)
        estimates = X[done, : out.shape[1]]
        if estimates.dtype == np.float64:
            out[done] = estimates if estimates.ndim == 3 else estimates[..., 0]
        else:
            pairs_as_floats(estimates, out[done])
