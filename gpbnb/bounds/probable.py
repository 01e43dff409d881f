r"""The probable error, for comparison with the worst case: rounding errors as independent noise.

Each rounding error is assumed uniform within its limit and independent of all others. Their covariance evolves as
:math:`\Sigma_k = \hat F_k\Sigma_{k-1}\hat F_k^T + \Gamma_k\operatorname{diag}(\sigma^2)\Gamma_k^T`, and converges to
the solution of a Lyapunov equation. Errors of gain and stored closed loop are not noise and are omitted. The result is
an estimate, not a bound. It is too small for chopped arithmetic, whose errors have a nonzero mean.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from gpbnb.arithmetic.fixed import FixedFormat
from gpbnb.arithmetic.formats import FloatFormat
from gpbnb.bounds.gains import filter_schedule
from gpbnb.bounds.guarantee import FilterGuarantee, from_schedule, limits
from gpbnb.bounds.guess import float_errors, linear_steps, rounding_errors, value_sizes
from gpbnb.bounds.system import Recursion
from gpbnb.filters.system import LinearSystem
from gpbnb.filters.word_formats import WordFormats


class StepRoundings(NamedTuple):
    """Roundings of the steps of a period."""

    F: NDArray[np.float64]  # (steps, n, n), closed loops
    effects: NDArray[np.float64]  # (steps, n, o), of an error of each operation on the states after the step
    errors: NDArray[np.float64]  # (steps, o), the largest of each operation


def separate_roundings(found: FilterGuarantee) -> StepRoundings:
    """Return the roundings of a period, one by one, even if operations have the same effect."""
    if not found.for_ever:
        raise ValueError(
            f"got a guarantee for {found.steps} steps: {found.why}; needed one that holds for ever, whose gain settles"
        )
    given, program = found.schedule, found.schedule.program
    steps = linear_steps(given, np.arange(given.first, given.steps))
    sizes, ends = value_sizes(steps, found.limits), found.limits.state + found.bound
    h = rounding_errors(program, steps, sizes, ends, found.bound, float_errors(program, given.fmt, steps))
    return StepRoundings(steps.F, steps.effects[program.n + program.m :].transpose(1, 2, 0), h.T)


def probable_error(found: FilterGuarantee) -> NDArray[np.float64]:
    """Return the standard deviation of each state's rounding error, the largest over a period; (n,).

    Values are assumed to be as large as their limits allow; smaller values have smaller rounding errors.
    """
    F, G, errors = separate_roundings(found)
    noise = np.einsum("kig,kg,kjg->kij", G, errors**2 / 3, G)
    whole, gathered = np.eye(F.shape[1]), np.zeros_like(noise[0])
    for loop, added in zip(F, noise, strict=True):
        whole, gathered = loop @ whole, loop @ gathered @ loop.T + added
    system = np.eye(whole.size) - np.kron(whole, whole)
    covariance = np.linalg.solve(system, gathered.ravel()).reshape(whole.shape)
    largest = np.diagonal(covariance).copy()
    for loop, added in zip(F, noise, strict=True):
        covariance = loop @ covariance @ loop.T + added
        largest = np.maximum(largest, np.diagonal(covariance))
    return np.asarray(np.sqrt(largest))


def probable_output_errors(
    system: LinearSystem, largest: NDArray[np.float64], fmt: FloatFormat | FixedFormat | WordFormats
) -> NDArray[np.float64]:
    """Estimate the error of each output, (p,): three deviations of roundings, and bounds of errors of storing.

    Words must have one format for data, coefficients and sums; others are refused earlier.
    """
    fmt = fmt.data if isinstance(fmt, WordFormats) else fmt
    if cause := system.unstable(fmt):
        raise ValueError(cause)
    made = system.as_filter()
    whole = Recursion(made, largest, None).guess(fmt).bound
    found = from_schedule(filter_schedule(made, fmt), limits(measurement=largest), proved=False)
    return np.asarray(whole - found.bound + 3 * probable_error(found))[system.n :]
