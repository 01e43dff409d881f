r"""Errors of the roll angle that vary in a year: the weight with which a fitted drift counts them.

To first order, a phase error θ(t) turns a drift k into the false drift :math:`k\int_0^T w(t)\,\theta(t)\,dt` at right
angles, with the weight :math:`w(t) = 12t(t-T/2)/T^3` of the line fit. The weight is negative in the first half.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping

import numpy as np
from numpy.typing import ArrayLike, NDArray

from gpbnb.report.measurement import YEAR

Shape = Callable[[NDArray[np.float64]], NDArray[np.float64]]

ORBIT = 5859.0
"""Period of the orbit in s; Keiser et al. 2007."""

WORST = 1.5
"""The largest weighted mean of a phase error between -1 and 1, of one that changes its sign in the middle."""


def weight(share: ArrayLike) -> NDArray[np.float64]:
    """Weight of a phase error at a share t/T of the record, 12s(s - 1/2); its mean is 1."""
    s = np.asarray(share, dtype=np.float64)
    return 12 * s * (s - 0.5)


def _once_a_year(share: NDArray[np.float64]) -> NDArray[np.float64]:
    # Of all phases of the oscillation, this one has the largest weighted mean.
    return np.cos(2 * np.pi * share + math.atan2(3 / math.pi, 6 / math.pi**2))


#: Phase errors with the largest size 1, as functions of the share of the year.
SHAPES: Mapping[str, Shape] = {
    "constant": np.ones_like,
    "ramp from − to +": lambda share: 2 * share - 1,
    "− in the first half, + in the second": lambda share: np.where(share < 0.5, -1.0, 1.0),
    "zero in the first half": lambda share: np.where(share < 0.5, 0.0, 1.0),
    "zero in the second half": lambda share: np.where(share < 0.5, 1.0, 0.0),
    "one oscillation a year": _once_a_year,
    "one oscillation an orbit": lambda share: np.sin(2 * np.pi * share * YEAR / ORBIT),
}


def means(shape: Shape, panels: int = 2**14) -> tuple[float, float]:
    """Return the mean and the weighted mean of a phase error, by Gauss-Legendre quadrature in equal panels.

    The weighted mean is the constant phase error with the same false drift.

    Parameters
    ----------
    shape : phase error as a function of the share of the record; it may jump between panels only.
    """
    nodes, weights = np.polynomial.legendre.leggauss(6)
    share = (np.arange(panels)[:, None] + (nodes + 1) / 2) / panels
    value = shape(share) * weights / (2 * panels)
    return float(np.sum(value)), float(np.sum(value * weight(share)))


def independent_mean(interval: float, duration: float = YEAR) -> float:
    r"""Return the rms of the weighted mean of errors of rms 1, each constant for an `interval` and independent.

    .. math:: \sqrt{\frac{24}5\,\frac{\text{interval}}T}

    Parameters
    ----------
    interval : s, much less than the duration T.
    """
    return math.sqrt(24 / 5 * interval / duration)
