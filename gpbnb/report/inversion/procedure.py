r"""The procedure of Figure III-1: a bound on the error of an inverse, computed while inverting.

The inverse is computed in the arithmetic of the format. Its errors are then evaluated from the digits by the formulas
of :mod:`gpbnb.report.inversion.theory`. A :class:`Reading` settles whatever the text leaves open.

Source: hung1984, ch. II, section 11; the texts of the boxes are in hung1982, ch. III.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from itertools import product
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from gpbnb.arithmetic.array import FloatArray
from gpbnb.arithmetic.bounds import column_sum
from gpbnb.arithmetic.rational import exact
from gpbnb.report.inversion import theory
from gpbnb.report.inversion.theory import Norm, Reduction

# -- the computation, in the arithmetic of the format ---------------------------------------------


def reduce(a: FloatArray, pivot: bool = False, right: FloatArray | None = None) -> Reduction:
    """Run the boxes of the computation: stages, right-hand sides and solution, as FloatArrays.

    They are "Triangularization of A into A_T", (45)-(58), "Use the same triangularization transformation to change u_j
    to b_j", and "Back substitution to solve A_T x_j = b_j", (65)-(79). The digits are those of
    :func:`gpbnb.arithmetic.linalg.inv`. Section 10 mentions partial pivoting, which section 11 omits.

    Parameters
    ----------
    right : (n, p), by default the identity, whose solution is the inverse.
    """
    from gpbnb.arithmetic import linalg

    found, n = linalg.lu(a, pivot), len(a)
    right = a.format.array(np.eye(n, dtype=int)) if right is None else right
    stages, rights = [a[found.permutation]], [right[found.permutation]]
    for k in range(n - 1):
        A, b, m = stages[-1], rights[-1], -found.lower[k + 1 :, k, np.newaxis]
        changed = A[k + 1 :, k + 1 :] + m * A[k, k + 1 :]
        stages.append(A.at[k + 1 :, k].set(0).at[k + 1 :, k + 1 :].set(changed))
        rights.append(b.at[k + 1 :].set(b[k + 1 :] + m * b[k]))
    return Reduction(tuple(stages), tuple(rights), linalg.solve(stages[-1], rights[-1]))


def as_floats(reduction: Reduction) -> Reduction:
    """Convert a reduction to float64, in which bounds are quick to evaluate."""
    stages, rights = (tuple(part.to_float() for part in parts) for parts in reduction[:2])
    return Reduction(stages, rights, reduction.solution.to_float())


def as_fractions(reduction: Reduction) -> Reduction:
    """Convert a reduction to exact numbers."""
    return Reduction(
        [exact(s) for s in reduction.stages], [exact(r) for r in reduction.rights], exact(reduction.solution)
    )


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

    def __str__(self) -> str:
        signs = "signed" if self.signed else "sizes"
        norm = "" if self.norm == "column sum" else f", {self.norm}"
        return f"{signs}, {self.form}, {'A_T' if self.triangular else 'A'}{norm}"


def readings() -> Iterator[Reading]:
    """Return all distinct readings; sums of norms do not depend on signs."""
    for signed, form, triangular, norm in product((True, False), FORMS, (False, True), NORMS):
        if not (signed and form == "norms throughout"):
            yield Reading(signed, form, triangular, norm)


class Bound(NamedTuple):
    """The bound of the procedure in one reading, absolute (96) and relative (97)."""

    reading: Reading
    bound: Any
    relative_bound: Any


def evaluate_all(reduction: Reduction, beta: Any, several: Iterable[Reading]) -> Iterator[Bound]:
    """Evaluate the error boxes in several readings, with their common parts computed once.

    Parameters
    ----------
    reduction : reduction of an inverse, whose first right-hand sides are the columns of the identity; in float64, or in
        Fractions for an exact bound.
    beta : unit roundoff β, a float or a Fraction accordingly.
    """
    x = reduction.solution
    brackets = {s: theory.bracket(reduction, theory.perturbation(reduction, beta, s), s) for s in (True, False)}
    # The rows of the errors, and so the columns of the inverse that multiplies them, are in the order of elimination.
    order = np.argmax(reduction.rights[0] != 0, axis=1)
    fronts = {False: x[:, order], True: _upper_inverse(reduction.stages[-1])}
    for reading in several:
        norm, front, e = NORMS[reading.norm], fronts[reading.triangular], brackets[reading.signed]
        if reading.form == "norms throughout":
            bound = norm(front) * _sum_of_norms(reduction, beta, norm)
        elif reading.form == "chart":
            bound = norm(front @ e if reading.signed else abs(front) @ e)
        else:
            bound = norm(front) * norm(e)
        yield Bound(reading, bound, bound / norm(x))


def _sum_of_norms(reduction: Reduction, beta: Any, norm: Norm) -> Any:
    """Return ‖Ã‖‖x‖ + ‖ΔA‖‖x‖ + ‖b̃‖ + ‖Δb‖ with (61) and (62), for all right-hand sides as matrices."""
    back = theory.back_substitution_error(reduction, beta)
    first = theory.printed_triangularization_norm(reduction.stages, beta, norm)
    right = theory.printed_triangularization_norm(reduction.rights, beta, norm, columns=False)
    return (first + norm(back.matrix)) * norm(reduction.solution) + right + norm(back.right)


def _upper_inverse(u: Any) -> NDArray[Any]:
    """Invert an upper triangular matrix by back substitution in the arithmetic of its entries."""
    n = len(u)
    x = 0 * u + np.eye(n, dtype=int)
    for k in reversed(range(n)):
        for j in range(k + 1, n):
            x[k] = x[k] - u[k, j] * x[j]
        x[k] = x[k] / u[k, k]
    return np.asarray(x)
