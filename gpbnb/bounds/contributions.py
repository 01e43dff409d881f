r"""How much each operation of a step adds to a guarantee.

Once the gain has settled, the part of a guarantee that is due to the roundings of the estimate is, for state i,

.. math:: \sum_{l<L}\sum_o |c_l\,\Gamma_o|\,h_o, \qquad c_0 = i\text{-th unit vector}, \quad c_{l+1} = c_l\hat F_{k-l},

where h is the largest rounding error of operation o and the column Γ is its effect on the states after the step.
Swapping the sums gives each operation its own share. A few operations usually cause most of the bound, because their
results are the largest: these are the ones to compute with more digits.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from gpbnb.bounds.guarantee import FilterGuarantee
from gpbnb.bounds.probable import separate_roundings

_NEGLIGIBLE = 1e-9


class Contributions(NamedTuple):
    """What the roundings of a step add to the error of each state."""

    errors: NDArray[np.float64]  # (o,), the largest of each operation; zero if its result is always exact
    effects: NDArray[np.float64]  # (n, o), of such an error on each state after the step, as a factor
    sums: NDArray[np.float64]  # (n, o), the largest errors of states by an operation in all steps together


def contributions(found: FilterGuarantee) -> Contributions:
    """Divide the bound of a filter with a settled gain among the operations of a step.

    If the gain has a period, operations are those of its last step.

    Parameters
    ----------
    found : a guarantee that holds for ever.

    Raises
    ------
    ValueError : the guarantee does not hold for ever.

    Examples
    --------
    Two sums, which give the predicted and the new position of a tracker, cause nearly the whole bound:

    >>> from gpbnb import FloatFormat, LinearModel
    >>> from gpbnb.bounds.guarantee import guarantee, limits
    >>> Phi, Q = [[1, "0.1"], [0, 1]], [["1/30000", "1/2000"], ["1/2000", "1/100"]]
    >>> tracker = LinearModel(Phi, [[1, 0]], Q, [[4]], [0, 0], [[100, 0], [0, 100]])
    >>> found = guarantee(tracker, FloatFormat(2, 24), limits(state=[1000, 30], innovation=8))
    >>> of_position = contributions(found).sums[0]
    >>> [int(o) for o in of_position.argsort()[-2:]], round(float(of_position[[1, 5]].sum() / found.bound[0]), 2)
    ([1, 5], 0.97)
    """
    F, G, errors = separate_roundings(found)
    rows, sums, at = np.eye(F.shape[1]), np.zeros(G.shape[1:]), len(F) - 1
    while (added := np.abs(rows @ G[at]) * errors[at]).max() > _NEGLIGIBLE * sums.max() or at != len(F) - 1:
        sums += added
        rows = rows @ F[at]
        at = (at - 1) % len(F)
    return Contributions(errors[-1], G[-1], sums)
