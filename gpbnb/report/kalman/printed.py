"""Evaluate (125) of hung1984, ch. II, for a run, with the quantities of (122) from this run."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gpbnb.arithmetic.formats import FloatFormat
from gpbnb.filters.checkpoints import Checkpoints
from gpbnb.filters.model import LinearModel
from gpbnb.report.kalman import report_bounds


@dataclass(frozen=True, eq=False)
class Terms:
    r"""Quantities of a run that (125) needs, after each of the first steps; arrays (c,).

    Parameters
    ----------
    n, m : dimensions of the state and of the measurement.
    x : :math:`\|x_k\|`, norm (21).
    u : largest :math:`\|u_i\|` so far, norm (21); by (122) with i = 0, B is at least this large.
    columns, rows : largest :math:`\|F_i\|` so far, in norm (22) and in the matrix norm compatible with (21).
    """

    n: int
    m: int
    x: NDArray[np.float64]
    u: NDArray[np.float64]
    columns: NDArray[np.float64]
    rows: NDArray[np.float64]

    def smallest_bound(self, fmt: FloatFormat, k: int, **faults: bool) -> float:
        """Return bound (125) at step k with the least B that any filter with these inputs could have.

        Parameters
        ----------
        fmt : format that defines β.
        k : 1 or more; beyond the last step, x and u of the last step are used.
        faults : faults to correct, as for :func:`gpbnb.report.kalman.report_bounds.coefficients`.
        """
        first, second = report_bounds.coefficients(k, self.n, self.m, **faults)
        last = min(k, len(self.x)) - 1
        return float(fmt.unit_roundoff) * (first * float(self.x[last]) + second * float(self.u[last]))

    def powers(self) -> float:
        r"""Return the power of ten of :math:`F^{k-1}`, a factor that B must contain, after the last step."""
        return (len(self.columns) - 1) * float(np.log10(self.columns[-1]))


def terms(model: LinearModel, true: Checkpoints) -> Terms:
    """Take the quantities of (122) from a run.

    Parameters
    ----------
    true : estimates and gains of each step, from the first step on.
    """
    if not true.steps or true.steps != tuple(range(1, len(true.steps) + 1)):
        raise ValueError(f"got the steps {true.steps[:4]} …; needed 1, 2, 3, …; take range(1, {len(true.steps) + 1})")
    given, c = model.to_float(), len(true.steps)
    x, K = true.x.astype(np.float64), true.K.astype(np.float64)
    at = np.arange(c)
    Phi, H = given["Phi"][at % len(given["Phi"])], given["H"][at % len(given["H"])]
    before = np.concatenate([given["x0"][np.newaxis], x[:-1]])
    F = Phi - K @ (H @ Phi)
    u = x - np.einsum("kij,kj->ki", F, before)  # (111)
    size = np.abs(F)
    so_far = np.maximum.accumulate
    return Terms(
        model.n,
        model.m,
        np.abs(x).max(axis=1),
        so_far(np.abs(u).max(axis=1)),
        so_far(size.sum(axis=1).max(axis=1)),
        so_far(size.sum(axis=2).max(axis=1)),
    )
