r"""Theory: bounds on the error of an inverse from elimination and back substitution, as printed and corrected.

All bounds start from the intermediate results of a computation, a :class:`Reduction`. Let L be the unit lower
triangular matrix of the exact quotients :math:`\hat a_{ik}(k-1)/\hat a_{kk}(k-1)`, from :func:`lower_factor`.
Elimination and back substitution then satisfy exactly

.. math:: L\hat A_T = A + \tilde A, \qquad L\hat b_T = b + \tilde b, \qquad
    (\hat A_T + \Delta A)\,\hat x = \hat b_T + \Delta b.

So Ã and b̃ change the given system, while ΔA and Δb change the triangular one. Before they are added, ΔA and Δb must be
multiplied by L, a step that (91) and (92) omit.

Arrays hold Fractions or float64 numbers, and ``beta``, the unit roundoff β, is a Fraction or a float accordingly.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from gpbnb.arithmetic.bounds import column_sum
from gpbnb.arithmetic.rational import exact

Norm = Callable[[NDArray[Any]], Any]


class Reduction(NamedTuple):
    r"""Intermediate results of elimination and back substitution, with rows in the order of elimination.

    Parameters
    ----------
    stages : n matrices (n, n), :math:`\hat A(0) \dots \hat A(n-1)`; the first is the given matrix, with its rows
        interchanged if there was pivoting, the last is upper triangular. Eliminated entries are zero from then on.
    rights : n matrices (n, p), :math:`\hat b(0) \dots \hat b(n-1)`, a column for each right-hand side; for an inverse
        p = n and the first is the identity, with its rows interchanged.
    solution : (n, p), :math:`\hat x` of each right-hand side; for an inverse, the computed inverse.
    """

    stages: Sequence[Any]
    rights: Sequence[Any]
    solution: Any


class Perturbation(NamedTuple):
    """Changes δA, (n, n), and δb, (n, p), of the given system, or bounds of the sizes of their entries."""

    matrix: NDArray[Any]
    right: NDArray[Any]


def residual(a: Any, x: Any) -> NDArray[Any]:
    """Return R = A X - I exactly for a computed inverse X; hung1984, ch. II, (34) and (37)."""
    return np.asarray(exact(a) @ exact(x) - np.eye(len(x), dtype=int))


def printed_first_bound(inverse: Any, residual: Any) -> Any:
    r"""Bound of ‖E‖ as :math:`\|A^{-1}\|\|R\|` with the true inverse; hung1984, ch. II, (39)."""
    return column_sum(inverse) * column_sum(residual)


# -- triangularization, (45)-(64) -----------------------------------------------------------------


def lower_factor(stages: Sequence[Any]) -> NDArray[Any]:
    r"""L, (n, n), with a unit diagonal and below it the exact quotients :math:`\hat a_{ik}(k-1)/\hat a_{kk}(k-1)`."""
    lower = np.eye(len(stages), dtype=int) + 0 * stages[0]
    for k, matrix in enumerate(stages[:-1]):
        lower[k + 1 :, k] = matrix[k + 1 :, k] / matrix[k, k]
    return np.asarray(lower)


def trailing(a: Any, k: int, columns: bool = True) -> NDArray[Any]:
    """A_k of (58): zeros in the first k rows and, with `columns`, in the first k columns."""
    entries = a.copy()
    entries[:k] = entries[:k] * 0
    if columns:
        entries[:, :k] = entries[:, :k] * 0
    return np.asarray(entries)


def triangularization_error(parts: Sequence[Any], beta: Any, columns: bool, signed: bool) -> NDArray[Any]:
    r"""Ã of the stages, or b̃ of the right sides without `columns`.

    With signs, :math:`\beta\sum_k[3\hat A_k(k) - 2\hat A_k(k-1)]`, hung1984, ch. II, (59) and (60), as if all roundings
    had the same error. Otherwise a bound, :math:`\beta\sum_k[3|\hat A_k(k)| + 2|\hat A_k(k-1)|]`, to first order.
    """
    total = 0 * parts[0]
    for k in range(1, len(parts)):
        new, old = trailing(parts[k], k, columns), trailing(parts[k - 1], k, columns)
        total = total + (3 * new - 2 * old if signed else 3 * abs(new) + 2 * abs(old))
    return np.asarray(beta * total)


def printed_triangularization_norm(
    parts: Sequence[Any], beta: Any, norm: Norm = column_sum, columns: bool = True
) -> Any:
    r"""Bound of ‖Ã‖ as :math:`\beta\sum_k[3\|\hat A_k(k)\| + 2\|\hat A_k(k-1)\|]`; hung1984, ch. II, (61), (62)."""
    pairs = ((parts[k], parts[k - 1], k) for k in range(1, len(parts)))
    return sum(
        beta * (3 * norm(trailing(new, k, columns)) + 2 * norm(trailing(old, k, columns))) for new, old, k in pairs
    )


# -- back substitution, (65)-(90) -----------------------------------------------------------------


def back_substitution_weights(n: int) -> NDArray[Any]:
    """Roundings of a_kj, (n, n): n - j + 3 above the diagonal, none elsewhere; hung1984, ch. II, (87)."""
    return np.triu(np.broadcast_to(n + 3 - np.arange(1, n + 1), (n, n)), 1)


def right_side_weights(n: int) -> NDArray[Any]:
    """Roundings of b_k, (n, 1): n - k + 1; hung1984, ch. II, (88)."""
    return np.arange(n, 0, -1)[:, np.newaxis]


def printed_weights_1982(n: int) -> NDArray[Any]:
    """The first form of hung1982, ch. III, (89): 2n - j above the diagonal; equal to (87) for n = 3 only."""
    return np.triu(np.broadcast_to(2 * n - np.arange(1, n + 1), (n, n)), 1)


def back_substitution_error(reduction: Reduction, beta: Any) -> Perturbation:
    r"""ΔA = A_D M_A β and Δb = M_b b β, with the signs of the entries; hung1984, ch. II, (89) and (90)."""
    n = len(reduction.stages)
    return Perturbation(
        beta * (reduction.stages[-1] * back_substitution_weights(n)),
        beta * (reduction.rights[-1] * right_side_weights(n)),
    )


# -- the inverse, (91)-(97) -----------------------------------------------------------------------


def perturbation(reduction: Reduction, beta: Any, signed: bool = True, transfer: bool = False) -> Perturbation:
    r"""δA = Ã + ΔA and δb = b̃ + Δb; hung1984, ch. II, (91) and (92).

    With signs as printed, otherwise bounds of the sizes. With `transfer`, |L| multiplies the sizes of ΔA and Δb, as the
    derivation demands: :math:`|\tilde A| + |L||\Delta A|`, to first order.
    """
    stages, rights, _ = reduction
    back = back_substitution_error(reduction, beta)
    if not signed:
        lower = abs(lower_factor(stages)) if transfer else np.eye(len(stages), dtype=int)
        back = Perturbation(lower @ abs(back.matrix), lower @ abs(back.right))
    return Perturbation(
        triangularization_error(stages, beta, True, signed) + back.matrix,
        triangularization_error(rights, beta, False, signed) + back.right,
    )


def bracket(reduction: Reduction, change: Perturbation, signed: bool = True) -> NDArray[Any]:
    r"""E of (95), columns :math:`\delta b_j - \delta A\,\hat x_j`, or :math:`|\delta b_j| + |\delta A||\hat x_j|`."""
    if signed:
        return np.asarray(change.right - change.matrix @ reduction.solution)
    return np.asarray(abs(change.right) + abs(change.matrix) @ abs(reduction.solution))


def bound(reduction: Reduction, beta: Any) -> Any:
    r"""Corrected (96), :math:`\|\hat A^{-1}\|\,\bigl\||\delta b| + |\delta A||\hat A^{-1}|\bigr\|`; to first order."""
    change = perturbation(reduction, beta, signed=False, transfer=True)
    return column_sum(reduction.solution) * column_sum(bracket(reduction, change, signed=False))
