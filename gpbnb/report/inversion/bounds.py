r"""Bounds on the error of a computed inverse that count roundings, and one in ball arithmetic.

Each function bounds :math:`\|X - A^{-1}\|` in the column-sum norm (22), where X is the inverse of the t-digit matrix A
as :func:`gpbnb.arithmetic.linalg.inv` computes it. It returns a float64 above the value of its formula, and raises
ValueError if no bound can be proved. :func:`gpbnb.bounds.inverse.a_posteriori` uses the residual of X instead.
"""

from __future__ import annotations

import math
from fractions import Fraction
from typing import Any

import flint
import numpy as np

from gpbnb.arithmetic.array import FloatArray
from gpbnb.arithmetic.bounds import above, gamma
from gpbnb.arithmetic.conversion import exact_fraction
from gpbnb.arithmetic.linalg import LU
from gpbnb.arithmetic.rational import column_sum_norm, exact, rationals
from gpbnb.bounds.inverse import below_one


def wilkinson(factors: LU, x: FloatArray) -> float:
    r"""Bound from the growth of the numbers, after Wilkinson.

    .. math:: \|X - A^{-1}\| \le \|X\|\,\frac{g}{1-g}, \qquad
        g = \gamma_{3n}\,n\,l\,n\,u\,\|X\| + (1+\gamma_{3n})\,\eta\,n\,((2n+u)\,(\|X\| + n\,l) + 2n)

    where l and u are the largest sizes of entries in the factors; l = 1 with partial pivoting. The product
    :math:`n l\,n u` bounds :math:`\||L||U|\|`. A result that underflows is wrong by at most η, the smallest positive
    number of the format; without limits of its exponents, η = 0.

    Parameters
    ----------
    factors : the factors of A from :func:`gpbnb.arithmetic.linalg.lu`.
    x : (n, n), the computed inverse.

    References
    ----------
    Wilkinson 1961; Higham 2002, Theorem 9.5.
    """
    n, norm = len(x), column_sum_norm(rationals(x))
    lower, upper = (abs(exact(each)).max() for each in (factors.lower, factors.upper))
    weight = gamma(3 * n, x.format.unit_roundoff)
    underflows = n * ((2 * n + upper) * (norm + n * lower) + 2 * n)
    g = weight * n * n * lower * upper * norm + (1 + weight) * _smallest(x) * underflows
    return below_one("‖G‖", norm * g, g, x.format.base)


def higham(factors: LU, x: FloatArray) -> float:
    r"""Bound from the computed factors, entry by entry.

    Each column of X solves :math:`(A + \Delta A_j)\hat x_j = u_j` with
    :math:`|\Delta A_j| \le \gamma_{3n} P^T|\hat L||\hat U|`, so that

    .. math:: \|X - A^{-1}\| \le \frac{\||X|G\|}{1 - \|G\|}, \qquad
        G = \gamma_{3n} P^T|\hat L||\hat U||X| + (1+\gamma_{3n})\,\eta\,(\mathbf 1 e^T|X| + P^T|\hat L|e\mathbf 1^T
        + 2n \mathbf 1\mathbf 1^T), \qquad e_i = 2n + |\hat u_{ii}|

    where a result that underflows is wrong by at most η: one of the 2n products and sums of an entry, or a quotient,
    whose error counts times its divisor.

    Parameters
    ----------
    factors, x : as in :func:`wilkinson`.

    References
    ----------
    Higham 2002, Theorem 9.4.
    """
    n, weight = len(x), gamma(3 * len(x), x.format.unit_roundoff)
    sizes, L, U = (abs(exact(each)) for each in (x, factors.lower, factors.upper))
    lower = np.empty_like(L)
    lower[factors.permutation] = L
    e = 2 * n + U.diagonal()
    underflows = (1 + weight) * _smallest(x) * (e @ sizes + (lower @ e)[:, np.newaxis] + 2 * n)
    G = rationals(lower) * rationals(U) * rationals(sizes) * flint.fmpq(*weight.as_integer_ratio())
    G += rationals(underflows)
    return below_one("‖G‖", column_sum_norm(rationals(sizes) * G), column_sum_norm(G), x.format.base)


def _smallest(x: FloatArray) -> Fraction:
    """Return the largest error of a result that underflows; refuse formats with another overflow than an error."""
    fmt: Any = x.format
    if fmt.limits is not None and fmt.overflow != "raise":
        raise ValueError(
            f"got {fmt}; this bound needs overflow 'raise', because a result beyond the range is wrong by more than "
            "rounding. Use a_posteriori, which holds however the inverse was computed."
        )
    return Fraction(0) if fmt.limits is None else fmt.smallest


def ball(a: Any, x: FloatArray) -> float:
    r"""Bound from inverting A in ball arithmetic, :math:`\||X - \mathrm{mid}| + \mathrm{rad}\|`, by partial pivoting.

    The midpoints of the balls have as many bits as the format.

    Parameters
    ----------
    a : (n, n), a FloatArray, or exact numbers.
    x : (n, n), its computed inverse, or any other guess of it.

    References
    ----------
    Johansson 2017; A is inverted by python-flint.
    """
    precision, before = max(2, math.ceil(x.format.precision * math.log2(x.format.base))), flint.ctx.prec
    try:
        flint.ctx.prec = precision
        unit = flint.arb_mat(rationals(np.eye(len(x), dtype=int)))
        inverse = flint.arb_mat(rationals(a)).solve(unit, algorithm="lu")
        flint.ctx.prec = precision + 64
        off = (flint.arb_mat(rationals(x)) - inverse).transpose().tolist()
        sums = [sum((entry.abs_upper() for entry in column), flint.arb(0)).upper() for column in off]
        return max(above(exact_fraction(each)) for each in sums)
    except ZeroDivisionError:
        raise ValueError(
            f"got a matrix that {precision} bits cannot distinguish from a singular one; use more bits"
        ) from None
    finally:
        flint.ctx.prec = before
