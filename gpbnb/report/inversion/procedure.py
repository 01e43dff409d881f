r"""The procedure of Figure III-1: a bound on the error of an inverse, computed while inverting.

There is one function for each box of the chart, and :func:`run` for the whole chart. The inverse is computed in the
arithmetic of the format. The errors are then evaluated from its digits by the formulas of
:mod:`gpbnb.report.inversion.theory`. A :class:`Reading` settles whatever the text leaves open.

Source: hung1984, ch. II, section 11; the texts of the boxes are in hung1982, ch. III.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from itertools import product
from typing import Any, NamedTuple, cast

import numpy as np
from numpy.typing import NDArray

from gpbnb.arithmetic.array import FloatArray
from gpbnb.arithmetic.bounds import column_sum
from gpbnb.arithmetic.rational import exact
from gpbnb.report.inversion import theory
from gpbnb.report.inversion.theory import Norm, Perturbation, Reduction

# -- the computation, in the arithmetic of the format ---------------------------------------------


class Triangularization(NamedTuple):
    """Every stage of the elimination of a matrix, with multipliers and row order.

    Parameters
    ----------
    stages : n FloatArrays (n, n), from the given matrix with its rows in final order to the upper triangular matrix.
    multipliers : n - 1 FloatArrays; the k-th, of length n - k, holds the factors of row k before it was added.
    order : (n,), the rows of the given matrix in the order in which they were eliminated.
    """

    stages: tuple[FloatArray, ...]
    multipliers: tuple[FloatArray, ...]
    order: NDArray[np.intp]

    @property
    def upper(self) -> FloatArray:
        """The upper triangular matrix A_T, (63)."""
        return self.stages[-1]


def triangularize(a: FloatArray, pivot: bool = False) -> Triangularization:
    """Box "Triangularization of A into A_T", (45)-(58); the digits are those of :func:`gpbnb.arithmetic.linalg.lu`.

    Parameters
    ----------
    a : (n, n).
    pivot : whether to use partial pivoting, which section 10 mentions and section 11 omits.
    """
    from gpbnb.arithmetic import linalg

    found = linalg.lu(a, pivot)
    n, order = len(a), found.permutation
    work = a[order]
    zero = a.format.array(0)
    stages, multipliers = [work], []
    for k in range(n - 1):
        m = -found.lower[k + 1 :, k]
        changed = work[k + 1 :, k + 1 :] + m[:, np.newaxis] * work[k, k + 1 :]
        below = np.zeros((n, n), dtype=bool)
        below[k + 1 :, k] = True
        work = _replaced(cast(FloatArray, np.where(below, zero, cast(Any, work))), (k + 1, k + 1), changed)
        stages.append(work)
        multipliers.append(m)
    return Triangularization(tuple(stages), tuple(multipliers), order)


def transform(triangular: Triangularization, right: FloatArray) -> tuple[FloatArray, ...]:
    """Box "Use the same triangularization transformation to change u_j to b_j": every stage of the right-hand sides.

    Parameters
    ----------
    right : (n, p), a column for each right-hand side; the identity for an inverse.

    Returns
    -------
    rights : n FloatArrays (n, p), with rows in the order of elimination; the last is b_T of (64).
    """
    work = right[triangular.order]
    rights = [work]
    for k, m in enumerate(triangular.multipliers):
        work = _replaced(work, (k + 1, 0), work[k + 1 :] + m[:, np.newaxis] * work[k])
        rights.append(work)
    return tuple(rights)


def substitute(upper: FloatArray, right: FloatArray) -> FloatArray:
    """Box "Back substitution to solve A_T x_j = b_j", (65)-(79).

    Parameters
    ----------
    upper, right : (n, n), upper triangular, and (n, p).

    Returns
    -------
    solution : (n, p).
    """
    from gpbnb.arithmetic import linalg

    return linalg.solve(upper, right)


def reduce(a: FloatArray, pivot: bool = False) -> Reduction:
    """Run the three boxes of the computation: stages, right-hand sides and the inverse, as FloatArrays.

    Parameters
    ----------
    a, pivot : as in :func:`triangularize`.
    """
    triangular = triangularize(a, pivot)
    rights = transform(triangular, a.format.array(np.eye(len(a), dtype=int)))
    return Reduction(triangular.stages, rights, substitute(triangular.upper, rights[-1]))


def as_floats(reduction: Reduction) -> Reduction:
    """Convert a reduction to float64, in which bounds are quick to evaluate."""
    stages, rights = (tuple(part.to_float() for part in parts) for parts in reduction[:2])
    return Reduction(stages, rights, reduction.solution.to_float())


def _replaced(a: FloatArray, corner: tuple[int, int], block: FloatArray) -> FloatArray:
    """Return `a` with its lower right block, from `corner` on, replaced."""
    i, j = corner
    lower = cast(FloatArray, np.concatenate([cast(Any, a[i:, :j]), cast(Any, block)], axis=1))
    return cast(FloatArray, np.concatenate([cast(Any, a[:i]), cast(Any, lower)]))


# -- its errors, from the digits of the computation -----------------------------------------------

#: Norms by name.
NORMS: dict[str, Norm] = {
    "column sum": column_sum,
    "row sum": lambda a: abs(a).sum(axis=1).max(),
    "largest entry": lambda a: abs(a).max(),
    "Frobenius": lambda a: np.linalg.norm(np.asarray(a, dtype=np.float64)),
    "spectral": lambda a: np.linalg.norm(np.asarray(a, dtype=np.float64), 2),
}

#: Quantities whose norm is taken, the matrix of (95) as in the last box, factors of (96), or terms of (61), (62).
FORMS = ("chart", "(96)", "norms throughout")


@dataclass(frozen=True)
class Reading:
    """A choice for each question that the text of the procedure leaves open.

    Parameters
    ----------
    signed : whether ε has one sign throughout, as in (59), (60) and (87)-(90); otherwise sizes are added, (61), (62).
    form : one of :data:`FORMS`.
    triangular : whether the inverse in (94) is that of A_T, to which ΔA and Δb belong; otherwise that of A.
    norm : one of :data:`NORMS`; the report uses "column sum", (22).
    """

    signed: bool = True
    form: str = "chart"
    triangular: bool = False
    norm: str = "column sum"

    def __post_init__(self) -> None:
        for name, known in (("form", FORMS), ("norm", tuple(NORMS))):
            if getattr(self, name) not in known:
                raise ValueError(f"{name}: got {getattr(self, name)!r}; needed one of {', '.join(known)}")

    def __str__(self) -> str:
        signs = "signed" if self.signed else "sizes"
        norm = "" if self.norm == "column sum" else f", {self.norm}"
        return f"{signs}, {self.form}, {'A_T' if self.triangular else 'A'}{norm}"


def readings() -> Iterator[Reading]:
    """Return all distinct readings; sums of norms do not depend on signs."""
    for signed, form, triangular, norm in product((True, False), FORMS, (False, True), NORMS):
        if not (signed and form == "norms throughout"):
            yield Reading(signed, form, triangular, norm)


def triangularization_errors(reduction: Reduction, beta: Any, signed: bool = True) -> Perturbation:
    """Boxes "Generate Ã, error in A_T" and "Generate b̃_j, error in b_j", (59) and (60)."""
    if signed:
        return Perturbation(
            theory.printed_triangularization_error(reduction.stages, beta),
            theory.printed_right_side_error(reduction.rights, beta),
        )
    return Perturbation(
        theory.triangularization_bounds(reduction.stages, beta), theory.right_side_bounds(reduction.rights, beta)
    )


def back_substitution_errors(reduction: Reduction, beta: Any, signed: bool = True) -> Perturbation:
    """Boxes "Generation of ΔA, do it once" and "Generation of Δb_j", (89) and (90)."""
    change = theory.printed_back_substitution_error(reduction.stages[-1], beta)
    right = theory.printed_back_substitution_right_error(reduction.rights[-1], beta)
    return Perturbation(change, right) if signed else Perturbation(abs(change), abs(right))


def resultant_errors(first: Perturbation, second: Perturbation) -> Perturbation:
    """Box "δA = Ã + ΔA, δb_j = b̃_j + Δb_j", (91) and (92)."""
    return Perturbation(first.matrix + second.matrix, first.right + second.right)


def bracket(errors: Perturbation, solution: Any, signed: bool = True) -> NDArray[Any]:
    r"""E of (95), :math:`\delta b_j-\delta A\hat x_j`, or of sizes :math:`|\delta b_j|+|\delta A||\hat x_j|`."""
    x = _plain(solution)
    e = errors.right - errors.matrix @ x if signed else abs(errors.right) + abs(errors.matrix) @ abs(x)
    return np.asarray(e)


def inverse_error(inverse: Any, e: Any, signed: bool = True) -> NDArray[Any]:
    """Box "δ(A⁻¹) = A⁻¹ [δb_1 - δA x_1 ... δb_n - δA x_n]", (95)."""
    front = _plain(inverse)
    return np.asarray(front @ e if signed else abs(front) @ abs(e))


@dataclass(frozen=True)
class ProcedureResult:
    """Intermediate results and bound of the procedure.

    `norm_of_inverse` is the norm of the computed inverse, by which (97) divides.
    """

    reading: Reading
    reduction: Reduction
    beta: Any
    errors: Perturbation
    bound: Any
    norm_of_inverse: Any

    @property
    def relative_bound(self) -> Any:
        """Bound of the relative error norm, (97)."""
        return self.bound / self.norm_of_inverse


def evaluate(reduction: Reduction, beta: Any, reading: Reading | None = None) -> ProcedureResult:
    """Evaluate the error boxes in one reading.

    Parameters
    ----------
    reduction : reduction of an inverse, whose first right-hand sides are the columns of the identity; in FloatArrays
        or exact entries for an exact bound, or in float64.
    beta : unit roundoff β.
    reading : by default with signs, the norm of (95), and the computed inverse of A.
    """
    return next(evaluate_all(reduction, beta, (reading or Reading(),)))


def evaluate_all(reduction: Reduction, beta: Any, several: Iterable[Reading]) -> Iterator[ProcedureResult]:
    """Evaluate several readings, with their common parts computed once."""
    solution = _plain(reduction.solution)
    second = {signed: back_substitution_errors(reduction, beta, signed) for signed in (True, False)}
    errors = {s: resultant_errors(triangularization_errors(reduction, beta, s), second[s]) for s in second}
    brackets = {signed: bracket(errors[signed], solution, signed) for signed in errors}
    # The rows of the errors, and so the columns of the inverse that multiplies them, are in the order of elimination.
    order = np.argmax(_plain(reduction.rights[0]) != 0, axis=1)
    fronts = {False: solution[:, order], True: _upper_inverse(reduction.stages[-1])}
    for reading in several:
        norm, front, e = NORMS[reading.norm], fronts[reading.triangular], brackets[reading.signed]
        if reading.form == "norms throughout":
            bound = norm(front) * _sum_of_norms(reduction, beta, second[False], norm)
        elif reading.form == "chart":
            bound = norm(inverse_error(front, e, reading.signed))
        else:
            bound = norm(front) * norm(e)
        yield ProcedureResult(reading, reduction, beta, errors[reading.signed], bound, norm(solution))


def run(a: FloatArray, pivot: bool = False, reading: Reading | None = None) -> ProcedureResult:
    """Run the whole chart, from the given matrix to the error bound of its inverse; the bound is exact.

    Parameters
    ----------
    a : (n, n).
    pivot : whether to use partial pivoting.
    reading : see :func:`evaluate`.

    Returns
    -------
    outcome : the bound is a Fraction, or a float for the Frobenius and spectral norms.

    References
    ----------
    hung1984, ch. II, Figure III-1.
    """
    return evaluate(reduce(a, pivot), a.format.unit_roundoff, reading)


def _sum_of_norms(reduction: Reduction, beta: Any, second: Perturbation, norm: Norm) -> Any:
    """Return ‖Ã‖‖x‖ + ‖ΔA‖‖x‖ + ‖b̃‖ + ‖Δb‖ with (61) and (62), for all right-hand sides as matrices."""
    stages, rights = ([_plain(part) for part in parts] for parts in reduction[:2])
    first = theory.printed_triangularization_norm(reduction.stages, beta, norm)
    # (62) for all columns at once, so that the same norm is used throughout
    right = sum(
        weight * beta * norm(theory.trailing(rights[i], k, columns=False))
        for k in range(1, len(stages))
        for weight, i in ((3, k), (2, k - 1))
    )
    return (first + norm(second.matrix)) * norm(_plain(reduction.solution)) + right + norm(second.right)


def _upper_inverse(upper: Any) -> NDArray[Any]:
    """Invert an upper triangular matrix by back substitution in the arithmetic of its entries."""
    u = _plain(upper)
    n = len(u)
    x = np.zeros_like(u) + np.eye(n, dtype=int)
    for k in reversed(range(n)):
        for j in range(k + 1, n):
            x[k] = x[k] - u[k, j] * x[j]
        x[k] = x[k] / u[k, k]
    return x


def _plain(a: Any) -> NDArray[Any]:
    """Keep float64, convert everything else to exact numbers."""
    return a if isinstance(a, np.ndarray) and a.dtype == np.float64 else exact(a)
