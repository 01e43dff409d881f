r"""Errors of digital integration in t-digit arithmetic: discretization and rounding together.

The letters are those of savage2016: :math:`\omega_{bw}` bandwidth of the input in rad/s, T cycle time in s,
:math:`f_c = 1/T` iteration rate in Hz, :math:`\mu = \omega_{bw}T`, :math:`\sigma_x` rms of the input in any unit. A
"factor" is dimensionless: it is divided by the units of the input and of T. Functions apply to arrays of
:math:`\mu` entry by entry.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
import scipy
from numpy.typing import ArrayLike

from gpbnb.arithmetic.formats import FloatFormat
from gpbnb.arithmetic.rounding import Rounding, digit_unit, digits_text, rounding_named
from gpbnb.arithmetic.search import smallest_precision
from gpbnb.report.integration.theory import Floats, error_variance, integral_variance, positive

# -- both errors, in t-digit arithmetic ----------------------------------------------------------


def mean_square_rounding(fmt: FloatFormat) -> float:
    r"""Return the mean square relative error of one rounding to nearest, :math:`\kappa = b^{-2t}(b^2-1)/(24\ln b)`.

    It assumes a number whose logarithm is uniformly distributed, and an error uniformly distributed over a spacing
    :math:`b^{e-t}`.
    """
    b = fmt.base
    return float(b) ** (-2 * fmt.precision) * (b * b - 1) / (24 * math.log(b))


def mean_chopping(fmt: FloatFormat) -> float:
    r"""Return the mean relative error of chopping, :math:`\kappa_1 = b^{-t}(b-1)/(2\ln b)`, for the same numbers."""
    return float(fmt.base) ** -fmt.precision * (fmt.base - 1) / (2 * math.log(fmt.base))


class Errors(NamedTuple):
    """Standard deviations of the error of an integral, in the unit of the input times seconds."""

    discretization: float
    rounding: float

    @property
    def total(self) -> float:
        """Root-sum-square of both errors."""
        return math.hypot(*self)


def correlation_factor(change: ArrayLike) -> Floats:
    r"""Return how much more successive rounding errors add up than independent ones.

    .. math:: F = 1 + \sum_{k\ge1} \frac{6}{\pi^2k^2\,\sinh(2\pi^2k^2s^2)}

    The accumulator is a multiple of its spacing u, so the error of adding p depends only on the fractional part of p/u.
    If p changes little from cycle to cycle, so does the error. s is the rms change of p from one cycle to the
    next, in spacings; F is 1.05 at s = 0.5, and close to :math:`1/(30s^2)` for smaller s.
    """
    s = positive("change", change)[..., np.newaxis]
    k = np.arange(1, 65)
    with np.errstate(over="ignore"):
        return np.asarray(1 + np.sum(6 / (np.pi**2 * k**2 * np.sinh(2 * np.pi**2 * k**2 * s**2)), axis=-1))


def two_errors(sigma_x: float, omega_bw: float, f_c: float, duration: float, fmt: FloatFormat) -> Errors:
    r"""Return both errors of the trapezoidal rule in a format, after a `duration` t of many correlation times.

    The discretization error follows from ``error_variance``. With rounding to nearest, the rounding error has three
    parts:

    - the errors of the additions to the accumulator, whose variance grows as (23); their mean square is that of a
      spacing u of the accumulator, :math:`u^2F/12`;
    - the effect of ties in an even base: a tie occurs once in u / (spacing of the increment) additions, and rounding
      half away from zero moves it outwards, by :math:`\kappa_1E|p|` on average. The sum of these effects has
      the rms :math:`\kappa_1\sigma_xt\sqrt{(1+\varphi)/2\pi}`. Here 1/2 is the mean square of the difference between
      the fractions of time that a random walk spends above and below zero;
    - the roundings of sample, sum and product, each with the mean square :math:`\kappa` relative to its result.

    T/2 is treated as exact: its rounding changes the integral by a fraction that does not depend on the rate.

    With chopping, each addition takes the fraction :math:`\kappa_1` off the accumulator, so the accumulator leaks. With
    :math:`a = \kappa_1f_ct` the error has the variance
    :math:`(2\sigma_x^2t/\omega_{bw})\,(2a-3+4e^{-a}-e^{-2a})/2a`, or :math:`2\sigma_x^2ta^2/3\omega_{bw}` for small a.
    """
    if fmt.rounding not in Rounding.documented():
        raise ValueError(
            f"got rounding {fmt.rounding.value!r}; needed 'nearest' or 'chop', which the formulas describe"
        )
    mu, period, n = float(positive("omega_bw", omega_bw) / positive("f_c", f_c)), 1 / f_c, duration * f_c
    if n < 2:
        raise ValueError(f"got a duration of {n:.3g} cycles; needed at least 2")
    discretization = sigma_x * period * math.sqrt(float(error_variance(n, mu)))
    phi = math.exp(-mu)
    excess = mu / 2 / math.tanh(mu / 2)  # variance of the digital integral over that of the true integral
    share = mean_chopping(fmt)
    if fmt.rounding is Rounding.CHOP:
        leak = share * n
        variance = sigma_x**2 * duration / omega_bw * leak * float(integral_variance(leak)) * excess
        return Errors(discretization, math.sqrt(variance))
    before = mean_square_rounding(fmt) * (period * sigma_x) ** 2 * (2 + phi)
    nodes, weights = np.polynomial.legendre.leggauss(24)
    time = (nodes + 1) / 2 * omega_bw * duration
    spread = sigma_x / omega_bw * np.sqrt(2 * excess * (time + np.expm1(-time)))  # (23)
    change = period * sigma_x * math.sqrt(-math.expm1(-2 * mu) / 2)
    added = float(np.sum(weights / 2 * _addition(spread, change, fmt)))
    ties = share * sigma_x * duration * math.sqrt((1 + phi) / (2 * math.pi)) if fmt.base % 2 == 0 else 0.0
    return Errors(discretization, math.sqrt(n * (before + added) + ties**2))


def _addition(spread: Floats, change: float, fmt: FloatFormat) -> Floats:
    """Mean square error, F included, of adding to normal accumulators of the standard deviations `spread`."""
    b = float(fmt.base)
    top = np.floor(np.log(spread * 8) / math.log(b)) + 1
    # Sixteen octaves down from 8 standard deviations; smaller values add less than 2**-36 of the whole.
    e = top - np.arange(math.ceil(16 / math.log2(b)) + 1)[:, np.newaxis]
    spacing = b ** (e - fmt.precision)
    within = scipy.special.erf(b**e / (spread * math.sqrt(2)))
    share = within - np.concatenate([within[1:], np.zeros((1, len(spread)))])
    return np.asarray(np.sum(share * spacing**2 / 12 * correlation_factor(change / spacing), axis=0))


def independent_best_rate(omega_bw: float, duration: float, fmt: FloatFormat) -> float:
    r"""Return the best rate in Hz in closed form, for :math:`\mu\ll1` and independent roundings to nearest.

    .. math:: f_c = \left(\frac{\omega_{bw}^2}{3\kappa t}\right)^{1/3}

    At this rate, the variance of the rounding error, :math:`\kappa\sigma_x^2t^2f_c/\omega_{bw}`, is twice that of the
    discretization error, :math:`\sigma_x^2\omega_{bw}t/6f_c^2`. With chopping the two
    variances are equal at the best rate, :math:`f_c = (\omega_{bw}^2/4\kappa_1^2t^2)^{1/4}`. The rms of the input does
    not matter.
    """
    if fmt.rounding is Rounding.CHOP:
        return math.sqrt(omega_bw / (2 * mean_chopping(fmt) * duration))
    return float((positive("omega_bw", omega_bw) ** 2 / (3 * mean_square_rounding(fmt) * duration)) ** (1 / 3))


def best_rate(omega_bw: float, duration: float, fmt: FloatFormat) -> float:
    """Return the iteration rate in Hz, below :func:`stall_rate`, that minimizes the total of :func:`two_errors`.

    `omega_bw` is in rad/s; the `duration` in s is many correlation times 1/omega_bw.
    """
    guess = independent_best_rate(omega_bw, duration, fmt)

    def total(log: float) -> float:
        return two_errors(1.0, omega_bw, math.exp(log), duration, fmt).total

    low, high = max(guess / 100, 2.001 / duration), max(guess * 10, 100 / duration)
    found: Any = scipy.optimize.minimize_scalar(
        total, bounds=(math.log(low), math.log(high)), method="bounded", options={"xatol": 1e-5}
    )
    if total(found.x) > math.sqrt(2 * duration / omega_bw) / 2:
        raise ValueError(
            f"got {fmt}, {duration:g} s, {omega_bw:g} rad/s; needed an error below half of the integral at some rate; "
            f"use more {digit_unit(fmt.base)}"
        )
    return math.exp(found.x)


def needed_precision(
    omega_bw: float,
    f_c: float,
    duration: float,
    base: int = 2,
    rounding: Rounding | str = Rounding.NEAREST,
    share: float = 0.1,
) -> int:
    """Return the fewest digits for which the rounding error is at most `share` of the discretization error."""
    like = FloatFormat(base, 2, rounding_named(rounding))

    def enough(fmt: FloatFormat) -> bool:
        errors = two_errors(1.0, omega_bw, f_c, duration, fmt)
        return errors.rounding <= share * errors.discretization

    most = math.ceil(400 / math.log2(like.base))
    found = smallest_precision(enough, like.base, like.rounding, largest=most, monotone=True)
    if found is None:
        raise ValueError(
            f"got share = {share}, {f_c:g} Hz, {duration:g} s; needed at most {digits_text(most, base)}; "
            "allow a larger share"
        )
    return found.precision


def stall_rate(omega_bw: float, duration: float, fmt: FloatFormat) -> float:
    r"""Return the rate in Hz at which the rms increment is half a spacing of the accumulator at the end.

    At this rate and above, additions are lost, the integral stops changing, and :func:`two_errors` no longer holds.
    """
    spacing = math.sqrt(12 * mean_square_rounding(fmt) * 2 * duration / omega_bw)
    return 2 / spacing
