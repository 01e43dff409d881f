"""Error constants and norms from which every bound is built."""

from __future__ import annotations

import contextlib
import math
import sys
from fractions import Fraction
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gpbnb.arithmetic.conversion import exact_fraction


def column_sum(a: NDArray[Any]) -> Any:
    """Largest column sum of absolute values, (22), computed in the arithmetic of the entries."""
    return abs(a).sum(axis=0).max()


def gamma(n: int, unit_roundoff: Fraction) -> Fraction:
    r"""Bound of the relative error of n roundings in a row, to every order.

    .. math:: \Bigl|\prod_{i=1}^n (1+\epsilon_i)^{\pm1} - 1\Bigr| \le \gamma_n
        = \frac{n\beta}{1 - n\beta}, \qquad |\epsilon_i| \le \beta,\ n\beta < 1

    Parameters
    ----------
    n : number of roundings, at least 0.
    unit_roundoff : β, exact.

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
    r"""Probabilistic form of :func:`gamma`, about √n β, exceeded at most with the probability `failure`.

    .. math:: \tilde\gamma_n(\lambda) = \exp\Bigl(\lambda\sqrt n\,\beta
        + \frac{n\beta^2}{1-\beta}\Bigr) - 1, \qquad
        \text{failure} = 2\exp\Bigl(-\frac{\lambda^2(1-\beta)^2}{2}\Bigr)

    It assumes that rounding errors are independent with mean zero. This is a fair model of rounding to nearest
    for data with many digits, but wrong for chopping. Then :math:`\sum\log(1+\epsilon_i)` is a
    sum of independent terms of size at most :math:`\beta/(1-\beta)`, and its mean is at most
    :math:`n\beta^2/(1-\beta)`. Hoeffding's inequality bounds its deviation from the mean.

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


def above(value: Fraction) -> float:
    """Return the least float64 that is not below a number.

    Examples
    --------
    >>> from fractions import Fraction
    >>> above(Fraction(1, 10)) >= Fraction(1, 10), above(Fraction(1, 4))
    (True, 0.25)
    """
    try:
        near = float(value)
    except OverflowError:
        return math.inf if value > 0 else -sys.float_info.max
    return near if Fraction(near) >= value else math.nextafter(near, math.inf)


def all_above(values: Any) -> NDArray[np.float64]:
    """Return the least float64 numbers that are not below given ones: numbers as exact as text, or infinite, or NaN.

    Examples
    --------
    >>> all_above(["1e-3", math.inf]).tolist(), -all_above([-Fraction(1, 10)])[0] <= Fraction(1, 10)
    ([0.001, inf], True)
    """
    given = np.asarray(values)
    if given.dtype == np.float64:
        return given
    found = [_above_number(each) for each in given.ravel().tolist()]
    return np.array(found, dtype=np.float64).reshape(given.shape)


def _above_number(value: Any) -> float:
    with contextlib.suppress(TypeError, ValueError, OverflowError):
        if not math.isfinite(near := float(value)):
            return near
    return above(exact_fraction(value))
