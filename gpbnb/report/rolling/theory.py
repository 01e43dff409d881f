r"""Theory: closed forms for rolling, 1/f noise, filters, an uneven roll rate and rounded rotations.

Times are in seconds, roll angles in radians, gyro angles in milliarcseconds (mas), and drift rates in mas a year.
The 1/f noise has the one-sided power spectral density `level` / f, in mas²/Hz; `level` is in mas². A pair
(x, y) is also written as the complex number :math:`z = x + iy`: the roll (5) of hung1984, ch. III, is then a product
with :math:`e^{-i\omega_r t}`, and the deroll (7) a product with :math:`e^{+i\omega_r t}`.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from fractions import Fraction
from functools import cache, lru_cache
from typing import Any

import mpmath
import numpy as np
import scipy
from numpy.typing import NDArray

from gpbnb.arithmetic.bounds import gamma
from gpbnb.arithmetic.formats import FloatFormat
from gpbnb.report.measurement import YEAR

DRIFTS = (6600.0, 40.0)
"""Geodetic drift and frame dragging, in mas a year, rounded; Everitt et al. 2011."""

PERIOD, PERIOD_FLOWN = 600.0, 77.5
"""Roll periods in seconds, from hung1984, ch. III, section 4, and as flown."""

INTERVAL = 10.0
"""Time between two samples, in seconds."""

LEVEL = 200.0**2 / PERIOD_FLOWN
"""Example of a noise level in mas². It gives 200 mas/√Hz at the roll frequency flown. No document states a level."""


# -- roll and deroll -----------------------------------------------------------------------------


def rotation(phase: float) -> NDArray[np.float64]:
    """The roll matrix (2, 2) of hung1984, ch. III, (5), at the roll angle `phase`; that of (7) is its transpose."""
    c, s = math.cos(phase), math.sin(phase)
    return np.array([[c, s], [-s, c]])


def phase_error_cost(drift: tuple[float, float], phase: float) -> NDArray[np.float64]:
    r"""Errors of both drifts if the deroll is ahead of the roll by a constant angle.

    .. math:: z\,(e^{i\theta} - 1), \qquad
        \begin{bmatrix} k_x(\cos\theta-1) - k_y\sin\theta \\ k_x\sin\theta + k_y(\cos\theta-1) \end{bmatrix}
    """
    z = complex(*drift)
    error = z * complex(-2 * math.sin(phase / 2) ** 2, math.sin(phase))
    return np.array([error.real, error.imag])


def largest_phase(drift: tuple[float, float], error: float) -> float:
    """Constant phase error, in rad, that changes the drift vector by `error`; both in the same unit."""
    size = math.hypot(*drift)
    if not 0 < error <= 2 * size:
        raise ValueError(f"got an error of {error} for a drift of {size:g}; needed 0 < error <= {2 * size:g}")
    return 2 * math.asin(error / (2 * size))


def fitted_drift(
    drift: tuple[float, float], phase: Callable[[Any], Any], duration: float = YEAR
) -> NDArray[np.float64]:
    r"""Drifts that a least-squares fit finds in a ramp derolled with a varying phase error.

    .. math:: \frac{12}{T^3}\int_0^T \Bigl(t-\frac T2\Bigr)\, z t\, e^{i\psi(t)}\, dt

    The integral is evaluated by 400-point Gauss-Legendre quadrature, for phase errors below some hundred radians.
    """
    nodes, weights = _legendre(400)
    x = (nodes + 1) / 2
    value = complex(*drift) * np.sum(weights * 6 * (x - 0.5) * x * np.exp(1j * np.asarray(phase(duration * x))))
    return np.array([value.real, value.imag])


_legendre = cache(np.polynomial.legendre.leggauss)


def roll_rate(period: float) -> Fraction:
    """ω_r = 2π/T in rad/s, to 60 digits, from the exact binary value of the period."""
    if not (period > 0 and math.isfinite(period)):
        raise ValueError(f"got a roll period of {period} s; needed a positive number; omit rolling if there is no roll")
    with mpmath.workdps(80):
        digits = mpmath.nstr(2 * mpmath.pi, 60)
    return Fraction(digits) / Fraction(period)


def worst_rate_error(period: float, fmt: FloatFormat) -> Fraction:
    """Bound on the error of ω_r in a register, rad/s: half a unit in the last place, or one unit if chopped."""
    _, _, e = fmt.split(roll_rate(period))
    return Fraction(fmt.base) ** (e - 1) * fmt.unit_roundoff


def off_tuned_loss(rate_error: float, duration: float = YEAR) -> float:
    """Share of a constant signal that is lost at the end, 1 - cos Δω T; hung1984, ch. III, (11)."""
    return 2 * math.sin(rate_error * duration / 2) ** 2


def off_tuned_drift(drift: float, rate_error: float, duration: float = YEAR) -> float:
    r"""False drift across a drift k from a constant frequency error in two dimensions, about :math:`k\,\Delta\omega T`.

    The result has the unit of `drift`; `rate_error` is in rad/s.
    """
    return float(fitted_drift((drift, 0.0), lambda t: rate_error * t, duration)[1])


# -- spectra -------------------------------------------------------------------------------------


def ramp_density(drift: float, duration: float, frequency: Any) -> NDArray[np.float64]:
    r"""One-sided density of a record of the ramp k t, from 0 to T, in mas²/Hz.

    .. math:: \frac2T \Bigl|\int_0^T k t\, e^{-i\omega t} dt\Bigr|^2
        = \frac{k^2T^3}{2}\,\bigl[j_0(z)^2 + j_1(z)^2\bigr], \qquad z = \frac{\omega T}{2}

    j are spherical Bessel functions. The density falls as :math:`2k^2T/\omega^2`, not as :math:`\omega^{-4}`,
    because the record ends with a jump.
    """
    z = np.abs(np.pi * np.asarray(frequency, dtype=np.float64) * duration)
    size = scipy.special.spherical_jn(0, z) ** 2 + scipy.special.spherical_jn(1, z) ** 2
    return np.asarray((drift / YEAR) ** 2 * duration**3 / 2 * size)


def flicker_density(level: float, frequency: Any, interval: float | None = None) -> NDArray[np.float64]:
    r"""One-sided density of the noise, level/f; with `interval`, the density of its samples as generated.

    .. math:: \frac{A}{f}, \qquad \frac{\pi A\,\Delta t}{|\sin \pi f \Delta t|}

    The second formula is the density of white noise with variance πA after a fractional difference of order one half.
    """
    f = np.abs(np.asarray(frequency, dtype=np.float64))
    if interval is None:
        return np.asarray(level / f)
    return np.asarray(np.pi * level * interval / np.abs(np.sin(np.pi * f * interval)))


FLOWN_DENSITY = float(flicker_density(LEVEL, 1 / PERIOD_FLOWN, INTERVAL))
"""Density of the sampled noise of the example at the roll frequency that was flown, mas²/Hz."""


# -- sums of noise samples, exactly --------------------------------------------------------------


def impulse_response(samples: int) -> NDArray[np.float64]:
    r"""Response of the fractional difference of order one half, :math:`h_k = \binom{2k}{k}/4^k`; Kasdin 1995."""
    k = np.arange(1, samples, dtype=np.float64)
    return np.concatenate([[1.0], np.cumprod((k - 0.5) / k)])[:samples]


@lru_cache(maxsize=1)
def _response_transform(samples: int, size: int) -> NDArray[np.complex128]:
    return np.asarray(scipy.fft.rfft(impulse_response(samples), size))


def variance_of_sum(weights: Any, level: float) -> float:
    r"""Variance of a weighted sum :math:`\sum a_m x_m` of all samples of the noise, which starts at rest; exact.

    .. math:: \pi A \sum_i \Bigl(\sum_{m\ge i} a_m h_{m-i}\Bigr)^2

    Every linear use of the noise is such a sum, for example a fitted drift or the output of a filter.
    """
    a = np.asarray(weights, dtype=np.float64)
    size = scipy.fft.next_fast_len(2 * len(a), real=True)
    on_white = scipy.fft.irfft(scipy.fft.rfft(a, size) * np.conj(_response_transform(len(a), size)), size)[: len(a)]
    return float(np.pi * level * np.sum(on_white**2))


def slope_weights(samples: int, interval: float = INTERVAL) -> NDArray[np.float64]:
    """Weights (n,) that give the slope, per second, of a straight line fitted by least squares."""
    t = (np.arange(samples) - (samples - 1) / 2) * interval
    return np.asarray(t / np.sum(t**2))


def drift_error_unrolled(level: float, duration: float = YEAR, at_rest: bool = False) -> float:
    r"""Standard error of a drift without rolling, for continuous 1/f noise: :math:`3\sqrt A/T`; mas a year.

    .. math:: \sigma^2 = \int_0^\infty \frac Af\, \frac{36}{T^2}\, j_1(\pi f T)^2\, df
        = \frac{36A}{T^2}\cdot\frac14

    It is :math:`\sqrt{8A}/T` for noise `at_rest`, which begins with the record.
    """
    return math.sqrt((8 if at_rest else 9) * level) / duration * YEAR


def drift_error_rolled(level: float, period: float, duration: float = YEAR, interval: float | None = None) -> float:
    r"""Standard error of a drift with many turns, as for white noise: :math:`\sqrt{6 S(f_r)/T^3}`; mas a year."""
    return math.sqrt(6 * float(flicker_density(level, 1 / period, interval)) / duration**3) * YEAR


def roll_phase(index: Any, period: float, interval: float = INTERVAL) -> NDArray[np.float64]:
    """Roll angle, in [0, 2π), at samples counted from 0; `period` and `interval` in s."""
    return np.asarray(2 * np.pi * np.mod(np.asarray(index) * (interval / period), 1.0))


# -- low-pass filters ----------------------------------------------------------------------------


def moving_average(length: float, interval: float = INTERVAL) -> NDArray[np.float64]:
    """Weights of the mean of the last samples, newest first; `length` in s."""
    n = round(length / interval)
    return np.full(n, 1 / n)


def single_pole(time_constant: float, interval: float = INTERVAL) -> NDArray[np.float64]:
    """Weights of exponential smoothing, newest first, down to 1e-16; `time_constant` in s."""
    keep = math.exp(-interval / time_constant)
    return np.asarray((1 - keep) * keep ** np.arange(math.ceil(37 * time_constant / interval) + 1))


def filtered_variance(weights: Any, level: float, samples: int, period: float | None) -> float:
    """Exact variance, in mas², of the derolled and filtered noise in one component at the last sample."""
    a = np.zeros(samples)
    kept = min(samples, len(weights))
    a[samples - kept :] = np.asarray(weights)[:kept][::-1]
    if period is None:
        return variance_of_sum(a, level)
    phase = roll_phase(np.arange(samples), period)
    return sum(variance_of_sum(a * part(phase), level) for part in (np.cos, np.sin))


def filtered_error(drift: float, density: float, bandwidth: Any) -> NDArray[np.float64]:
    r"""Mean square error of a ramp after a low-pass filter, in mas²: lag and noise.

    .. math:: \frac{k^2}{16B^2} + N_0 B

    The formula holds for two filters of noise bandwidth B: a single pole, whose time constant and lag are 1/(4B), and
    a moving average of length 1/(2B), whose lag is half its length.
    """
    b = np.asarray(bandwidth, dtype=np.float64)
    return np.asarray((drift / YEAR) ** 2 / (16 * b**2) + density * b)


def best_bandwidth(drift: float, density: float) -> float:
    r"""Noise bandwidth with the least error, :math:`B = \sqrt[3]{k^2/(8N_0)}`, in Hz.

    The error is then :math:`\tfrac34 (k N_0)^{2/3}`, two thirds of it noise.
    """
    return float(np.cbrt((drift / YEAR) ** 2 / (8 * density)))


def signal_to_noise(drift: float, duration: float, error: Any) -> NDArray[np.float64]:
    r"""Mean square :math:`k^2T^2/3` of a ramp from 0 to T over a mean square error."""
    return np.asarray((drift / YEAR * duration) ** 2 / 3 / np.asarray(error))


# -- an uneven roll rate -------------------------------------------------------------------------


def rate_walk_error(drift: float, intensity: float, duration: float = YEAR, reset: float | None = None) -> float:
    r"""Standard deviation of the cross drift due to a drift k, if the roll rate is a random walk; mas a year.

    .. math:: k\sqrt{\tfrac{383}{1260}\, q T^3} \text{ without resets}, \qquad
        k \frac P2 \sqrt{\tfrac{38}{35}\, q T} \text{ with the phase reset every } P \ll T

    The variance of the rate grows by `intensity`, q in rad²/s³, per second.
    """
    if reset is None:
        return drift * math.sqrt(383 / 1260 * intensity * duration**3)
    return drift * reset / 2 * math.sqrt(38 / 35 * intensity * duration)


# -- rotations in t digits -----------------------------------------------------------------------


def recursion_bound(steps: int, beta: Fraction) -> float:
    r"""Strict bound on the error of n rounded rotations by one rounded angle.

    .. math:: |\hat z_n - e^{in\delta}| \le \bigl[(1+\beta)(1+\sqrt2\,\gamma_2)\bigr]^n - 1
        \approx (1 + 2\sqrt2)\, n\beta

    Cosine and sine of the angle are rounded once; a product of complex numbers has a relative error of at most
    :math:`\sqrt2\gamma_2`.
    """
    growth = steps * (math.log1p(float(beta)) + math.log1p(math.sqrt(2) * float(gamma(2, beta))))
    return math.expm1(growth) if growth < 700 else math.inf
