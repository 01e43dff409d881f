"""A filter in as many bits as necessary, for models whose reference double-double cannot compute.

The innovation form subtracts most of a large variance when a sensor is precise. It then loses as many digits as
:math:`HPH^T` is larger than R.
"""

from __future__ import annotations

import operator
from collections.abc import Callable
from fractions import Fraction
from typing import Any

import numpy as np
from flint import arb, arb_mat, ctx, fmpq
from numpy.typing import NDArray

from gpbnb.arithmetic.algebra import Algebra, Inverse
from gpbnb.arithmetic.conversion import exact_fraction
from gpbnb.arithmetic.rational import exact
from gpbnb.filters.forms import Form
from gpbnb.filters.kalman_step import StepModel, corrected, gain, predicted, updated
from gpbnb.filters.model import LinearModel

BITS = 256
"""Bits of the first run; each further run has twice as many."""

MOST_BITS = 4096
"""Bits of the last run."""

MOST_STEPS = 100_000
"""Largest number of steps; a thousand take roughly a second."""

AGREEMENT = 2.0**-104
"""Largest difference of two runs, relative to the largest value of each entry over all steps."""

SINGULAR = "the innovation covariance may be singular"
"""Why a reference is not determined, unless a run says more."""

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
    """
    measured = exact(z)
    return agreed(model.name, len(measured), lambda bits: _steps(model, measured, bits))


def agreed(name: str, count: int, steps: Callable[[int], list[Step] | str]) -> list[Step]:
    """Return steps in bits that agree with twice as many.

    Parameters
    ----------
    name : name of the model.
    count : number of steps.
    steps : function that returns all steps in a number of bits, or why they cannot be computed in them.
    """
    if count > MOST_STEPS:
        raise ArithmeticError(
            f"{name}: its reference needs more than double-double, and {count:,} steps; needed at most "
            f"{MOST_STEPS:,}: R is very small beside H P H', or P0 very large; scale or correct the model"
        )
    bits = BITS
    found: list[Step] | str = SINGULAR
    while bits <= MOST_BITS:
        before, found = found, steps(bits)
        if not isinstance(before, str) and not isinstance(found, str) and _agree(before, found):
            return found
        bits *= 2
    why = found if isinstance(found, str) else SINGULAR
    raise ArithmeticError(
        f"{name}: its reference is not determined in {MOST_BITS} bits; {why}: scale or correct the model"
    )


def _agree(some: list[Step], others: list[Step]) -> bool:
    """Whether two runs agree, relative to the largest value of each entry."""
    for k in range(3):
        one, other = (np.array([step[k] for step in steps]) for steps in (some, others))
        if np.any(np.max(np.abs(one - other), axis=0) > np.max(np.abs(other), axis=0) * Fraction(AGREEMENT)):
            return False
    return True


def _steps(model: LinearModel, z: NDArray[Any], bits: int) -> list[Step] | str:
    """Return all steps in some bits, or why there are none: an innovation covariance is singular in them."""
    found: list[Step] = []
    with ctx.workprec(bits):
        cycles = [[_Balls.of(each) for each in cycle] for cycle in (model.Phi, model.H, model.Q, model.R)]
        x, P = _Balls.of(model.x0[:, None]), _Balls.of(model.P0)
        for k, measured in enumerate(z):
            Phi, H, Q, R = (cycle[k % len(cycle)] for cycle in cycles)
            state, offset = model.known(k)
            V = predicted(_ALGEBRA, Phi, P, Q)
            try:
                K = gain(_ALGEBRA, H, R, V).K
            except ZeroDivisionError:
                return SINGULAR
            P = updated(_ALGEBRA, Form.INNOVATION, StepModel(Phi, H, Q, R), V, K)
            ahead = Phi @ x + _Balls.of(state[:, None])
            x = corrected(_ALGEBRA, H, K, ahead, _Balls.of((measured - offset)[:, None]))
            found.append((_fractions(x.matrix)[:, 0], _fractions(K.matrix), _fractions(P.matrix)))
    return found


class _Balls:
    """A matrix of python-flint's numbers; only the midpoint of each result is kept."""

    def __init__(self, matrix: arb_mat) -> None:
        self.matrix, self.shape = matrix, (matrix.nrows(), matrix.ncols())

    @classmethod
    def of(cls, entries: NDArray[Any]) -> _Balls:
        return cls(arb_mat([[arb(fmpq(each.numerator, each.denominator)) for each in row] for row in entries]))

    def __len__(self) -> int:
        return int(self.shape[0])

    @property
    def T(self) -> _Balls:
        return _Balls(self.matrix.transpose())

    def __add__(self, other: _Balls) -> _Balls:
        return _Balls((self.matrix + other.matrix).mid())

    def __sub__(self, other: _Balls) -> _Balls:
        return _Balls((self.matrix - other.matrix).mid())

    def __matmul__(self, other: _Balls) -> _Balls:
        return _Balls((self.matrix * other.matrix).mid())


_ALGEBRA = Algebra(
    lambda n: _Balls(arb_mat(n, n, [int(i == j) for i in range(n) for j in range(n)])),
    operator.matmul,
    lambda a, identity: Inverse(_Balls(a.matrix.inv().mid()), []),
)


def _fractions(matrix: arb_mat) -> NDArray[Any]:
    return np.array([[exact_fraction(value.mid()) for value in row] for row in matrix.tolist()], dtype=object)
