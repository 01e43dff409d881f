r"""Closed forms for the error of digital integration: its random walk, its first cycles, and exact steps of inputs.

The letters are those of savage2016: :math:`\omega_{bw}` bandwidth of the input in rad/s, T cycle time in s,
:math:`f_c = 1/T` iteration rate in Hz, :math:`\mu = \omega_{bw}T`, :math:`\sigma_x` rms of the input in any unit. A
"factor" is dimensionless: it is divided by the units of the input and of T. Functions apply to arrays of
:math:`\mu` entry by entry.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from fractions import Fraction
from typing import Any, NamedTuple

import numpy as np
import scipy
from numpy.typing import ArrayLike, NDArray

Floats = NDArray[np.float64]

TRAPEZOID = (Fraction(1, 2), Fraction(1, 2))
"""Weights of the new and of the old sample in (2), times T."""


def positive(name: str, values: ArrayLike) -> Floats:
    """Return positive, finite numbers as an array; raise ValueError otherwise."""
    array = np.asarray(values, dtype=np.float64)
    allowed = (array > 0) & np.isfinite(array)
    if not np.all(allowed):
        bad = array[~allowed].ravel()[0]
        raise ValueError(f"got {name} = {bad}; needed a positive, finite number; check its unit and sign")
    return array


# -- the closed form, evaluated stably ------------------------------------------------------------


def langevin(x: ArrayLike) -> Floats:
    r"""Evaluate Langevin's function, :math:`L(x) = \coth x - 1/x`, for x > 0, to a few units in the last place.

    Up to x = 2, the function uses Lambert's continued fraction, whose terms are all positive,

    .. math:: L(x) = \cfrac{x}{3 + \cfrac{x^2}{5 + \cfrac{x^2}{7 + \dots}}}

    truncated where the remainder is below :math:`10^{-18}` of the result. Beyond x = 2 it uses
    :math:`(1 - 1/x) + 2e^{-2x}/(1 - e^{-2x})`.
    """
    x = positive("x", x)
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
    return langevin(positive("mu", mu) / 2)


def random_walk(sigma_x: float, omega_bw: float, f_c: float) -> float:
    r"""Return the random walk of the integration error, :math:`\sigma_x\sqrt{L(\mu/2)/f_c}`; savage2016, (35).

    `sigma_x` is in a unit u, `omega_bw` in rad/s and `f_c` in Hz; the walk is in u s per √s.
    """
    sigma_x, mu = float(positive("sigma_x", sigma_x)), float(positive("omega_bw", omega_bw) / positive("f_c", f_c))
    return sigma_x * math.sqrt(float(walk_factor(mu)) / f_c)


def approximation_ratio(mu: ArrayLike) -> Floats:
    r"""Return (39) divided by (35), :math:`\sqrt{(\mu/6)/L(\mu/2)} = 1 + \mu^2/120 + \dots`; at least 1."""
    mu = positive("mu", mu)
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
    mu = positive("mu", mu)
    step = 1e-4  # in ln μ: an error of about step², and of 1e-16 / step
    up, down = walk_factor(mu * math.exp(step)), walk_factor(mu * math.exp(-step))
    power = np.log(up / down) / (4 * step)
    return np.asarray(power), np.asarray(-0.5 - power)


def required_rate(sigma_x: float, omega_bw: float, limit: float) -> float:
    r"""Return the iteration rate in Hz at which :func:`random_walk` falls to `limit`; units as there."""
    limit = float(positive("limit", limit))
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


def integral_variance(mu: ArrayLike) -> Floats:
    r"""Return the variance of the integral over a cycle that starts from a known sample, over :math:`\sigma_x^2T^2`.

    .. math:: q_{22} = \frac{2\mu - 3 + 4\varphi - \varphi^2}{\mu^2}
        = L(\tfrac\mu2)\frac{\tanh(\mu/2)}{\mu/2} + \frac{(1-\varphi)^3}{\mu^2(1+\varphi)}, \qquad \varphi = e^{-\mu}

    The last form has only positive terms: it is right to a few units in the last place for every :math:`\mu`.
    """
    mu = positive("mu", mu)
    lost = -np.expm1(-mu)  # 1 - φ
    between = walk_factor(mu) * (np.tanh(mu / 2) / (mu / 2))  # in this order nothing underflows
    return np.asarray(between + (lost / mu) ** 2 * (lost / (1 + np.exp(-mu))))


# -- before the steady state ----------------------------------------------------------------------


def error_variance(n: ArrayLike, mu: float) -> Floats:
    r"""Return the error variance of the trapezoidal rule after n cycles, divided by :math:`\sigma_x^2T^2`.

    .. math:: \frac{P_{ee_n}}{\sigma_x^2T^2} = nL - \tfrac12L^2(1-\varphi^n), \qquad
        L = L(\mu/2),\ \varphi = e^{-\mu}
    """
    cycles, rate = np.asarray(n, dtype=np.float64), float(walk_factor(mu))
    return np.asarray(cycles * rate + rate**2 / 2 * np.expm1(-cycles * mu))


def error_variance_recursion(n: int, mu: float) -> Floats:
    r"""Compute :func:`error_variance` after 0 … n cycles by a recursion, for an input in its steady state.

    .. math:: P_{k+1} = P_k + 2gc_k + r, \qquad c_{k+1} = \varphi c_k + g, \qquad
        g = \tfrac12(1-\varphi)L,\ r = L - \tfrac12(1-\varphi)L^2

    with :math:`c_k = E(e_kx_{1k})/(\sigma_x^2T)`. All terms are positive; (18) of savage2016 takes differences of
    :math:`P_{33}`, :math:`P_{22}` and :math:`P_{32}`, each larger than the result by :math:`12/\mu^2`.
    """
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
    rate = float(walk_factor(float(positive("mu", mu))))
    if not 0 < share < math.inf:
        raise ValueError(f"got share = {share}; needed a positive number, such as 0.01 for one percent")
    offset = rate / 2

    def excess(n: float) -> float:
        return float(offset * -math.expm1(-n * mu) / n - share)

    if excess(1.0) <= 0:
        return 1.0
    return float(scipy.optimize.brentq(excess, 1.0, offset / share * (1 + 1e-9) + 1))


def savage_recursion(n: int, mu: float, p32_weight: float = 0.5, p22_slip: bool = False) -> Floats:
    r"""Return the error variance (13) after 0 … n cycles, in units of σ_x and T, by the recursion (18) of savage2016.

    It uses (25), (27) and (28) and starts at zero. `p32_weight` is the weight of :math:`\varphi_{21}P_{11}T` in the
    second line of (18): 1/2; the note prints 1. With `p22_slip`, the second :math:`1/\omega_{bw}` in (25) is omitted,
    as printed; T is then 1 second.
    """
    phi, lost = math.exp(-mu), -math.expm1(-mu)
    phi21 = lost / mu
    p31 = p32 = p33 = p22 = p12 = 0.0
    error = np.zeros(n + 1)
    for k in range(n):
        before, p12 = p12, -math.expm1(-(k + 1) * mu) / mu
        p32 += phi21 * p31 + (p12 + before) / 2 + p32_weight * phi21
        p33 += (1 + phi) * p31 + 0.25 + (0.25 + phi / 2)
        p22 += 2 / mu * (1 - lost * math.exp(-k * mu) * (1 if p22_slip else 1 / mu))
        p31 = phi * p31 + (1 + phi) / 2
        error[k + 1] = p33 + p22 - 2 * p32
    return error


# -- other inputs ---------------------------------------------------------------------------------


@dataclass(frozen=True)
class Process:
    r"""A stationary Gaussian input with mean zero, :math:`R(\tau) = \sigma_x^2\,\mathrm{Re}\sum_j c_je^{-p_j|\tau|}`.

    :func:`first_order` and :func:`resonant` create processes. `drift` is the matrix F of :math:`\dot z = Fz + w`, whose
    steady state has the covariance :math:`\sigma_x^2 I`; the input is the first entry of z.
    """

    sigma: float
    poles: tuple[complex, ...]
    weights: tuple[complex, ...]
    drift: tuple[tuple[float, ...], ...]

    def psd(self, omega: ArrayLike) -> Floats:
        """Return the two-sided spectral density at `omega` in rad/s; integrated over frequency in Hz, it gives σ²."""
        s = np.asarray(omega, dtype=np.float64)
        total: Any = sum(2 * c * p / (p * p + s * s) for c, p in zip(self.weights, self.poles, strict=True))
        return np.asarray(self.sigma**2 * np.real(total))


def first_order(sigma_x: float, omega_bw: float) -> Process:
    r"""Return the input of savage2016, (1): :math:`R = \sigma_x^2e^{-\omega_{bw}|\tau|}`; `omega_bw` in rad/s."""
    return Process(sigma_x, (complex(omega_bw),), (1 + 0j,), ((-float(positive("omega_bw", omega_bw)),),))


def resonant(sigma_x: float, omega_0: float, zeta: float) -> Process:
    r"""Return a resonant input: white noise through :math:`\ddot x + 2\zeta\omega_0\dot x + \omega_0^2x`, ζ < 1."""
    if not 0 < zeta < 1:
        raise ValueError(f"got zeta = {zeta}; needed a number between 0 and 1, so that the input resonates")
    damped = math.sqrt(1 - zeta * zeta)
    drift = ((0.0, omega_0), (-omega_0, -2 * zeta * omega_0))
    return Process(sigma_x, (omega_0 * complex(zeta, -damped),), (complex(1, -zeta / damped),), drift)


class Cycle(NamedTuple):
    r"""One cycle of a process and of the error of the trapezoidal rule: :math:`(z_n, d_n) = A z_{n-1} + Bw`.

    w holds m + 1 independent standard normal numbers. A is (m + 1, m), and B is (m + 1, m + 1) and lower triangular.
    d has the unit of x times seconds.
    """

    a: NDArray[np.float64]
    b: NDArray[np.float64]


def exact_step(process: Process, f_c: float) -> Cycle:
    r"""Discretize a process together with the error of the trapezoidal rule, exact at the sampling times.

    First-order inputs have a closed form, in which nothing cancels: :math:`d_n = \tfrac12Th(x_{n-1}+x_n) + b` with
    :math:`h = L\tanh(\mu/2)`, where b has the variance :math:`2h/\mu` over :math:`\sigma_x^2T^2`. For others, one
    exponential of a block matrix gives transition and covariance of z and of the integral (Van Loan, 1978).
    """
    period, sigma, m = 1 / f_c, process.sigma, len(process.drift)
    if m == 1:
        mu = -process.drift[0][0] * period
        h = float(walk_factor(mu)) * math.tanh(mu / 2)
        phi, root = math.exp(-mu), math.sqrt(-math.expm1(-2 * mu)) * sigma
        a = np.array([[phi], [h / 2 * period * (1 + phi)]])
        return Cycle(a, np.array([[root, 0.0], [h / 2 * period * root, sigma * period * math.sqrt(2 * h / mu)]]))
    drift, augmented, noise = np.array(process.drift), np.zeros((m + 1, m + 1)), np.zeros((m + 1, m + 1))
    augmented[:m, :m], augmented[m, 0], noise[:m, :m] = drift, 1, -(drift + drift.T)
    power = scipy.linalg.expm(period * np.block([[-augmented, noise], [0 * noise, augmented.T]]))
    transition = power[m + 1 :, m + 1 :].T
    change = np.eye(m + 1)
    change[m, 0], change[m, m] = period / 2, -1  # d = (x_n + x_{n-1}) T/2 - integral
    a = change @ transition[:, :m]
    a[m, 0] += period / 2
    return Cycle(a, sigma * np.linalg.cholesky(change @ transition @ power[: m + 1, m + 1 :] @ change.T))


def walk_rate(process: Process, f_c: float) -> float:
    r"""Return the random walk of the trapezoidal rule for any input: growth of the error variance per second.

    It is the part of the input's spectrum S that sampling folds down to frequency zero, by Poisson's formula
    :math:`\dot P_{ee} = \sum_{k\ne0} S(2\pi kf_c) = T\sum_nR(nT) - S(0)`.
    """
    z = np.array(process.poles) / f_c
    return float(np.sum(np.real(process.weights * (1 / np.tanh(z / 2) - 2 / z)))) / f_c * process.sigma**2


def trapezoid_variance(process: Process, f_c: float, n: int) -> Floats:
    """Return the error variance of the trapezoidal rule after 0 … n cycles, by recursion, from the steady state."""
    step, m = exact_step(process, f_c), len(process.drift)
    move, state, variance = np.eye(m + 1), np.zeros((m + 1, m + 1)), np.zeros(n + 1)
    move[:, :m] = step.a
    state[:m, :m] = process.sigma**2 * np.eye(m)
    for k in range(n):
        state = move @ state @ move.T + step.b @ step.b.T
        variance[k + 1] = state[-1, -1]
    return variance
