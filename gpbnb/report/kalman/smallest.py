"""The smallest filters that violate (105), (108) and (125), in exact arithmetic on rounded Fractions.

The code is slow and obvious, shares nothing with the compiled filter of :mod:`gpbnb.filters.run`, and is its
oracle.
"""

from __future__ import annotations

from fractions import Fraction
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from gpbnb.arithmetic.algebra import rounded_algebra
from gpbnb.arithmetic.formats import FloatFormat
from gpbnb.arithmetic.rational import exact
from gpbnb.filters.forms import Form
from gpbnb.filters.steps import BlockAlgebra, LinearStep
from gpbnb.report.kalman import exact_step, report_bounds


class FilterCase(NamedTuple):
    """A filter and its first measurement, exact, as arguments of :func:`gpbnb.report.kalman.exact_step.exact_step`."""

    Phi: NDArray[Any]
    H: NDArray[Any]
    Q: NDArray[Any]
    R: NDArray[Any]
    x: NDArray[Any]
    P: NDArray[Any]
    z: NDArray[Any]


def scalar(fmt: FloatFormat, r: Any = None, h: Any = 1, z: Any = 0) -> FilterCase:
    """Return a filter with one state and one measurement, with Q = 0 and every other number 1 except R, z and maybe H.

    Parameters
    ----------
    fmt : format that determines the default R, b**(-t - 1), which is so small that 1 + R rounds to 1.
    r, h, z : other values of R, H and z; numbers or strings.
    """
    one = exact([[1]])
    small = Fraction(1, fmt.base ** (fmt.precision + 1)) if r is None else r
    return FilterCase(one, exact([[h]]), one * 0, exact([[small]]), exact([1]), one, exact([z]))


def correlated() -> FilterCase:
    """Return the smallest filter, with two states, that violates (108) with the first form of (99) in four digits.

    The first entry of the gain is (1.001 · 1.001 - 1.002)/S, which four-digit arithmetic rounds to zero.
    """
    one = np.eye(2, dtype=int)
    P = [["1.001", "-1.002"], ["-1.002", "2"]]
    return FilterCase(
        exact(one), exact([["1.001", "1"]]), exact(one * 0), exact([[1]]), exact([0, 0]), exact(P), exact([1])
    )


def rounded_step(
    fmt: FloatFormat, case: FilterCase, second: bool = False
) -> tuple[NDArray[Any], NDArray[Any], NDArray[Any]]:
    """Take one step with each operation rounded, in the order of the report: (100), (99), (101), (109)-(111).

    Parameters
    ----------
    fmt : format that rounds each result; the numbers of `case` are not rounded.
    case : filter and measurement.
    second : whether the estimate uses the second form of (99), with the new covariance.

    Returns
    -------
    x (n,), K (n, 1), P (n, n), as Fractions.
    """
    Phi, H, Q, R, x, P, z = case
    algebra = rounded_algebra(exact, np.vectorize(fmt.round, otypes=[object]))
    given = {"Phi": Phi, "H": H, "Q": Q, "R": R}
    if second:
        given["RI"] = algebra.invert(R, algebra.identity(len(R))).matrix
    step = LinearStep(
        Form.HUNG_SECOND_GAIN if second else Form.HUNG, BlockAlgebra(algebra, algebra, algebra, algebra), given
    )
    (x, P), (K, _), _ = step.taken((x, P), z)
    return x, K, P


def gain_ratio(fmt: FloatFormat, case: FilterCase, steps: int = 1) -> float:
    """Return the largest error of the gain over (108) in the last of some steps, which have the same measurement."""
    rounded, exactly = case, case
    for _ in range(steps):
        x, K, P = rounded_step(fmt, rounded)
        rounded, true = rounded._replace(x=x, P=P), exact_step.exact_step(*exactly)
        exactly = exactly._replace(x=true.x, P=true.P)
    beta: Any = fmt.unit_roundoff
    bound = report_bounds.gain_count(*true.gain.shape) * beta * abs(true.gain)
    pairs = zip(abs(K - true.gain).flat, bound.flat, strict=True)
    return max((float(e / b) if b else float("inf") for e, b in pairs if e), default=0.0)
