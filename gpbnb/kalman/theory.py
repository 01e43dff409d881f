r"""What may happen to a Kalman filter whose every operation is rounded: printed bounds, and one that is a bound.

The bounds named ``printed_…`` are those of hung1984, ch. II, section 12; :func:`coefficients` gives (125) as printed and
with each of its faults mended. They are exact: ints and Fractions in, Fractions out.

The contraction bound needs no pattern and no first order. Let :math:`(\hat x_k, \hat P_k)` be what any program computed,
by any form of the filter, and :math:`\mathcal E` one exact step (98)-(101). Only two residuals of a step enter,

.. math:: q_k = \hat x_k - \mathcal E_x(\hat x_{k-1}, \hat P_{k-1}, z_k), \qquad
    T_k = \hat P_k - \mathcal E_P(\hat P_{k-1}),

for the errors :math:`e_k = \hat x_k - x_k` and :math:`E_k = \hat P_k - P_k` obey *exactly*

.. math:: E_k = A_k E_{k-1} F_k^T + T_k, \quad e_k = F_k (e_{k-1} + E_{k-1} y_k) + q_k, \quad
    F_k = A_k (I - E_{k-1} G_k)^{-1},

    A_k = (I - K^\circ_k H_k)\Phi_{k-1}, \quad y_k = \Phi^T H^T S^{\circ-1}\hat\nu_k, \quad
    G_k = \Phi^T H^T S^{\circ-1} H \Phi,

where :math:`K^\circ, S^\circ` are the gain and the innovation covariance of (99) for :math:`\hat P_{k-1}`, and
:math:`\hat\nu_k = z_k - H\Phi\hat x_{k-1}`; :math:`F_k` is (109), the closed loop of the exact filter. Proof:
:func:`gpbnb.kalman.derivation.contraction`. In the norm :math:`\|v\|_k = \|L_k^{-1}v\|_2`, with :math:`L_kL_k^T` about
the filter's own covariance, the closed loop does not expand: errors are added up, not multiplied up. The norm has no units;
an entry of the error is at most :math:`\|v\|_k` of these standard deviations.

The functions of the contraction bound take and return float64 arrays and floats, and are plain enough for
``numba.njit``. Their own roundings are in the bound.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from fractions import Fraction
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from gpbnb.bounds import column_sum_norm, exact, max_norm
from gpbnb.formats import FloatFormat, Rounding

# -- the counts of the report -----------------------------------------------------------------------------------------


def prediction_count(n: int) -> int:
    """Roundings of the predicted covariance, 2n + 1; hung1984, ch. II, (103)."""
    return 2 * n + 1


def covariance_count(n: int, m: int) -> int:
    """Roundings of the covariance, 3n + m + 2; hung1984, ch. II, (105)."""
    return 3 * n + m + 2


def gain_count(n: int, m: int) -> int:
    """Roundings of the gain, 4n + 2m + 3; hung1984, ch. II, (108)."""
    return 4 * n + 2 * m + 3


def transition_count(n: int, m: int) -> int:
    """Roundings of the closed loop in a step, its product with the state among them, 6n + 3m + 5; (115)."""
    return 6 * n + 3 * m + 5


def input_count(n: int, m: int) -> int:
    """Roundings of what a step adds, its addition among them, 4n + 3m + 4; hung1984, ch. II, (116)."""
    return 4 * n + 3 * m + 4


def printed_covariance_bound(P: Any, m: int, beta: Fraction) -> NDArray[Any]:
    r"""Bound entry by entry, :math:`(3n+m+2)\beta\,|P_k|`; hung1984, ch. II, (105).

    Parameters
    ----------
    P : (n, n), the exact covariance after the step.
    m : number of measurements.
    beta : unit roundoff β.
    """
    entries = exact(P)
    return np.asarray(covariance_count(entries.shape[0], m) * beta * abs(entries))


def printed_gain_bound(K: Any, beta: Fraction) -> NDArray[Any]:
    r"""Bound entry by entry, :math:`(4n+2m+3)\beta\,|K_k|`; hung1984, ch. II, (108). K : (n, m), the exact gain."""
    entries = exact(K)
    n, m = entries.shape
    return np.asarray(gain_count(n, m) * beta * abs(entries))


class Coefficients(NamedTuple):
    r"""What multiplies :math:`\beta\|x_k\|` and :math:`\beta B` in a bound like (125)."""

    first: int
    second: int


def coefficients(
    k: int, n: int, m: int, once: bool = False, free_signs: bool = False, carried: bool = False
) -> Coefficients:
    r"""Return the coefficients of (125), as printed or with faults mended.

    With :math:`c_j` roundings of the closed loop of step j and :math:`d_j` of its input, the report bounds
    :math:`\|\tilde x_k\|` by :math:`\beta\{a_0\|x_k\| + \sum_{i=1}^k (a_0 - a_i)B\}`,
    :math:`a_i = \sum_{j=i+1}^k c_j + d_i`, :math:`a_0 = \sum_{j=1}^k c_j`.

    Parameters
    ----------
    k : steps. n, m : dimensions of the state and of the measurement.
    once : do not count the product with the state and the last addition again, that (114)-(116) have counted already.
    free_signs : let each term have an error of its own sign, :math:`a_0 + a_i` for :math:`a_0 - a_i`.
    carried : let the errors of P from the steps before go on into P, K and F, as the report's own algebra does with
        every other error: 3n + m + 2 more roundings at each step.

    Raises
    ------
    ValueError : k, n or m below 1.

    References
    ----------
    hung1984, ch. II, (112)-(125).
    """
    if min(k, n, m) < 1:
        raise ValueError(f"got k = {k}, n = {n}, m = {m}; needed each at least 1")
    c, d, more = transition_count(n, m), input_count(n, m), covariance_count(n, m) if carried else 0
    if not once:
        c, d = c + n + 1, d + 1
    first = c * k + more * k * (k - 1) // 2
    loops = c * k * (k + 1) // 2 + more * (k + 1) * k * (k - 1) // 6  # sum over i of c_1 + ... + c_i
    inputs = d * k + more * k * (k - 1) // 2
    return Coefficients(first, 2 * k * first - loops + inputs if free_signs else loops - inputs)


def printed_input_bound(transitions: Sequence[Any], inputs: Sequence[Any]) -> Fraction:
    r"""Return the least B of (122), :math:`F^i u \le B` for i = 0 … k - 1, in the norms (21) and (22).

    Parameters
    ----------
    transitions : F_1 … F_k of (109). inputs : u_1 … u_k of (110).

    Raises
    ------
    ValueError : none, or not as many of one as of the other.
    """
    if not transitions or len(transitions) != len(inputs):
        raise ValueError(f"got {len(transitions)} transitions and {len(inputs)} inputs; needed as many, at least one")
    F, u = max(map(column_sum_norm, transitions)), max(map(max_norm, inputs))
    return u * max(Fraction(1), F ** (len(inputs) - 1))


def state_bound(
    x_norm: Fraction,
    B: Fraction,
    beta: Fraction,
    counts: Coefficients,
) -> Fraction:
    r"""Return :math:`\beta\{a\|x_k\| + bB\}`, with (a, b) of :func:`coefficients`; as printed, hung1984, ch. II, (125)."""
    return beta * (counts.first * x_norm + counts.second * B)


def required_precision(coefficient: int | Fraction, goal: Fraction | int = 1, base: int = 10,
                       rounding: Rounding = Rounding.NEAREST) -> int:
    r"""Smallest t with :math:`\text{coefficient}\cdot\beta(t) \le \text{goal}`.

    Parameters
    ----------
    coefficient : what multiplies β. goal : the error that is granted, in the same units. base, rounding : of the format.

    Raises
    ------
    ValueError : coefficient or goal not positive.

    References
    ----------
    hung1984, ch. II, (8), (13) and the example of section 12.
    """
    if coefficient <= 0 or goal <= 0:
        raise ValueError(f"got coefficient {coefficient} and goal {goal}; needed both positive")
    precision = 1
    while coefficient * FloatFormat(base, precision, rounding).unit_roundoff > goal:
        precision += 1
    return precision


# -- one exact step ---------------------------------------------------------------------------------------------------


class ExactStep(NamedTuple):
    """Everything of one exact step; object arrays of Fractions."""

    x: NDArray[Any]
    P: NDArray[Any]
    predicted: NDArray[Any]
    gain: NDArray[Any]
    innovation_covariance: NDArray[Any]
    transition: NDArray[Any]


# -- the contraction bound --------------------------------------------------------------------------------------------


class Contraction(NamedTuple):
    r"""The bound after a step: :math:`\|e_k\|_k \le \eta`, :math:`\|L_k^{-1}E_kL_k^{-T}\|_F \le \zeta`.

    Infinite where nothing can be said: the error of the covariance is too large for the gain to be known.
    """

    L: NDArray[np.float64]
    eta: float
    zeta: float


def contraction_start(P: Any, de: Any, dE: Any) -> Contraction:
    """Begin with weights from the covariance P (n, n) and componentwise bounds of the errors of x_0 and P_0.

    `de` (n,) and `dE` (n, n) are zero where both are exact. Works on float64 arrays; plain enough for numba.
    """
    raise NotImplementedError


def contraction_step(
    before: Contraction, Phi: Any, H: Any, Q: Any, R: Any, K: Any, S: Any, innovation: Any,
    q: Any, T: Any, dq: Any, dT: Any, dK: Any, dinnovation: Any,
) -> Contraction:
    """Take the bound over one step.

    Parameters
    ----------
    before : the bound after the step before.
    Phi (n, n), H (m, n), Q (n, n), R (m, m) : the model, nearest float64.
    K (n, m), S (m, m), innovation (m,) : gain K°, innovation covariance S° and ν̂ = z - HΦx̂ of the exact step from what
        the program had, nearest float64 of a double-double (or better) evaluation.
    q (n,), T (n, n) : residuals of the step, program minus exact step, subtracted before they become float64.
    dq, dT, dK, dinnovation : componentwise bounds of the errors of that evaluation, from :func:`evaluation_errors`.
    """
    raise NotImplementedError


def evaluation_errors(Phi: Any, H: Any, Q: Any, R: Any, x: Any, P: Any, z: Any, K: Any, S: Any, unit: float) -> Any:
    """Bound the errors of the evaluation of one step with unit roundoff `unit`: dq, dT, dK, dinnovation.

    Parameters
    ----------
    Phi, H, Q, R : the model. x, P : where the step starts. z : measurement. K, S : gain and innovation covariance.
    unit : of one operation, 2**-102 for :mod:`gpbnb._kernels.doubledouble`.

    The evaluation is x = Φx + K(z - H(Φx)), Pp = ΦPΦᵀ + Q, S = HPpHᵀ + R, K from KS = PpHᵀ by elimination without
    pivoting or Cholesky (S symmetric), P = (I - KH)Pp or Joseph's form, sums in any order.
    """
    raise NotImplementedError


def state_error_bound(bound: Contraction) -> NDArray[np.float64]:
    """Bound of each entry of the error of the state, (n,), in its units."""
    raise NotImplementedError


def covariance_error_bound(bound: Contraction) -> NDArray[np.float64]:
    """Bound of each entry of the error of the covariance, (n, n)."""
    raise NotImplementedError


def gain_error_bound(
    before: Contraction, after: Contraction, Phi: Any, H: Any, K: Any, S: Any, gain: Any, dK: Any
) -> NDArray[np.float64]:
    """Bound of each entry of the error of the gain that the program used in this step, `gain`, (n, m)."""
    raise NotImplementedError
