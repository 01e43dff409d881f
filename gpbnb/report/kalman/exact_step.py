"""One step of the filter in exact arithmetic."""

from __future__ import annotations

from typing import Any, NamedTuple

from numpy.typing import NDArray

from gpbnb.arithmetic.algebra import EXACT, product_in_order
from gpbnb.arithmetic.rational import exact
from gpbnb.filters.steps import gain, predicted, reduction


class ExactStep(NamedTuple):
    r"""One exact step; object arrays of Fractions.

    x (n,) is the estimate (98), P its covariance (101), `predicted` the covariance (100), `gain` (n, m) is (99),
    `innovation` is :math:`z - H\Phi x`, (m,), with the covariance :math:`HP_pH^T + R`, and `transition` the closed loop
    (109).
    """

    x: NDArray[Any]
    P: NDArray[Any]
    predicted: NDArray[Any]
    gain: NDArray[Any]
    innovation_covariance: NDArray[Any]
    innovation: NDArray[Any]
    transition: NDArray[Any]


def exact_step(Phi: Any, H: Any, Q: Any, R: Any, x: Any, P: Any, z: Any) -> ExactStep:
    """One step of the filter without any rounding, in Fractions; (98)-(101) in the order (100), (99), (101), (98).

    Parameters
    ----------
    Phi (n, n), H (m, n), Q (n, n), R (m, m) : the model. x (n,), P (n, n) : values before the step.
    z (m,) : measurement.
    """
    Phi, H, Q, R, x, P, z = map(exact, (Phi, H, Q, R, x, P, z))
    V = predicted(EXACT, Phi, P, Q)
    K, (_, S, *_) = gain(EXACT, H, R, V)
    W, ahead = reduction(EXACT, K, H), Phi @ x
    innovation = z - H @ ahead
    return ExactStep(ahead + K @ innovation, product_in_order(W, V), V, K, S, innovation, product_in_order(W, Phi))
