r"""Theory: bounds on the error of an inverse from elimination and back substitution.

Bounds named ``printed_…`` are those of the documents; the others are derived in
:mod:`gpbnb.report.inversion.derivation`. ``beta`` is the unit roundoff β. Entries are exact (Fractions, ints, a
FloatArray) or float64, and so are the results: exact if all arguments are exact, otherwise float64.

All bounds start from the intermediate results of a computation, a :class:`Reduction`. Let L be the unit lower
triangular matrix of the exact quotients :math:`\hat a_{ik}(k-1)/\hat a_{kk}(k-1)`, from :func:`lower_factor`.
Elimination and back substitution then satisfy exactly

.. math:: L\hat A_T = A + \tilde A, \qquad L\hat b_T = b + \tilde b, \qquad
    (\hat A_T + \Delta A)\,\hat x = \hat b_T + \Delta b.

So Ã and b̃ change the given system, while ΔA and Δb change the triangular one. Before they are added, ΔA and Δb must be
multiplied by L, a step that (91) and (92) omit.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from fractions import Fraction
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from gpbnb.arithmetic.bounds import column_sum, gamma
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


# -- first approach: from the residual, (33)-(44) -------------------------------------------------


def residual(a: Any, x: Any) -> NDArray[Any]:
    """R = A X - I for a computed inverse X; hung1984, ch. II, (34) and (37)."""
    matrix, computed = _common(_square(a, "a"), _square(x, "x"))
    if matrix.shape != computed.shape:
        raise ValueError(f"got a of shape {matrix.shape}, x of shape {computed.shape}; needed equal shapes")
    return np.asarray(matrix @ computed - _identity(computed))


def printed_first_bound(inverse: Any, residual: Any, change: Any = None, norm: Norm = column_sum) -> Any:
    r"""Bound of ‖E‖ as :math:`\|A^{-1}\|\|R\| + \|A^{-1}\|^2\|\Delta A\|`; hung1984, ch. II, (39) and (43).

    `inverse` is the true inverse of A. `residual` belongs to the matrix that was inverted, A + ΔA, and `change` is ΔA,
    zero by default. The bound holds only to first order in ΔA.
    """
    size = norm(_matrix(inverse, "inverse"))
    return size * printed_first_relative_bound(inverse, residual, change, norm)


def printed_first_relative_bound(inverse: Any, residual: Any, change: Any = None, norm: Norm = column_sum) -> Any:
    r"""Bound of ‖E‖/‖A⁻¹‖ as :math:`\|R\| + \|A^{-1}\|\|\Delta A\|`; hung1984, ch. II, (40) and (44)."""
    bound = norm(_matrix(residual, "residual"))
    return bound if change is None else bound + norm(_matrix(inverse, "inverse")) * norm(_matrix(change, "change"))


def residual_bound(x: Any, residual: Any, norm: Norm = column_sum) -> Any:
    r"""Bound of ‖E‖ from the computed inverse alone, :math:`\|X\|\|R\|/(1-\|R\|)`; to every order."""
    size = norm(_matrix(residual, "residual"))
    return norm(_matrix(x, "x")) * size / _rest(size, "‖R‖", "a better inverse, computed with more digits")


# -- triangularization, (45)-(64) -----------------------------------------------------------------


def lower_factor(stages: Sequence[Any]) -> NDArray[Any]:
    r"""L, (n, n), with a unit diagonal and below it the exact quotients :math:`\hat a_{ik}(k-1)/\hat a_{kk}(k-1)`."""
    matrices = _stages(stages)
    lower = _identity(matrices[0])
    for k, matrix in enumerate(matrices[:-1]):
        lower[k + 1 :, k] = matrix[k + 1 :, k] / _pivot(matrix, k)
    return lower


def trailing(a: Any, k: int, columns: bool = True) -> NDArray[Any]:
    """A_k of (58): zeros in the first k rows and, with `columns`, in the first k columns."""
    entries = _matrix(a, "a").copy()
    entries[:k] = entries[:k] * 0
    if columns:
        entries[:, :k] = entries[:, :k] * 0
    return entries


def printed_triangularization_error(stages: Sequence[Any], beta: Any) -> NDArray[Any]:
    r"""Ã, (n, n), as :math:`\beta\sum_i[3\hat A_i(i) - 2\hat A_i(i-1)]`; hung1984, ch. II, (59).

    The formula keeps signs, as if all roundings had the same error.
    """
    return _telescope(_stages(stages), beta, True, lambda x: x, -2)


def printed_right_side_error(rights: Sequence[Any], beta: Any) -> NDArray[Any]:
    r"""b̃, (n, p), as :math:`\beta\sum_i[3\hat b_i(i) - 2\hat b_i(i-1)]`; hung1984, ch. II, (60)."""
    return _telescope(_rights(rights), beta, False, lambda x: x, -2)


def printed_triangularization_norm(stages: Sequence[Any], beta: Any, norm: Norm = column_sum) -> Any:
    r"""Bound of ‖Ã‖ as :math:`\beta\sum_k[3\|\hat A_k(k)\| + 2\|\hat A_k(k-1)\|]`; hung1984, ch. II, (61)."""
    matrices = _stages(stages)
    pairs = ((trailing(matrices[k], k), trailing(matrices[k - 1], k)) for k in range(1, len(matrices)))
    return sum((_like(beta, matrices) * (3 * norm(new) + 2 * norm(old)) for new, old in pairs), start=Fraction(0))


def triangularization_bounds(stages: Sequence[Any], beta: Any) -> NDArray[Any]:
    r"""Sizes of ã_ij, at most :math:`\beta\sum_k[3|\hat A_k(k)| + 2|\hat A_k(k-1)|]`; to first order."""
    return _telescope(_stages(stages), beta, True, abs, 2)


def right_side_bounds(rights: Sequence[Any], beta: Any) -> NDArray[Any]:
    r"""Sizes of b̃_i, at most :math:`\beta\sum_k[3|\hat b_k(k)| + 2|\hat b_k(k-1)|]`; to first order."""
    return _telescope(_rights(rights), beta, False, abs, 2)


def strict_triangularization_bounds(stages: Sequence[Any], beta: Any) -> NDArray[Any]:
    r"""Sizes of ã_ij, at most :math:`\sum_k[\gamma_1|\hat a_{ij}(k)| + \gamma_2|l_{ik}\hat a_{kj}(k-1)|]`, always."""
    matrices = _stages(stages)
    return _strict(matrices, matrices, beta, columns=True)


def strict_right_side_bounds(stages: Sequence[Any], rights: Sequence[Any], beta: Any) -> NDArray[Any]:
    r"""Sizes of b̃_i, at most :math:`\sum_k[\gamma_1|\hat b_i(k)| + \gamma_2|l_{ik}\hat b_k(k-1)|]`, always."""
    matrices, columns = _stages(stages), _rights(rights)
    if len(matrices) != len(columns):
        raise ValueError(f"got {len(matrices)} stages and {len(columns)} right sides; needed the same number of both")
    return _strict(matrices, columns, beta, columns=False)


# -- back substitution, (65)-(90) -----------------------------------------------------------------


def back_substitution_weights(n: int) -> NDArray[Any]:
    """Roundings of a_kj, (n, n): n - j + 3 above the diagonal, none elsewhere; hung1984, ch. II, (87)."""
    return np.array([[n - j + 3 if k < j else 0 for j in range(1, n + 1)] for k in range(1, n + 1)], dtype=object)


def right_side_weights(n: int) -> NDArray[Any]:
    """Roundings of b_k, (n,): n - k + 1; hung1984, ch. II, (88)."""
    return np.array([n - k + 1 for k in range(1, n + 1)], dtype=object)


def printed_weights_1982(n: int) -> NDArray[Any]:
    """The first form of hung1982, ch. III, (89): 2n - j above the diagonal; equal to (87) for n = 3 only."""
    return np.array([[2 * n - j if k < j else 0 for j in range(1, n + 1)] for k in range(1, n + 1)], dtype=object)


def printed_back_substitution_error(upper: Any, beta: Any) -> NDArray[Any]:
    r"""ΔA = A_D M_A β, (n, n), with the signs of `upper`; hung1984, ch. II, (89)."""
    entries = _square(upper, "upper")
    return np.asarray(entries * _weighted(back_substitution_weights(len(entries)), beta, entries))


def printed_back_substitution_right_error(right: Any, beta: Any) -> NDArray[Any]:
    r"""Δb = M_b b β, (n, p), with the signs of `right`; hung1984, ch. II, (90)."""
    entries = _matrix(right, "right")
    return np.asarray(entries * _weighted(right_side_weights(len(entries)), beta, entries)[:, np.newaxis])


# -- the inverse, (91)-(97) -----------------------------------------------------------------------


class Perturbation(NamedTuple):
    """Changes δA, (n, n), and δb, (n, p), of the given system, or bounds of the sizes of their entries."""

    matrix: NDArray[Any]
    right: NDArray[Any]


def printed_perturbation(reduction: Reduction, beta: Any) -> Perturbation:
    """δA = Ã + ΔA and δb = b̃ + Δb, with signs; hung1984, ch. II, (91) and (92)."""
    stages, rights, _ = _checked(reduction)
    return Perturbation(
        printed_triangularization_error(stages, beta) + printed_back_substitution_error(stages[-1], beta),
        printed_right_side_error(rights, beta) + printed_back_substitution_right_error(rights[-1], beta),
    )


def perturbation_bounds(reduction: Reduction, beta: Any, transfer: bool = True) -> Perturbation:
    r"""Bounds of the entries of δA and δb, :math:`|\tilde A| + |L||\Delta A|`, :math:`|\tilde b| + |L||\Delta b|`.

    To first order. Without `transfer`, L is omitted, so that only the signs of (91) and (92) are corrected.
    """
    stages, rights, _ = _checked(reduction)
    lower = abs(lower_factor(stages)) if transfer else _identity(stages[0])
    return Perturbation(
        triangularization_bounds(stages, beta) + lower @ abs(printed_back_substitution_error(stages[-1], beta)),
        right_side_bounds(rights, beta) + lower @ abs(printed_back_substitution_right_error(rights[-1], beta)),
    )


def strict_perturbation_bounds(reduction: Reduction, beta: Any) -> Perturbation:
    """Bounds of :func:`perturbation_bounds` to every order in β, with the sharper Ã and b̃."""
    stages, rights, _ = _checked(reduction)
    lower, n = abs(lower_factor(stages)), len(stages)
    weights = _gammas(back_substitution_weights(n), beta, stages[-1])
    right_weights = _gammas(right_side_weights(n), beta, rights[-1])[:, np.newaxis]
    return Perturbation(
        strict_triangularization_bounds(stages, beta) + lower @ (abs(stages[-1]) * weights),
        strict_right_side_bounds(stages, rights, beta) + lower @ (abs(rights[-1]) * right_weights),
    )


def printed_bracket(reduction: Reduction, beta: Any) -> NDArray[Any]:
    r"""E, (n, p), columns :math:`\delta b_j - \delta A\,\hat x_j` with their signs; hung1984, ch. II, (95)."""
    change = printed_perturbation(reduction, beta)
    return np.asarray(change.right - change.matrix @ _checked(reduction).solution)


def bracket_bounds(reduction: Reduction, perturbation: Perturbation) -> NDArray[Any]:
    r"""Bounds of the entries of E, columns :math:`|\delta b_j| + |\delta A||\hat x_j|`."""
    return np.asarray(perturbation.right + perturbation.matrix @ abs(_checked(reduction).solution))


def printed_bound(reduction: Reduction, beta: Any, norm: Norm = column_sum) -> Any:
    r"""Bound of the error norm of the inverse, :math:`\|\hat A^{-1}\|\|E\|`; hung1984, ch. II, (96)."""
    return norm(_checked(reduction).solution) * norm(printed_bracket(reduction, beta))


def bound(reduction: Reduction, beta: Any, norm: Norm = column_sum) -> Any:
    r"""Corrected (96), :math:`\|\hat A^{-1}\|\,\bigl\||\delta b| + |\delta A||\hat A^{-1}|\bigr\|`; to first order.

    `norm` must not grow when entries shrink in size; column and row sums have this property.
    """
    entries = bracket_bounds(reduction, perturbation_bounds(reduction, beta))
    return norm(_checked(reduction).solution) * norm(entries)


def strict_bound(reduction: Reduction, beta: Any, norm: Norm = column_sum) -> Any:
    r"""Bound of :func:`bound` to every order: with strict entries, divided by :math:`1 - \|E\|`."""
    size = norm(bracket_bounds(reduction, strict_perturbation_bounds(reduction, beta)))
    return norm(_checked(reduction).solution) * size / _rest(size, "‖E‖", "more digits")


# -- checked input, exact or float64 --------------------------------------------------------------


def _matrix(x: Any, name: str) -> NDArray[Any]:
    entries = x if isinstance(x, np.ndarray) and x.dtype == np.float64 else exact(x)
    if entries.ndim != 2 or not entries.size:
        raise ValueError(f"{name}: got shape {entries.shape}; needed a matrix (m, n); reshape a vector to (n, 1)")
    if entries.dtype != object and not np.isfinite(entries).all():
        raise ValueError(f"{name}: got an entry that is NaN or infinite; needed finite numbers; correct the data")
    return np.asarray(entries)


def _square(x: Any, name: str) -> NDArray[Any]:
    entries = _matrix(x, name)
    if entries.shape[0] != entries.shape[1]:
        raise ValueError(f"{name}: got shape {entries.shape}; needed a square matrix (n, n)")
    return entries


def _common(*arrays: NDArray[Any]) -> tuple[NDArray[Any], ...]:
    """Return the arrays unchanged if all are exact, otherwise in float64."""
    if all(each.dtype == object for each in arrays):
        return arrays
    return tuple(each.astype(float) for each in arrays)


def _stages(stages: Sequence[Any]) -> tuple[NDArray[Any], ...]:
    matrices = tuple(_square(each, f"stage {k}") for k, each in enumerate(stages))
    sizes = [len(each) for each in matrices]
    if not sizes or sizes != [len(sizes)] * len(sizes):
        raise ValueError(f"got {len(sizes)} stages of sizes {sizes}; needed n matrices (n, n): A(0) ... A(n-1)")
    return _common(*matrices)


def _rights(rights: Sequence[Any]) -> tuple[NDArray[Any], ...]:
    matrices = tuple(_matrix(each, f"right side {k}") for k, each in enumerate(rights))
    shapes = {each.shape for each in matrices}
    if len(shapes) != 1 or len(matrices[0]) != len(matrices):
        raise ValueError(f"got {len(matrices)} right sides of shapes {sorted(shapes)}; needed n matrices (n, p)")
    return _common(*matrices)


class _Checked(NamedTuple):
    stages: tuple[NDArray[Any], ...]
    rights: tuple[NDArray[Any], ...]
    solution: NDArray[Any]


def _checked(reduction: Reduction) -> _Checked:
    stages, rights = _stages(reduction.stages), _rights(reduction.rights)
    solution = _matrix(reduction.solution, "solution")
    if len(stages) != len(rights) or solution.shape != rights[0].shape:
        raise ValueError(
            f"got {len(stages)} stages, right sides of shape {rights[0].shape}, a solution of shape {solution.shape}; "
            "needed n matrices (n, n), n of (n, p), and (n, p)"
        )
    *every, solution = _common(*stages, *rights, solution)
    return _Checked(tuple(every[: len(stages)]), tuple(every[len(stages) :]), solution)


def _identity(like: NDArray[Any]) -> NDArray[Any]:
    return exact(np.eye(len(like), dtype=int)) if like.dtype == object else np.eye(len(like))


def _like(value: Any, arrays: Sequence[NDArray[Any]]) -> Any:
    """Return a constant whose type keeps the entries of `arrays` exact, or float64."""
    return Fraction(value) if arrays[0].dtype == object else float(value)


def _weighted(weights: NDArray[Any], beta: Any, like: NDArray[Any]) -> NDArray[Any]:
    factors: NDArray[Any] = weights * Fraction(beta)
    return factors if like.dtype == object else factors.astype(float)


def _gammas(weights: NDArray[Any], beta: Any, like: NDArray[Any]) -> NDArray[Any]:
    factors: NDArray[Any] = np.empty(weights.shape, dtype=object)
    for index in np.ndindex(weights.shape):
        factors[index] = gamma(int(weights[index]), Fraction(beta))
    return factors if like.dtype == object else factors.astype(float)


def _pivot(matrix: NDArray[Any], k: int) -> Any:
    if matrix[k, k] == 0:
        raise ValueError(f"got a zero pivot in stage {k}; needed a nonzero pivot; interchange rows")
    return matrix[k, k]


def _rest(product: Any, name: str, cure: str) -> Any:
    if not product < 1:
        raise ValueError(f"got {name} = {float(product):.3g}; needed less than 1; this takes {cure}")
    return 1 - product


def _telescope(
    stages: Sequence[NDArray[Any]], beta: Any, columns: bool, size: Callable[[NDArray[Any]], NDArray[Any]], old: int
) -> NDArray[Any]:
    """Return β times the sum over k of 3 A_k(k) + `old` A_k(k-1), of the entries or of their sizes."""
    total = np.zeros_like(stages[0])
    for k in range(1, len(stages)):
        after, before = (size(trailing(stages[i], k, columns)) for i in (k, k - 1))
        total = total + 3 * after + old * before
    return np.asarray(_like(beta, stages) * total)


def _strict(stages: Sequence[NDArray[Any]], reduced: Sequence[NDArray[Any]], beta: Any, columns: bool) -> NDArray[Any]:
    *matrices, like = _common(*stages, *reduced, reduced[0])
    stages, reduced = matrices[: len(stages)], matrices[len(stages) :]
    one, two = (_like(gamma(count, Fraction(beta)), [like]) for count in (1, 2))
    total = np.zeros_like(like)
    for k in range(1, len(stages)):
        head = trailing(reduced[k - 1], k - 1, columns)[k - 1]
        quotients = trailing(stages[k - 1], k, columns=False)[:, k - 1] / _pivot(stages[k - 1], k - 1)
        product = trailing(np.multiply.outer(quotients, head), k, columns)
        total = total + one * abs(trailing(reduced[k], k, columns)) + two * abs(product)
    return np.asarray(total)
