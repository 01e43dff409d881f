r"""The probable error, for comparison with the worst case: rounding errors as independent noise.

Each rounding error is assumed uniform within its limit and independent of all others. Their covariance evolves as
:math:`\Sigma_k = \hat F_k\Sigma_{k-1}\hat F_k^T + \Gamma_k\operatorname{diag}(\sigma^2)\Gamma_k^T`, and converges to
the solution of a Lyapunov equation. Errors of gain and stored closed loop are not noise and are omitted. The result is
an estimate, not a bound. It is too small for chopped arithmetic, whose errors have a nonzero mean.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from gpbnb.bounds.envelope import Disturbances
from gpbnb.bounds.guarantee import Guarantee, disturbances_of
from gpbnb.filters.structures import steady_covariance


def separate_roundings(found: Guarantee) -> Disturbances:
    """Return disturbances with a column for each operation, even if operations have the same effect.

    A bound adds up the limits of operations with the same effect. Their variances must be added one by one, because
    the largest of them usually outweighs the others.
    """
    program = found.schedule.program
    each = np.arange(len(program.operations))
    alone = replace(program, groups=each, roots=each)
    return disturbances_of(replace(found, schedule=replace(found.schedule, program=alone)))


def probable_error(found: Guarantee) -> NDArray[np.float64]:
    """Return the standard deviation of each state's rounding error, the largest over a period; (n,).

    Values are assumed to be as large as their limits allow; smaller values have smaller rounding errors.

    Raises
    ------
    ValueError : the guarantee does not hold for ever.
    """
    given = found.schedule
    if not found.for_ever:
        raise ValueError(
            f"got a filter without a steady state: {found.why}; needed a filter with a bound that holds for all steps"
        )
    each = separate_roundings(found)
    count, first = len(given.program.operations), given.first
    F, G, variance = each.F[first:], each.G[first:, :, :count], each.limits[first:, :count] ** 2 / 3
    noise = np.einsum("kig,kg,kjg->kij", G, variance, G)
    whole, gathered = np.eye(given.program.n), np.zeros_like(noise[0])
    for loop, added in zip(F, noise, strict=True):
        whole, gathered = loop @ whole, loop @ gathered @ loop.T + added
    covariance = steady_covariance(whole, gathered)
    largest = np.diagonal(covariance).copy()
    for loop, added in zip(F, noise, strict=True):
        covariance = loop @ covariance @ loop.T + added
        largest = np.maximum(largest, np.diagonal(covariance))
    return np.sqrt(largest)
