r"""Compare the sharpness and the cost of the bounds on the error of an inverse.

The bound from the residual is within a thousandth of the error because it computes the residual with more digits than
the inverse has. The bounds from counted roundings need no additional digits, but they are tens to thousands of times
larger.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from gpbnb.arithmetic.array import FloatArray
from gpbnb.arithmetic.formats import FloatFormat
from gpbnb.arithmetic.rational import column_sum_norm, true_inverse
from gpbnb.bounds import inverse as bounds
from gpbnb.report.inversion import experiment, theory


def elimination(n: int) -> int:
    """Count the operations of an inverse: elimination of an (n, n) matrix and n triangular solutions.

    Multiplications, divisions, additions and subtractions count as one each; zeros of the identity are not exploited.
    """
    triangularize = sum(rows + 2 * rows**2 for rows in range(1, n))
    forward = n * n * (n - 1)
    return triangularize + forward + forward + n * n


def product(n: int) -> int:
    """Count the operations of a product of two (n, n) matrices."""
    return n * n * (2 * n - 1)


def _stages(n: int) -> int:
    """Count the operations that sum 3|new| + 2|old| over all stages, for the matrix and for n right-hand sides."""
    return sum(4 * rows**2 + 4 * rows * n for rows in range(1, n))


@dataclass(frozen=True)
class Price:
    """What a bound achieves and what it costs.

    Parameters
    ----------
    bound : its name.
    ratios : median of bound over error for each size of matrix.
    operations : number of operations for the bound, divided by that for the inverse itself, at the largest size.
    digits : digits in which the bound is evaluated, as a multiple of the t digits of the inverse.
    """

    bound: str
    ratios: tuple[float, ...]
    operations: float
    digits: str


#: For each bound, its name in :func:`gpbnb.report.inversion.experiment.trial`, its operations, and the digits it needs.
KNOWN: dict[str, tuple[str, Callable[[int], int], str]] = {
    "Wilkinson": ("Wilkinson", lambda n: 2 * n * n, "53 bits"),
    "Higham": ("Higham", lambda n: 3 * product(n), "53 bits"),
    "probabilistic, 99 %": ("probabilistic", lambda n: 3 * product(n), "53 bits"),
    "the report's, corrected": ("corrected", lambda n: _stages(n) + 3 * product(n), "53 bits"),
    "ball arithmetic": ("ball", elimination, "t, balls"),
    "preconditioned balls": ("preconditioned ball", lambda n: 2 * elimination(n) + 2 * product(n), "t, balls"),
}


def _residual(a: FloatArray, x: FloatArray, inverse: Any) -> dict[str, tuple[float, Callable[[int], int], str]]:
    """Return bounds from the residual: (39) as printed, its computable form, and the residual in t, 2t and 4t bits."""
    exactly = theory.residual(a, x)
    size = float(column_sum_norm(exactly))
    known = float(column_sum_norm(inverse)) * size
    bits = int(np.ceil(a.format.precision * np.log2(a.format.base)))
    found: dict[str, tuple[float, Callable[[int], int], str]] = {
        "(39), true inverse known": (known, lambda n: product(n) + n * n, "2t"),
        "(39), computed inverse": (float(theory.residual_bound(x, exactly)), lambda n: product(n) + 2 * n * n, "2t"),
    }
    for times in (1, 2, 4):
        digits = "t" if times == 1 else f"{times}t"
        bound = bounds.a_posteriori(a, x, times * bits)
        found[f"residual, {digits}"] = (bound, lambda n: 2 * product(n), f"{digits}, balls")
    return found


def prices(
    sizes: Sequence[int], repeats: int, rng: np.random.Generator, fmt: FloatFormat | None = None
) -> tuple[Price, ...]:
    """Compare all bounds on the same random inverses.

    Parameters
    ----------
    sizes : numbers of rows.
    repeats : number of matrices of each size, with entries uniform between -1 and 1, inverted with pivoting.
    fmt : format of the inverses; by default 24 bits, rounded to nearest.

    Returns
    -------
    prices : one for each bound, those from the residual first.
    """
    fmt = fmt or FloatFormat(2, 24)
    names = [name for name, _, _ in KNOWN.values()]
    ratios: dict[str, list[list[float]]] = {}
    costs: dict[str, tuple[Callable[[int], int], str]] = {}
    for place, n in enumerate(sizes):
        for _ in range(repeats):
            a = fmt.array(experiment.FAMILIES["random"](n, rng))
            one = experiment.trial(a, True, names)
            found = _residual(a, one.computed, true_inverse(a))
            for known, (name, operations, digits) in KNOWN.items():
                if name in one.bounds:
                    found[known] = one.bounds[name], operations, digits
            for name, (bound, operations, digits) in found.items():
                costs[name] = operations, digits
                ratios.setdefault(name, [[] for _ in sizes])[place].append(bound / float(one.error))
    largest = max(sizes)
    return tuple(
        Price(
            name,
            tuple(float(np.median(each)) for each in ratios[name]),
            operations(largest) / elimination(largest),
            digits,
        )
        for name, (operations, digits) in costs.items()
    )
