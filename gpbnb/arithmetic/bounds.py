"""Norms and error constants that every bound is made of; exact for exact input.

Entries may be Fractions, ints, floats (taken at their exact binary value) or a FloatArray.
"""

from __future__ import annotations

import math
from fractions import Fraction
from typing import Any

import numpy as np
from flint import fmpq, fmpq_mat
from numpy.typing import NDArray

from gpbnb.arithmetic.formats import exact_ratio


def exact(values: Any) -> NDArray[Any]:
    """Entries as exact Fractions, in an object array of the same shape.

    Raises
    ------
    ValueError : an entry is NaN or infinite.
    TypeError : an entry is not a number.
    """
    if hasattr(values, "to_fractions"):
        values = values.to_fractions()
    entries: NDArray[Any] = np.asarray(values, dtype=object)
    fractions = np.empty(entries.size, object)
    for i, entry in enumerate(entries.ravel().tolist()):
        if not isinstance(entry, Fraction):
            try:
                p, q, power = exact_ratio(entry)
            except (TypeError, ValueError) as error:
                index = np.unravel_index(i, entries.shape)
                where = f"entry {', '.join(map(str, index))}: " if index else ""
                raise type(error)(f"{where}{error}") from None
            entry = Fraction(p, q) * Fraction(10) ** power
        fractions[i] = entry
    return fractions.reshape(entries.shape)


def integers(fractions: NDArray[Any]) -> tuple[NDArray[Any], Fraction]:
    """Integers, and the one unit that they count, of exact Fractions: sums and products of integers are much faster."""
    common = math.lcm(*(entry.denominator for entry in fractions.flat))
    counts = [entry.numerator * (common // entry.denominator) for entry in fractions.flat]
    return np.array(counts, dtype=object).reshape(fractions.shape), Fraction(1, common)


def inverse_of(a: Any) -> NDArray[Any]:
    """The exact inverse of a square matrix (n, n), as Fractions.

    Raises
    ------
    ZeroDivisionError : the matrix is singular.
    """
    entries = exact(a)
    rows, columns = entries.shape
    given = fmpq_mat(rows, columns, [fmpq(entry.numerator, entry.denominator) for entry in entries.flat])
    found = [Fraction(int(entry.p), int(entry.q)) for entry in given.inv().entries()]
    return np.array(found, dtype=object).reshape(entries.shape)


def max_norm(x: Any) -> Fraction:
    r"""Largest size of an entry of a vector, :math:`\max_j |x_j|`; hung1984, ch. II, (21)."""
    entries = exact(x)
    if entries.ndim != 1:
        raise ValueError(f"got shape {entries.shape}; needed a vector (n,); take a matrix row by row")
    return max(abs(entries), default=Fraction(0))


def column_sum_norm(a: Any) -> Fraction:
    r"""Largest column sum, :math:`\max_j \sum_i |a_{ij}|`, of a matrix; hung1984, ch. II, (22)."""
    return max(_sizes(a).sum(axis=0), default=Fraction(0))


def row_sum_norm(a: Any) -> Fraction:
    r"""Largest row sum, :math:`\max_i \sum_j |a_{ij}|`: the matrix norm that belongs to (21)."""
    return max(_sizes(a).sum(axis=1), default=Fraction(0))


def _sizes(a: Any) -> NDArray[Any]:
    entries = exact(a)
    if entries.ndim != 2:
        raise ValueError(f"got shape {entries.shape}; needed a matrix (m, n); reshape a vector to (n, 1)")
    return np.asarray(abs(entries))


def gamma(n: int, unit_roundoff: Fraction) -> Fraction:
    r"""Bound of the relative error of n roundings on top of each other, to every order.

    .. math:: \Bigl|\prod_{i=1}^n (1+\epsilon_i)^{\pm1} - 1\Bigr| \le \gamma_n
        = \frac{n\beta}{1 - n\beta}, \qquad |\epsilon_i| \le \beta,\ n\beta < 1

    Parameters
    ----------
    n : number of roundings, at least 0.
    unit_roundoff : β, exact.

    Raises
    ------
    ValueError : nβ ≥ 1; so many roundings in so few digits have no such bound.

    References
    ----------
    Higham 2002, Lemma 3.1.
    """
    if n < 0 or unit_roundoff < 0:
        raise ValueError(f"got n = {n}, unit roundoff {unit_roundoff}; needed both at least 0")
    product = n * Fraction(unit_roundoff)
    if product >= 1:
        raise ValueError(
            f"got {n} roundings with unit roundoff {float(unit_roundoff):.3g}, a product of "
            f"{float(product):.3g}; needed less than 1; use more digits or fewer operations"
        )
    return product / (1 - product)


def gamma_probabilistic(n: int, unit_roundoff: Fraction, failure: float = 1e-2) -> float:
    r"""As :func:`gamma`, but exceeded with at most the probability `failure`: of size √n β.

    .. math:: \tilde\gamma_n(\lambda) = \exp\Bigl(\lambda\sqrt n\,\beta
        + \frac{n\beta^2}{1-\beta}\Bigr) - 1, \qquad
        \text{failure} = 2\exp\Bigl(-\frac{\lambda^2(1-\beta)^2}{2}\Bigr)

    It rests on roundings that are independent with mean zero: a fair model of rounding to nearest
    of data that have many digits, and wrong for chopping. Then :math:`\sum\log(1+\epsilon_i)` is a
    sum of independent terms of at most :math:`\beta/(1-\beta)` in size, whose mean is at most
    :math:`n\beta^2/(1-\beta)`; Hoeffding's inequality says how far it strays.

    Raises
    ------
    ValueError : `failure` outside (0, 1), or β ≥ 1.

    References
    ----------
    Higham & Mary 2019.
    """
    u = float(unit_roundoff)
    if not 0 < failure < 1:
        raise ValueError(f"got failure = {failure}; needed a probability above 0 and below 1")
    if n < 0 or not 0 <= u < 1:
        raise ValueError(f"got n = {n}, unit roundoff {u}; needed n >= 0 and 0 <= u < 1; use more digits")
    spread = math.sqrt(2 * math.log(2 / failure)) / (1 - u)
    return math.expm1(spread * math.sqrt(n) * u + n * u * u / (1 - u))
