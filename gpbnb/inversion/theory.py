r"""What may happen: bounds of the error of an inverse from elimination and back substitution.

Bounds named ``printed_…`` are those of the documents; the others are derived in
:mod:`gpbnb.inversion.derivation`. ``beta`` is the unit roundoff β. Entries are exact (Fractions, ints, a FloatArray) or
float64, and so are the results: exact where everything given is exact, else float64.

All of them start from what a computer has when it is done, a :class:`Reduction`. With L the unit lower triangle of the
exact quotients :math:`\hat a_{ik}(k-1)/\hat a_{kk}(k-1)`, :func:`lower_factor`, elimination and back substitution give,
without anything left out,

.. math:: L\hat A_T = A + \tilde A, \qquad L\hat b_T = b + \tilde b, \qquad
    (\hat A_T + \Delta A)\,\hat x = \hat b_T + \Delta b.

So Ã and b̃ change the given system and ΔA and Δb the triangular one: they cannot be added before the second are
multiplied by L, which (91) and (92) leave out.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from fractions import Fraction
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from gpbnb.bounds import exact, gamma

Norm = Callable[[NDArray[Any]], Any]


def column_sum(a: NDArray[Any]) -> Any:
    """Largest column sum of sizes, (22), in the arithmetic of the entries."""
    return abs(a).sum(axis=0).max()


class Reduction(NamedTuple):
    r"""What elimination and back substitution leave behind; rows in the order in which they were eliminated.

    Parameters
    ----------
    stages : n matrices (n, n), :math:`\hat A(0) \dots \hat A(n-1)`; the first is the given matrix, with its rows
        interchanged if there was pivoting, the last is upper triangular. What is eliminated is zero from then on.
    rights : n matrices (n, p), :math:`\hat b(0) \dots \hat b(n-1)`, a column for each right-hand side; for an inverse
        p = n and the first is the identity, with its rows interchanged.
    solution : (n, p), :math:`\hat x` of each right-hand side; for an inverse, the computed inverse.
    """

    stages: Sequence[Any]
    rights: Sequence[Any]
    solution: Any


# -- first approach: from the residual, (33)-(44) -------------------------------------------------


def residual(a: Any, x: Any) -> NDArray[Any]:
    """R = A X - I, of a computed inverse X; hung1984, ch. II, (34) and (37)."""
    raise NotImplementedError


def printed_first_bound(inverse: Any, residual: Any, change: Any = None, norm: Norm = column_sum) -> Any:
    r"""Bound of ‖E‖ as :math:`\|A^{-1}\|\|R\| + \|A^{-1}\|^2\|\Delta A\|`; hung1984, ch. II, (39) and (43).

    `inverse` is the true inverse of A, `residual` that of the matrix that was inverted, A + ΔA, and `change` is ΔA, none
    by default. Only to first order in ΔA.
    """
    raise NotImplementedError


def printed_first_relative_bound(inverse: Any, residual: Any, change: Any = None, norm: Norm = column_sum) -> Any:
    r"""Bound of ‖E‖/‖A⁻¹‖ as :math:`\|R\| + \|A^{-1}\|\|\Delta A\|`; hung1984, ch. II, (40) and (44)."""
    raise NotImplementedError


def strict_first_bound(inverse: Any, residual: Any, change: Any = None, norm: Norm = column_sum) -> Any:
    r"""The same to every order: (43) over :math:`1 - \|A^{-1}\|\|\Delta A\|`.

    Raises
    ------
    ValueError : the divisor is not positive.
    """
    raise NotImplementedError


def residual_bound(x: Any, residual: Any, norm: Norm = column_sum) -> Any:
    r"""Bound of ‖E‖ from the computed inverse alone, :math:`\|X\|\|R\|/(1-\|R\|)`; to every order.

    Raises
    ------
    ValueError : ‖R‖ ≥ 1; such an X proves nothing, not even that A has an inverse.
    """
    raise NotImplementedError


# -- triangularization, (45)-(64) -----------------------------------------------------------------


def lower_factor(stages: Sequence[Any]) -> NDArray[Any]:
    r"""L, (n, n): ones, and below them the quotients :math:`\hat a_{ik}(k-1)/\hat a_{kk}(k-1)`, not rounded."""
    raise NotImplementedError


def trailing(a: Any, k: int, columns: bool = True) -> NDArray[Any]:
    """A_k of (58): zeros in the first k rows and, with `columns`, in the first k columns."""
    raise NotImplementedError


def printed_triangularization_error(stages: Sequence[Any], beta: Any) -> NDArray[Any]:
    r"""Ã, (n, n), as :math:`\beta\sum_i[3\hat A_i(i) - 2\hat A_i(i-1)]`; hung1984, ch. II, (59).

    It has signs, as if all roundings had one and the same error.
    """
    raise NotImplementedError


def printed_right_side_error(rights: Sequence[Any], beta: Any) -> NDArray[Any]:
    r"""b̃, (n, p), as :math:`\beta\sum_i[3\hat b_i(i) - 2\hat b_i(i-1)]`; hung1984, ch. II, (60)."""
    raise NotImplementedError


def printed_triangularization_norm(stages: Sequence[Any], beta: Any, norm: Norm = column_sum) -> Any:
    r"""Bound of ‖Ã‖ as :math:`\beta\sum_k[3\|\hat A_k(k)\| + 2\|\hat A_k(k-1)\|]`; hung1984, ch. II, (61)."""
    raise NotImplementedError


def printed_right_side_norms(rights: Sequence[Any], beta: Any) -> NDArray[Any]:
    r"""Bounds (p,) of ‖b̃‖, largest entry, of each right-hand side; hung1984, ch. II, (62)."""
    raise NotImplementedError


def triangularization_bounds(stages: Sequence[Any], beta: Any) -> NDArray[Any]:
    r"""Bound of each \|ã_ij\|, :math:`\beta\sum_k[3|\hat A_k(k)| + 2|\hat A_k(k-1)|]`; (59) corrected, to first order."""
    raise NotImplementedError


def right_side_bounds(rights: Sequence[Any], beta: Any) -> NDArray[Any]:
    r"""Bound of each \|b̃_i\|, :math:`\beta\sum_k[3|\hat b_k(k)| + 2|\hat b_k(k-1)|]`; (60) corrected, to first order."""
    raise NotImplementedError


def strict_triangularization_bounds(stages: Sequence[Any], beta: Any) -> NDArray[Any]:
    r"""Bound of each \|ã_ij\|, :math:`\sum_k[\gamma_1|\hat a_{ij}(k)| + \gamma_2|l_{ik}\hat a_{kj}(k-1)|]`, always."""
    raise NotImplementedError


def strict_right_side_bounds(stages: Sequence[Any], rights: Sequence[Any], beta: Any) -> NDArray[Any]:
    r"""Bound of each \|b̃_i\|, :math:`\sum_k[\gamma_1|\hat b_i(k)| + \gamma_2|l_{ik}\hat b_k(k-1)|]`, always."""
    raise NotImplementedError


# -- back substitution, (65)-(90) -----------------------------------------------------------------


def back_substitution_weights(n: int) -> NDArray[Any]:
    """Roundings that a_kj passes through, (n, n): n - j + 3 above the diagonal, none elsewhere; hung1984, ch. II, (87)."""
    raise NotImplementedError


def right_side_weights(n: int) -> NDArray[Any]:
    """Roundings that b_k passes through, (n,): n - k + 1; hung1984, ch. II, (88)."""
    raise NotImplementedError


def printed_weights_1982(n: int) -> NDArray[Any]:
    """The first form of hung1982, ch. III, (89): 2n - j above the diagonal; equal to (87) for n = 3 only."""
    raise NotImplementedError


def printed_back_substitution_error(upper: Any, beta: Any) -> NDArray[Any]:
    r"""ΔA = A_D M_A β, (n, n), with the signs of `upper`; hung1984, ch. II, (89)."""
    raise NotImplementedError


def printed_back_substitution_right_error(right: Any, beta: Any) -> NDArray[Any]:
    r"""Δb = M_b b β, (n, p), with the signs of `right`; hung1984, ch. II, (90)."""
    raise NotImplementedError


# -- the inverse, (91)-(97) -----------------------------------------------------------------------


class Perturbation(NamedTuple):
    """Changes δA, (n, n), and δb, (n, p), of the given system, or bounds of the sizes of their entries."""

    matrix: NDArray[Any]
    right: NDArray[Any]


def printed_perturbation(reduction: Reduction, beta: Any) -> Perturbation:
    """δA = Ã + ΔA and δb = b̃ + Δb, with signs; hung1984, ch. II, (91) and (92)."""
    raise NotImplementedError


def perturbation_bounds(reduction: Reduction, beta: Any, transfer: bool = True) -> Perturbation:
    r"""Bounds of the entries of δA and δb, :math:`|\tilde A| + |L||\Delta A|`, :math:`|\tilde b| + |L||\Delta b|`.

    To first order. Without `transfer`, L is left out: (91) and (92) corrected only in their signs.
    """
    raise NotImplementedError


def strict_perturbation_bounds(reduction: Reduction, beta: Any) -> Perturbation:
    """The same with every order in β kept, and with the sharper Ã and b̃."""
    raise NotImplementedError


def printed_bracket(reduction: Reduction, beta: Any) -> NDArray[Any]:
    r"""E, (n, p), columns :math:`\delta b_j - \delta A\,\hat x_j` with their signs; hung1984, ch. II, (95)."""
    raise NotImplementedError


def bracket_bounds(reduction: Reduction, perturbation: Perturbation) -> NDArray[Any]:
    r"""Bounds of the entries of E, columns :math:`|\delta b_j| + |\delta A||\hat x_j|`."""
    raise NotImplementedError


def printed_bound(reduction: Reduction, beta: Any, norm: Norm = column_sum) -> Any:
    r"""Bound of the error norm of the inverse, :math:`\|\hat A^{-1}\|\|E\|`; hung1984, ch. II, (96)."""
    raise NotImplementedError


def bound(reduction: Reduction, beta: Any, norm: Norm = column_sum) -> Any:
    r"""(96) corrected, :math:`\|\hat A^{-1}\|\,\bigl\||\delta b| + |\delta A||\hat A^{-1}|\bigr\|`; to first order.

    `norm` must not grow when entries shrink in size, which column and row sums do not.
    """
    raise NotImplementedError


def strict_bound(reduction: Reduction, beta: Any, norm: Norm = column_sum) -> Any:
    r"""The same to every order: with strict entries, over :math:`1 - \|E\|`; from computed quantities alone.

    Raises
    ------
    ValueError : ‖E‖ ≥ 1, so that nothing is proved; more digits are needed.
    """
    raise NotImplementedError


def strict_entry_bounds(reduction: Reduction, beta: Any, inverse: Any) -> NDArray[Any]:
    r"""Bound of each entry of the error, :math:`|A^{-1}|(|\delta b| + |\delta A||\hat x|)`; to every order.

    `inverse` is the true inverse of ``stages[0]``, whose rows are in the order of elimination.
    """
    raise NotImplementedError
