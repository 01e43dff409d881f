r"""One step of a Kalman filter over numbers of any kind, also over numbers that record their operations.

The order of operations is that of hung1984: predicted covariance (100), gain (99), covariance (101), then the estimate
by the innovation (98) or by the closed loop (109)-(111). States and measurements are columns.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from gpbnb.arithmetic.algebra import Algebra, Matrix
from gpbnb.filters.array_forms import AnyForm, ArrayForm
from gpbnb.filters.array_steps import ONE_FORMAT, BlockStorage
from gpbnb.filters.forms import Form

HUNG_FORMS = (Form.HUNG, Form.HUNG_SECOND_GAIN)
"""Forms that compute the estimate by the closed loop."""


class StepModel(NamedTuple):
    """The matrices of one step: Phi (n, n), H (m, n), Q (n, n), R (m, m)."""

    Phi: Matrix
    H: Matrix
    Q: Matrix
    R: Matrix


def unnamed(quantity: str) -> None:
    """Take no note of the quantity that is computed next."""


class Innovation(NamedTuple):
    """:math:`VH^T` (n, m), the innovation covariance (m, m), its inverse, and the pivots of its elimination."""

    VH: Matrix
    covariance: Matrix
    inverse: Matrix
    pivots: list[Any]


class Gain(NamedTuple):
    """A gain (n, m), the innovation covariance (m, m) and the pivots of its elimination."""

    K: Matrix
    innovation_covariance: Matrix
    pivots: list[Any]


class KalmanStep(NamedTuple):
    """The estimate (n, 1), gain (n, m) and covariance (n, n) after a step."""

    x: Matrix
    K: Matrix
    P: Matrix


def predicted(algebra: Algebra, Phi: Matrix, P: Matrix, Q: Matrix) -> Matrix:
    r"""Return :math:`(\Phi P)\Phi^T + Q`; (100)."""
    times = algebra.times
    return algebra.rounded(times(times(Phi, P), Phi.T) + Q)


def innovation(algebra: Algebra, H: Matrix, R: Matrix, V: Matrix, about: Callable[[str], None] = unnamed) -> Innovation:
    """Return :math:`VH^T`, the innovation covariance :math:`H(VH^T) + R` and its inverse."""
    times = algebra.times
    VH = times(V, H.T)
    S = algebra.rounded(times(H, VH) + R)
    about("its inverse")
    return Innovation(VH, S, *algebra.invert(S, algebra.identity(len(S))))


def gain(algebra: Algebra, H: Matrix, R: Matrix, V: Matrix) -> Gain:
    """Return :math:`(VH^T)(H(VH^T) + R)^{-1}` for the predicted covariance V; the first form of (99)."""
    found = innovation(algebra, H, R, V)
    return Gain(algebra.times(found.VH, found.inverse), found.covariance, found.pivots)


def second_gain(algebra: Algebra, H: Matrix, R: Matrix, P: Matrix) -> Matrix:
    """Return :math:`(PH^T)R^{-1}` for the new covariance P; the second form of (99)."""
    return algebra.times(algebra.times(P, H.T), algebra.invert(R, algebra.identity(len(R))).matrix)


def reduction(algebra: Algebra, K: Matrix, H: Matrix) -> Matrix:
    """Return :math:`I - KH`."""
    return algebra.rounded(algebra.identity(H.shape[1]) - algebra.times(K, H))


def updated(algebra: Algebra, form: AnyForm, model: StepModel, V: Matrix, K: Matrix) -> Matrix:
    r"""Return :math:`(I - KH)V`, (101), or in Joseph's form :math:`((I - KH)V)(I - KH)^T + (KR)K^T`."""
    times, W = algebra.times, reduction(algebra, K, model.H)
    P = times(W, V)
    if form is not Form.JOSEPH:
        return P
    return algebra.rounded(times(P, W.T) + times(times(K, model.R), K.T))


class BlockAlgebra(NamedTuple):
    """How each block of a filter computes, and how it takes numbers from the model or from another block."""

    state: Algebra
    gain: Algebra
    covariance: Algebra
    innovation: Algebra
    stored: BlockStorage = ONE_FORMAT


class Measured(NamedTuple):
    """A gain (n, m), the covariance (n, n) after a measurement, the innovation covariance, and whether all is definite.

    That is so if all variances, and all pivots of the innovation covariance, are positive.
    """

    K: Matrix
    P: Matrix
    S: Matrix
    definite: Any


def predicted_in(blocks: BlockAlgebra, Phi: Matrix, P: Matrix, Q: Matrix) -> Matrix:
    """Return the predicted covariance, computed in the covariance block."""
    taken = blocks.stored.covariance
    return predicted(blocks.covariance, taken(Phi), P, taken(Q))


def measured_in(
    blocks: BlockAlgebra,
    form: AnyForm,
    H: Matrix,
    R: Matrix,
    V: Matrix,
    about: Callable[[str], None] = unnamed,
) -> Measured:
    """Return the gain, and the covariance after a measurement, each computed in its own block.

    Parameters
    ----------
    about : takes the name of each quantity before it is computed.
    """
    stored = blocks.stored
    about("the innovation covariance")
    own_H, own_R, own_V = map(stored.innovation, (H, R, V))
    found = innovation(blocks.innovation, own_H, own_R, own_V, about)
    about("the gain")
    K = blocks.gain.times(stored.gain(found.inverse).T, stored.gain(found.VH).T).T
    about("the covariance")
    own = StepModel(None, stored.covariance(H), None, stored.covariance(R))
    P = updated(blocks.covariance, form, own, V, stored.covariance(K))
    if form is ArrayForm.SYMMETRIZED:
        P = (P + P.T) / 2
    definite = np.all(np.diagonal(P) > 0)
    for pivot in found.pivots:
        definite = definite & np.all(pivot > 0)
    return Measured(K, P, found.covariance, definite)


def corrected(algebra: Algebra, H: Matrix, K: Matrix, ahead: Matrix, z: Matrix) -> Matrix:
    """Return :math:`x_p + K(z - Hx_p)` for the predicted estimate; (98)."""
    return corrected_by(algebra, K, ahead, algebra.rounded(z - algebra.times(H, ahead)))


def corrected_by(algebra: Algebra, K: Matrix, ahead: Matrix, difference: Matrix) -> Matrix:
    """Return :math:`x_p + Ky` for the predicted estimate and an innovation y, as a nonlinear filter has it."""
    return algebra.rounded(ahead + algebra.times(K, difference))


def by_closed_loop(algebra: Algebra, model: StepModel, K: Matrix, x: Matrix, z: Matrix) -> Matrix:
    r"""Return :math:`((I - KH)\Phi)x + Kz`; (109)-(111)."""
    loop = algebra.times(reduction(algebra, K, model.H), model.Phi)
    return algebra.rounded(algebra.times(loop, x) + algebra.times(K, z))


def kalman_step(
    algebra: Algebra, form: Form, model: StepModel, x: Matrix, P: Matrix, z: Matrix, known: Matrix | None = None
) -> KalmanStep:
    """Take one step in any form that computes the covariance itself.

    Parameters
    ----------
    algebra : how numbers of this kind are computed.
    form : any form except UD, whose steps are in :mod:`gpbnb.filters.array_steps`.
    x (n, 1), P (n, n) : estimate and covariance before the step. z (m, 1) : measurement.
    known (n, 1) : what known inputs add to the predicted estimate; None without inputs, which Hung's forms need.
    """
    if form is Form.UD:
        raise ValueError(
            "got the UD form, which has no covariance; use predict_ud and observe_ud of filters.array_steps"
        )
    V = predicted(algebra, model.Phi, P, model.Q)
    K = gain(algebra, model.H, model.R, V).K
    P = updated(algebra, form, model, V, K)
    if form is Form.HUNG_SECOND_GAIN:
        K = second_gain(algebra, model.H, model.R, P)
    if form in HUNG_FORMS:
        return KalmanStep(by_closed_loop(algebra, model, K, x, z), K, P)
    ahead = algebra.times(model.Phi, x)
    ahead = ahead if known is None else algebra.rounded(ahead + known)
    return KalmanStep(corrected(algebra, model.H, K, ahead, z), K, P)
