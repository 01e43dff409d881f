"""The errors of a filter run together with their contraction bound."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gpbnb.arithmetic.formats import FloatFormat
from gpbnb.filters.emulation import History, compare_runs
from gpbnb.filters.forms import Form
from gpbnb.filters.model import LinearModel, stored_measurements
from gpbnb.filters.run import Run, log_spaced, reference


@dataclass(frozen=True, eq=False)
class BoundedHistory:
    """A history, and the contraction bound for each entry of its errors, infinite if there is none."""

    history: History
    state: NDArray[np.float64]  # (c, n), in the units of the errors
    gain: NDArray[np.float64]  # (c, n, m), likewise
    covariance: NDArray[np.float64]  # (c, n, n), likewise; of its symmetric part

    def ratios(self) -> NDArray[np.float64]:
        """Largest error over bound of state, gain and covariance, after each step, (c, 3); above 1 if violated."""
        error = self.history.covariance
        symmetric = (error + np.swapaxes(error, 1, 2)) / 2
        pairs = ((self.history.state, self.state), (self.history.gain, self.gain), (symmetric, self.covariance))
        with np.errstate(divide="ignore", invalid="ignore"):
            each = [np.where(e == 0, 0.0, np.abs(e) / b).reshape(len(e), -1).max(axis=1) for e, b in pairs]
        return np.stack(each, axis=1)


def emulate_with_bound(
    model: LinearModel,
    z: Any,
    fmt: FloatFormat,
    form: Form | str = Form.INNOVATION,
    checkpoint_steps: Sequence[int] | None = None,
) -> BoundedHistory:
    """Run the filter rounded, in double-double, and with its contraction bound; for the arguments, see ``emulate``."""
    measured: Any = z if hasattr(z, "to_fractions") else stored_measurements(z, fmt)
    chosen = log_spaced(len(measured)) if checkpoint_steps is None else tuple(checkpoint_steps)
    run = Run(model, fmt, form, chosen, bounded=True)
    run.take(measured)
    history = compare_runs(run, reference(model.rounded(fmt), measured.to_fractions(), chosen))
    c = len(history.steps)
    state, gain, covariance = run.bounds
    return BoundedHistory(history, state[:c], gain[:c], covariance[:c])
