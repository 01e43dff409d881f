r"""A rounding error bound that holds for one run of a filter: the contraction bound.

The contraction bound needs no pattern and no first-order approximation. Let :math:`(\hat x_k, \hat P_k)` be the results
of any program, by any form of the filter (for an asymmetric covariance, its symmetric part), and :math:`\mathcal E` one
exact step (98)-(101). Only two residuals of a step enter,

.. math:: q_k = \hat x_k - \mathcal E_x(\hat x_{k-1}, \hat P_{k-1}, z_k), \qquad
    T_k = \hat P_k - \mathcal E_P(\hat P_{k-1}),

for the errors :math:`e_k = \hat x_k - x_k` and :math:`E_k = \hat P_k - P_k` obey *exactly*

.. math:: E_k = A_k E_{k-1} F_k^T + T_k, \quad e_k = F_k (e_{k-1} + E_{k-1} y_k) + q_k, \quad
    F_k = A_k (I - E_{k-1} G_k)^{-1},

    A_k = (I - K^\circ_k H_k)\Phi_{k-1}, \quad y_k = \Phi^T H^T S^{\circ-1}\hat\nu_k, \quad
    G_k = \Phi^T H^T S^{\circ-1} H \Phi,

where :math:`K^\circ, S^\circ` are the gain and the innovation covariance of (99) for :math:`\hat P_{k-1}`, and
:math:`\hat\nu_k = z_k - H\Phi\hat x_{k-1}`; :math:`F_k` is (109), the closed loop of the exact filter. Proof:
``contraction``. In the norm :math:`\|v\|_k = \|L_k^{-1}v\|_2`, with :math:`L_kL_k^T`
close to the filter's own covariance, the closed loop does not expand, so errors are added but not amplified. The norm
has no units; an entry of the error is at most :math:`\|v\|_k` of these standard deviations.

The functions are compiled (``contraction``), take and return float64, and include their own
roundings in the bound.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from gpbnb.filters.kernels.contraction import (
    Contraction,
    EvaluationErrors,
    Repeated,
    contraction_start,
    contraction_step,
    covariance_error_bound,
    evaluation_errors,
    gain_error_bound,
    state_error_bound,
)

__all__ = [
    "Contraction",
    "EvaluationErrors",
    "Repeated",
    "companion_bound",
    "contraction_start",
    "contraction_step",
    "covariance_error_bound",
    "evaluation_errors",
    "gain_error_bound",
    "state_error_bound",
]

_U = 2.0**-53


def companion_bound(difference: Any, bound: Any) -> NDArray[np.float64]:
    r"""Bound the errors of a run by its distance from a companion run, such as one with more digits, and its bound.

    .. math:: |\hat x - x| \le |\hat x - \hat x_c| + |\hat x_c - x|

    Parameters
    ----------
    difference : the run minus its companion, entry by entry, subtracted before conversion to float64.
    bound : bound of each entry of the companion's errors, as from :func:`state_error_bound`.
    """
    return (np.abs(difference) + np.asarray(bound)) * (1 + 4 * _U)
