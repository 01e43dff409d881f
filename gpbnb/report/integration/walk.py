r"""The random walk of the integration error in closed form, and the error in the first cycles.

The letters are those of savage2016: :math:`\omega_{bw}` bandwidth of the input in rad/s, T cycle time in s,
:math:`f_c = 1/T` iteration rate in Hz, :math:`\mu = \omega_{bw}T`, :math:`\sigma_x` rms of the input in any unit. A
"factor" is dimensionless: it is divided by the units of the input and of T. Functions apply to arrays of
:math:`\mu` entry by entry.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
import scipy
from numpy.typing import ArrayLike, NDArray

from gpbnb.report.integration.arguments import Floats, bandwidth_ratio, cycle_counts, positive_array, positive_number

# -- the closed form, evaluated stably ------------------------------------------------------------


def langevin(x: ArrayLike) -> Floats:
    r"""Evaluate Langevin's function, :math:`L(x) = \coth x - 1/x`, for x > 0, to a few units in the last place.

    Up to x = 2, the function uses Lambert's continued fraction, whose terms are all positive,

    .. math:: L(x) = \cfrac{x}{3 + \cfrac{x^2}{5 + \cfrac{x^2}{7 + \dots}}}

    truncated where the remainder is below :math:`10^{-18}` of the result. Beyond x = 2 it uses
    :math:`(1 - 1/x) + 2e^{-2x}/(1 - e^{-2x})`.
    """
    x = positive_array("x", x)
    low = np.minimum(x, 2.0)
    square, tail = low * low, np.zeros_like(low)
    for k in range(14, 1, -1):
        tail = square / (2 * k + 1 + tail)
    high = np.maximum(x, 2.0)
    far = (1 - 1 / high) - 2 * np.exp(-2 * high) / np.expm1(-2 * high)
    return np.where(x <= 2.0, low / (3 + tail), far)


def walk_factor(mu: ArrayLike) -> Floats:
    r"""Return the growth of the error variance in one cycle, :math:`\dot P_{ee}/(\sigma_x^2 T)`; savage2016, (35).

    .. math:: \frac{1+e^{-\mu}}{1-e^{-\mu}} - \frac2\mu = L(\mu/2)
    """
    return langevin(positive_array("mu", mu) / 2)


def random_walk(sigma_x: float, omega_bw: float, f_c: float) -> float:
    r"""Return the random walk of the integration error, :math:`\sigma_x\sqrt{L(\mu/2)/f_c}`; savage2016, (35).

    `sigma_x` is in a unit u, `omega_bw` in rad/s and `f_c` in Hz; the walk is in u s per √s.
    """
    return positive_number("sigma_x", sigma_x) * math.sqrt(float(walk_factor(bandwidth_ratio(omega_bw, f_c))) / f_c)


def approximation_ratio(mu: ArrayLike) -> Floats:
    r"""Return (39) divided by (35), :math:`\sqrt{(\mu/6)/L(\mu/2)} = 1 + \mu^2/120 + \dots`; at least 1."""
    mu = positive_array("mu", mu)
    return np.sqrt(mu / 6 / walk_factor(mu))


def validity(excess: float) -> float:
    r"""Return the largest :math:`\mu` for which (39) is too large by at most `excess`, such as 0.01 for one percent."""
    if not 1e-9 <= excess <= 1e3:
        raise ValueError(f"got excess = {excess}; needed 1e-9 to 1e3, such as 0.01 for one percent")

    def surplus(mu: float) -> float:
        return float(approximation_ratio(mu)) - 1 - excess

    return float(scipy.optimize.brentq(surplus, 1e-5, 1e8, xtol=1e-12, rtol=1e-12))


def exponents(mu: ArrayLike) -> tuple[Floats, Floats]:
    r"""Return the local powers of bandwidth and iteration rate in (35); the abstract of savage2016 claims 1/2 and -1.

    .. math:: \frac{\partial\ln\sigma}{\partial\ln\omega_{bw}} = \frac{x L'(x)}{2L(x)}, \qquad
        \frac{\partial\ln\sigma}{\partial\ln f_c} = -\frac12 - \frac{x L'(x)}{2L(x)}, \qquad x = \mu/2

    The derivatives are computed as differences of logarithms.
    """
    mu = positive_array("mu", mu)
    step = 1e-4  # in ln μ: an error of about step², and of 1e-16 / step
    up, down = walk_factor(mu * math.exp(step)), walk_factor(mu * math.exp(-step))
    power = np.log(up / down) / (4 * step)
    return np.asarray(power), np.asarray(-0.5 - power)


def required_rate(sigma_x: float, omega_bw: float, limit: float) -> float:
    r"""Return the iteration rate in Hz at which :func:`random_walk` falls to `limit`; units as there."""
    sigma_x, omega_bw, limit = (
        positive_number(name, value) for name, value in (("sigma_x", sigma_x), ("omega_bw", omega_bw), ("limit", limit))
    )
    # L ≤ min(μ/6, 1), so either law alone gives a rate that is high enough.
    high = max(sigma_x * math.sqrt(omega_bw / 6) / limit, 1e-300)
    high = min(high, (sigma_x / limit) ** 2) * 2
    low = high
    while random_walk(sigma_x, omega_bw, low) <= limit:
        low /= 4
    root = scipy.optimize.brentq(
        lambda log: math.log(random_walk(sigma_x, omega_bw, math.exp(log)) / limit), *np.log([low, high])
    )
    return math.exp(root)


# -- exact discretization -------------------------------------------------------------------------


class Discretization(NamedTuple):
    r"""Coefficients of one cycle of (10) in units of :math:`\sigma_x` and T, exact at the sampling times.

    `bridge` is the variance of the integral over a cycle if the input at both ends is known,
    :math:`L(\mu/2)\tanh(\mu/2)/(\mu/2)`.
    """

    phi11: NDArray[np.float64]
    phi21: NDArray[np.float64]
    q11: NDArray[np.float64]
    q12: NDArray[np.float64]
    q22: NDArray[np.float64]
    bridge: NDArray[np.float64]


def discretize(mu: ArrayLike) -> Discretization:
    r"""Discretize (1) over one cycle, each entry to a few units in the last place for every :math:`\mu`.

    .. math:: q_{11} = 1-\varphi^2, \quad q_{12} = \frac{(1-\varphi)^2}{\mu}, \quad
        q_{22} = \frac{2\mu - 3 + 4\varphi - \varphi^2}{\mu^2}
        = L(\tfrac\mu2)\frac{\tanh(\mu/2)}{\mu/2} + \frac{q_{12}^2}{q_{11}}, \qquad \varphi = e^{-\mu}

    The last form has only positive terms.
    """
    mu = positive_array("mu", mu)
    phi = np.exp(-mu)
    lost = -np.expm1(-mu)  # 1 - φ
    phi21 = lost / mu
    bridge = walk_factor(mu) * (np.tanh(mu / 2) / (mu / 2))  # in this order nothing underflows
    return Discretization(
        phi, phi21, -np.expm1(-2 * mu), phi21 * lost, bridge + phi21 * phi21 * (lost / (1 + phi)), bridge
    )


# -- before the steady state ----------------------------------------------------------------------


def error_variance(n: ArrayLike, mu: float, start: float = 1.0) -> Floats:
    r"""Return the error variance of the trapezoidal rule after n cycles, divided by :math:`\sigma_x^2T^2`.

    .. math:: \frac{P_{ee_n}}{\sigma_x^2T^2} = nL - \tfrac12L^2(1-\varphi^n)
        - (1-s)\,\tfrac14L^2(1-\varphi^n)^2, \qquad L = L(\mu/2),\ \varphi = e^{-\mu}

    `start`, s, is the variance of the input at the start, divided by :math:`\sigma_x^2`; savage2016 assumes 1.
    """
    cycles, mu = cycle_counts(n), float(positive_array("mu", mu))
    if not 0 <= start < math.inf:
        raise ValueError(f"got start = {start}; needed a variance ratio of at least 0")
    rate = float(walk_factor(mu))
    gone = -np.expm1(-cycles * mu)
    return np.asarray(cycles * rate - rate**2 / 2 * gone - (1 - start) * (rate * gone) ** 2 / 4)


def error_variance_recursion(n: int, mu: float) -> Floats:
    r"""Compute :func:`error_variance` after 0 … n cycles by a recursion, for an input in its steady state.

    .. math:: P_{k+1} = P_k + 2gc_k + r, \qquad c_{k+1} = \varphi c_k + g, \qquad
        g = \tfrac12(1-\varphi)L,\ r = L - \tfrac12(1-\varphi)L^2

    with :math:`c_k = E(e_kx_{1k})/(\sigma_x^2T)`. All terms are positive; (18) of savage2016 takes differences of
    :math:`P_{33}`, :math:`P_{22}` and :math:`P_{32}`, each larger than the result by :math:`12/\mu^2`.
    """
    n, mu = int(cycle_counts(n)), float(positive_array("mu", mu))
    rate, lost, phi = float(walk_factor(mu)), -math.expm1(-mu), math.exp(-mu)
    g, r = lost * rate / 2, rate - lost * rate**2 / 2
    variance, c = np.zeros(n + 1), 0.0
    for k in range(n):
        variance[k + 1] = variance[k] + 2 * g * c + r
        c = phi * c + g
    return variance


def settling_cycles(mu: float, share: float) -> float:
    r"""Return the number of cycles after which the error variance equals the random walk up to a relative `share`.

    It is the n at which :math:`L(1-\varphi^n)/2n` falls to `share`.
    """
    rate = float(walk_factor(float(positive_array("mu", mu))))
    if not 0 < share < math.inf:
        raise ValueError(f"got share = {share}; needed a positive number, such as 0.01 for one percent")
    offset = rate / 2

    def excess(n: float) -> float:
        return float(offset * -math.expm1(-n * mu) / n - share)

    if excess(1.0) <= 0:
        return 1.0
    return float(scipy.optimize.brentq(excess, 1.0, offset / share * (1 + 1e-9) + 1))


class SavageRecursion(NamedTuple):
    """Covariances of (13) cycle by cycle, (n + 1,) each, in units of σ_x and T."""

    p31: NDArray[np.float64]
    p32: NDArray[np.float64]
    p33: NDArray[np.float64]
    p22: NDArray[np.float64]

    @property
    def pee(self) -> Floats:
        """Error variance by (13)."""
        return np.asarray(self.p33 + self.p22 - 2 * self.p32)


def savage_recursion(n: int, mu: float, p32_weight: float = 0.5, p22_slip: bool = False) -> SavageRecursion:
    r"""Run the recursion (18) of savage2016 with (25), (27) and (28), from zero initial conditions.

    `p32_weight` is the weight of :math:`\varphi_{21}P_{11}T` in the second line of (18): 1/2; the note prints 1.
    With `p22_slip`, the second :math:`1/\omega_{bw}` in (25) is omitted, as printed; T is then 1 second.
    """
    n, mu = int(cycle_counts(n)), float(positive_array("mu", mu))
    phi, lost = math.exp(-mu), -math.expm1(-mu)
    phi21 = lost / mu
    p31, p32, p33, p22, p12 = np.zeros((5, n + 1))
    for k in range(n):
        p12[k + 1] = -math.expm1(-(k + 1) * mu) / mu
        p31[k + 1] = phi * p31[k] + (1 + phi) / 2
        p32[k + 1] = p32[k] + phi21 * p31[k] + (p12[k + 1] + p12[k]) / 2 + p32_weight * phi21
        p33[k + 1] = p33[k] + (1 + phi) * p31[k] + 0.25 + (0.25 + phi / 2)
        p22[k + 1] = p22[k] + 2 / mu * (1 - lost * math.exp(-k * mu) * (1 if p22_slip else 1 / mu))
    return SavageRecursion(p31, p32, p33, p22)
