"""A filter run together with its contraction bound."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gpbnb.arithmetic.formats import FloatFormat
from gpbnb.arithmetic.kernels.backends import double_doubles
from gpbnb.filters.bounded_steps import advance_bound
from gpbnb.filters.contraction import contraction_start
from gpbnb.filters.emulation import History, compare_runs
from gpbnb.filters.factors import covariance_of_factors
from gpbnb.filters.forms import Form
from gpbnb.filters.kernels.step import NEXT_CHECKPOINT
from gpbnb.filters.model import LinearModel
from gpbnb.filters.run import BLOCK, Run, log_spaced, reference, widened


@dataclass(frozen=True, eq=False)
class BoundedHistory:
    """A history, and the contraction bound for each entry of its errors, infinite if there is none.

    Parameters
    ----------
    state, gain, covariance : (c, n), (c, n, m) and (c, n, n), in the units of the errors; of the covariance's
        symmetric part.
    """

    history: History
    state: NDArray[np.float64]
    gain: NDArray[np.float64]
    covariance: NDArray[np.float64]

    def ratios(self) -> NDArray[np.float64]:
        """Largest error over bound of state, gain and covariance, after each step, (c, 3); above 1 if violated."""
        error = self.history.covariance
        symmetric = (error + np.swapaxes(error, 1, 2)) / 2
        pairs = ((self.history.state, self.state), (self.history.gain, self.gain), (symmetric, self.covariance))
        with np.errstate(divide="ignore", invalid="ignore"):
            each = [np.where(e == 0, 0.0, np.abs(e) / b).reshape(len(e), -1).max(axis=1) for e, b in pairs]
        return np.stack(each, axis=1)


class BoundedRun(Run):
    """A run together with its contraction bound, :mod:`gpbnb.filters.contraction`; see ``Run``.

    For the reference itself, in double-double, the bound limits the distance from the exact filter.
    """

    def __init__(
        self, model: LinearModel, fmt: FloatFormat | None, form: Form | str, checkpoint_steps: Sequence[int]
    ) -> None:
        super().__init__(model, fmt, form, checkpoint_steps)
        self.stored = model if fmt is None else model.rounded(fmt)
        given = self.stored.to_float()
        self._plain = given["Phi"], given["H"], given["Q"], given["R"]
        self._exact = Run(self.stored, None, Form.INNOVATION, ()).matrices
        n, m, count = model.n, model.m, len(self.checkpoint_steps)
        self.bounds = np.full((count, n), np.inf), np.full((count, n, m), np.inf), np.full((count, n, n), np.inf)
        zero_n, size = np.zeros(n), np.zeros((n, n))
        if self.form is Form.UD:  # the first factors may have errors
            stored = covariance_of_factors(self.exactly(self.P))
            size = np.abs((stored - self.stored.P0).astype(np.float64)) * (1 + 2.0**-50)
        self.bound = contraction_start(given["P0"], zero_n, size)

    def take(self, z: Any) -> None:
        """Go on by as many steps as there are measurements, (steps, m)."""
        self.model.check_measurements(z, self.steps)
        if self.stopped or not len(z):
            return
        packed = self.pack_measurements(z)
        in_floats = packed.dtype == np.float64
        values = widened(packed) if in_floats else double_doubles(self.exactly(packed))
        for begin in range(0, len(packed), BLOCK):
            self._take_block(packed[begin : begin + BLOCK], values[begin : begin + BLOCK])
            if self.stopped:
                return

    def _take_block(self, z: NDArray[Any], exact_z: NDArray[Any]) -> None:
        """Take some steps, keep all their results, and extend the bound over them."""
        first, at = self.steps, int(self.notes[NEXT_CHECKPOINT])
        x, K, P = self.take_block(z)
        done = len(x) - 1
        if not done:
            return
        x, P, K, UR = (widened(each) for each in (x, P, K[1:], self.UR))
        steps = self.bound, self.checkpoint_steps, at, self.bounds
        try:
            self.bound = advance_bound(self.form, self._exact, self._plain, exact_z[:done], first, x, P, K, UR, *steps)
        except (OverflowError, ZeroDivisionError):  # beyond double-double: no bound from here on
            self.bound = self.bound._replace(eta=np.inf, zeta=np.inf)


def emulate_with_bound(
    model: LinearModel,
    z: Any,
    fmt: FloatFormat,
    form: Form | str = Form.INNOVATION,
    checkpoint_steps: Sequence[int] | None = None,
) -> BoundedHistory:
    """Run the filter rounded, in double-double, and with its contraction bound; for the arguments, see ``emulate``."""
    measured: Any = z if hasattr(z, "to_fractions") else fmt.array(z)
    chosen = log_spaced(len(measured)) if checkpoint_steps is None else tuple(checkpoint_steps)
    run = BoundedRun(model, fmt, form, chosen)
    run.take(measured)
    history = compare_runs(run, reference(run.stored, measured.to_fractions(), chosen))
    c = len(history.steps)
    state, gain, covariance = run.bounds
    return BoundedHistory(history, state[:c], gain[:c], covariance[:c])
