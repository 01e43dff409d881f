"""A filter in as many bits as necessary, for models whose reference double-double cannot compute.

The innovation form subtracts most of a large variance when a sensor is precise. It then loses as many digits as
:math:`HPH^T` is larger than R.
"""

from __future__ import annotations

from fractions import Fraction
from typing import Any

import numpy as np
from flint import arb, arb_mat, ctx, fmpq
from numpy.typing import NDArray

from gpbnb.arithmetic.rational import exact
from gpbnb.filters.model import LinearModel

BITS = 256
"""Bits of the first run; each further run has twice as many."""

MOST_BITS = 4096
"""Bits of the last run."""

MOST_STEPS = 100_000
"""Largest number of steps; a thousand take roughly a second."""

AGREEMENT = 2.0**-104
"""Largest difference of two runs, relative to the largest value of each entry over all steps."""

Step = tuple[NDArray[Any], NDArray[Any], NDArray[Any]]


def precise_steps(model: LinearModel, z: Any) -> list[Step]:
    """Return estimate (n,), gain (n, m) and covariance (n, n) after every step, in bits that agree with twice as many.

    Parameters
    ----------
    model : also with known inputs and offsets.
    z : (steps, m), measurements.

    Returns
    -------
    steps : exact values of high-precision results, as Fractions.

    Raises
    ------
    ArithmeticError : results that depend on the number of bits, up to :data:`MOST_BITS`; too many steps.
    """
    if len(z) > MOST_STEPS:
        raise ArithmeticError(
            f"{model.name}: its reference needs more than double-double, and {len(z):,} steps; needed at most "
            f"{MOST_STEPS:,}: R is very small beside H P H', or P0 very large; scale or correct the model"
        )
    measured, bits, found = exact(z), BITS, None
    while bits <= MOST_BITS:
        before, found = found, _steps(model, measured, bits)
        if before and found and _agree(before, found):
            return found
        bits *= 2
    raise ArithmeticError(
        f"{model.name}: its reference is not determined in {MOST_BITS} bits; the innovation covariance may be "
        "singular: scale or correct the model"
    )


def _agree(some: list[Step], others: list[Step]) -> bool:
    """Whether two runs agree, relative to the largest value of each entry."""
    for k in range(3):
        one, other = (np.array([step[k] for step in steps]) for steps in (some, others))
        if np.any(np.max(np.abs(one - other), axis=0) > np.max(np.abs(other), axis=0) * Fraction(AGREEMENT)):
            return False
    return True


def _steps(model: LinearModel, z: NDArray[Any], bits: int) -> list[Step] | None:
    """Return all steps in some bits; None if an innovation covariance is singular in them."""
    found: list[Step] = []
    with ctx.workprec(bits):
        Phi, H, Q, R = ([_matrix(each) for each in cycle] for cycle in (model.Phi, model.H, model.Q, model.R))
        x, P = _matrix(model.x0[:, None]), _matrix(model.P0)
        for k, measured in enumerate(z):
            phi, h = Phi[k % len(Phi)], H[k % len(H)]
            state, offset = model.known(k)
            predicted = (phi * P * phi.transpose() + Q[k % len(Q)]).mid()
            PH = predicted * h.transpose()
            try:
                K = (PH * (h * PH + R[k % len(R)]).mid().inv()).mid()
            except ZeroDivisionError:
                return None
            P = (predicted - K * h * predicted).mid()
            ahead = phi * x + _matrix(state[:, None])
            x = (ahead + K * (_matrix((measured - offset)[:, None]) - h * ahead)).mid()
            found.append((_fractions(x)[:, 0], _fractions(K), _fractions(P)))
    return found


def _matrix(entries: NDArray[Any]) -> arb_mat:
    return arb_mat([[arb(fmpq(each.numerator, each.denominator)) for each in row] for row in entries])


def _fractions(matrix: arb_mat) -> NDArray[Any]:
    def entry(value: arb) -> Fraction:
        mantissa, exponent = value.mid().man_exp()
        return Fraction(int(mantissa)) * Fraction(2) ** int(exponent)

    return np.array([[entry(value) for value in row] for row in matrix.tolist()], dtype=object)
