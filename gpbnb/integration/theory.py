r"""What may happen: the error of digital integration, in closed form.

The letters are those of savage2016: :math:`\omega_{bw}` bandwidth of the input in rad/s, T cycle time in s,
:math:`f_c = 1/T` iteration rate in Hz, :math:`\mu = \omega_{bw}T`, :math:`\sigma_x` rms of the input in any unit. What
is called a factor has the units of the input and of T divided out. Arrays of :math:`\mu` are taken entry by entry.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction
from functools import lru_cache
from typing import Any, NamedTuple

import mpmath
import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.optimize import brentq, minimize_scalar
from scipy.special import erf

from gpbnb.arithmetic.formats import FloatFormat, Rounding
from gpbnb.arithmetic.search import smallest_precision

Floats = NDArray[np.float64]

# -- the closed form, evaluated stably ------------------------------------------------------------


def langevin(x: ArrayLike) -> Floats:
    r"""Langevin's function, :math:`L(x) = \coth x - 1/x`, for x > 0; to a few units in the last place.

    Up to x = 2 from Lambert's continued fraction, whose terms are all positive,

    .. math:: L(x) = \cfrac{x}{3 + \cfrac{x^2}{5 + \cfrac{x^2}{7 + \dots}}}

    cut where the rest is below :math:`10^{-18}` of the whole; beyond as
    :math:`(1 - 1/x) + 2e^{-2x}/(1 - e^{-2x})`.

    Parameters
    ----------
    x : positive, finite.

    Returns
    -------
    value : of the shape of `x`, between 0 and 1.

    Raises
    ------
    ValueError : an entry is not positive or not finite.
    """
    x = _positive("x", x)
    low = np.minimum(x, 2.0)
    square, tail = low * low, np.zeros_like(low)
    for k in range(14, 1, -1):
        tail = square / (2 * k + 1 + tail)
    high = np.maximum(x, 2.0)
    far = (1 - 1 / high) - 2 * np.exp(-2 * high) / np.expm1(-2 * high)
    return np.asarray(np.where(x <= 2.0, low / (3 + tail), far))


def walk_factor(mu: ArrayLike) -> Floats:
    r"""Growth of the error variance in one cycle, :math:`\dot P_{ee}/(\sigma_x^2 T)`; savage2016, (35).

    .. math:: \frac{1+e^{-\mu}}{1-e^{-\mu}} - \frac2\mu = L(\mu/2)
    """
    return langevin(_positive("mu", mu) / 2)


def printed_walk_factor(mu: ArrayLike) -> Floats:
    """The same, evaluated in float64 just as (35) is printed; infinite where that divides by zero."""
    mu = _positive("mu", mu)
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        return np.asarray((1 + np.exp(-mu)) / (1 - np.exp(-mu)) - 2 / mu)


def series(terms: int) -> tuple[Fraction, ...]:
    r"""Coefficients of :math:`\mu, \mu^3, \mu^5, \dots` in :func:`walk_factor`, :math:`2B_{2k}/(2k)!`; exact.

    The series converges for :math:`\mu < 2\pi`. Its first coefficient, 1/6, is (37) of savage2016.
    """
    if terms < 1:
        raise ValueError(f"got terms = {terms}; needed at least 1")
    result = []
    for k in range(1, terms + 1):
        p, q = mpmath.bernfrac(2 * k)
        result.append(Fraction(2 * int(p), int(q) * math.factorial(2 * k)))
    return tuple(result)


def random_walk(sigma_x: float, omega_bw: float, f_c: float) -> float:
    r"""Random walk of the integration error, :math:`\sigma_{e_{rw}} = \sigma_x\sqrt{L(\mu/2)/f_c}`.

    Parameters
    ----------
    sigma_x : rms of the input, in a unit u.
    omega_bw : its bandwidth, rad/s.
    f_c : iteration rate, Hz.

    Returns
    -------
    sigma_e_rw : in u s per √s.

    Raises
    ------
    ValueError : an argument is not positive and finite, or their ratio leaves the range of float64.

    References
    ----------
    savage2016, (35).
    """
    return _scalar("sigma_x", sigma_x) * math.sqrt(float(walk_factor(_mu(omega_bw, f_c))) / f_c)


def printed_random_walk(sigma_x: float, omega_bw: float, f_c: float) -> float:
    r"""Approximation for small :math:`\mu`, :math:`\sigma_x\sqrt{\omega_{bw}/6}/f_c`; savage2016, (39)."""
    _mu(omega_bw, f_c)
    return math.sqrt(omega_bw / 6) / f_c * _scalar("sigma_x", sigma_x)


def approximation_ratio(mu: ArrayLike) -> Floats:
    r"""(39) over (35), :math:`\sqrt{(\mu/6)/L(\mu/2)} = 1 + \mu^2/120 + \dots`; at least 1."""
    mu = _positive("mu", mu)
    return np.sqrt(mu / 6 / walk_factor(mu))


def validity(excess: float) -> float:
    r"""Largest :math:`\mu` for which (39) is too large by no more than `excess`, as 0.01 for one percent.

    Raises
    ------
    ValueError : `excess` outside [1e-9, 1e3].
    """
    if not 1e-9 <= excess <= 1e3:
        raise ValueError(f"got excess = {excess}; needed 1e-9 to 1e3, as 0.01 for one percent")
    return float(brentq(lambda mu: float(approximation_ratio(mu)) - 1 - excess, 1e-5, 1e8, xtol=1e-12, rtol=1e-12))


def exponents(mu: ArrayLike) -> tuple[Floats, Floats]:
    r"""Local powers of bandwidth and of iteration rate in (35), as the abstract of savage2016 has 1/2 and -1.

    .. math:: \frac{\partial\ln\sigma}{\partial\ln\omega_{bw}} = \frac{x L'(x)}{2L(x)}, \qquad
        \frac{\partial\ln\sigma}{\partial\ln f_c} = -\frac12 - \frac{x L'(x)}{2L(x)}, \qquad x = \mu/2

    by differences of logarithms.
    """
    mu = _positive("mu", mu)
    step = 1e-4  # in ln μ: an error of about step², and of 1e-16 / step
    up, down = walk_factor(mu * math.exp(step)), walk_factor(mu * math.exp(-step))
    power = np.log(up / down) / (4 * step)
    return np.asarray(power), np.asarray(-0.5 - power)


def required_rate(sigma_x: float, omega_bw: float, limit: float) -> float:
    r"""Iteration rate in Hz at which :func:`random_walk` falls to `limit`.

    Parameters
    ----------
    sigma_x : in a unit u; `omega_bw` in rad/s.
    limit : in u s per √s.

    Raises
    ------
    ValueError : an argument is not positive and finite.
    """
    sigma_x, omega_bw, limit = (
        _scalar(name, value) for name, value in (("sigma_x", sigma_x), ("omega_bw", omega_bw), ("limit", limit))
    )
    # L ≤ min(μ/6, 1), so that either law alone gives a rate that is high enough.
    high = max(sigma_x * math.sqrt(omega_bw / 6) / limit, 1e-300)
    high = min(high, (sigma_x / limit) ** 2) * 2
    low = high
    while random_walk(sigma_x, omega_bw, low) <= limit:
        low /= 4
    root = brentq(lambda log: math.log(random_walk(sigma_x, omega_bw, math.exp(log)) / limit), *np.log([low, high]))
    return math.exp(root)


# -- exact discretization -------------------------------------------------------------------------


class Discretization(NamedTuple):
    r"""One cycle of (10) in units of :math:`\sigma_x` and T, exact at the sampling times.

    Parameters
    ----------
    phi11, phi21 : of (9), phi21 over T.
    q11, q12, q22 : covariances of q, over :math:`\sigma_x^2`, :math:`\sigma_x^2T`, :math:`\sigma_x^2T^2`.
    bridge : variance of the integral over a cycle when the input at both its ends is known,
        :math:`L(\mu/2)\tanh(\mu/2)/(\mu/2)`, over :math:`\sigma_x^2T^2`.
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

    The last form has positive terms alone.
    """
    mu = _positive("mu", mu)
    phi = np.exp(-mu)
    lost = -np.expm1(-mu)  # 1 - φ
    phi21 = lost / mu
    bridge = walk_factor(mu) * (np.tanh(mu / 2) / (mu / 2))  # in this order nothing underflows
    return Discretization(
        phi, phi21, -np.expm1(-2 * mu), phi21 * lost, bridge + phi21 * phi21 * (lost / (1 + phi)), bridge
    )


def printed_discretization_q22(mu: ArrayLike) -> Floats:
    """q22 of :func:`discretize` in float64 from the form that cancels."""
    mu = _positive("mu", mu)
    phi = np.exp(-mu)
    return np.asarray((2 * mu - 3 + 4 * phi - phi * phi) / (mu * mu))


# -- before the steady state ----------------------------------------------------------------------


def error_variance(n: ArrayLike, mu: float, start: float = 1.0) -> Floats:
    r"""Variance of the error of the trapezoidal rule after n cycles, over :math:`\sigma_x^2T^2`.

    .. math:: \frac{P_{ee_n}}{\sigma_x^2T^2} = nL - \tfrac12L^2(1-\varphi^n)
        - (1-s)\,\tfrac14L^2(1-\varphi^n)^2, \qquad L = L(\mu/2),\ \varphi = e^{-\mu}

    Parameters
    ----------
    n : cycles, at least 0.
    start : s, variance of the input at the start, over :math:`\sigma_x^2`; savage2016 assumes 1.
    """
    cycles, mu = _count(n), float(_positive("mu", mu))
    if not 0 <= start < math.inf:
        raise ValueError(f"got start = {start}; needed a variance ratio of at least 0")
    rate = float(walk_factor(mu))
    gone = -np.expm1(-cycles * mu)
    return np.asarray(cycles * rate - rate**2 / 2 * gone - (1 - start) * (rate * gone) ** 2 / 4)


def error_variance_recursion(n: int, mu: float) -> Floats:
    r"""The same for 0 … n cycles from a recursion, for an input in its steady state.

    .. math:: P_{k+1} = P_k + 2gc_k + r, \qquad c_{k+1} = \varphi c_k + g, \qquad
        g = \tfrac12(1-\varphi)L,\ r = L - \tfrac12(1-\varphi)L^2

    with :math:`c_k = E(e_kx_{1k})/(\sigma_x^2T)`. All terms are positive; (18) of savage2016 takes differences of
    :math:`P_{33}`, :math:`P_{22}` and :math:`P_{32}`, each larger than the result by :math:`12/\mu^2`.
    """
    n, mu = int(_count(n)), float(_positive("mu", mu))
    rate, lost, phi = float(walk_factor(mu)), -math.expm1(-mu), math.exp(-mu)
    g, r = lost * rate / 2, rate - lost * rate**2 / 2
    variance, c = np.zeros(n + 1), 0.0
    for k in range(n):
        variance[k + 1] = variance[k] + 2 * g * c + r
        c = phi * c + g
    return variance


def rectangle_error_variance(n: ArrayLike, mu: float) -> Floats:
    r"""As :func:`error_variance` for the rectangular rules, :math:`nL + \tfrac12(1-L^2)(1-\varphi^n)`."""
    cycles, mu = _count(n), float(_positive("mu", mu))
    rate = float(walk_factor(mu))
    return np.asarray(cycles * rate - (1 - rate**2) / 2 * np.expm1(-cycles * mu))


def takeover(mu: float, share: float, rectangle: bool = False) -> float:
    r"""Cycles after which the random walk is the error variance to within the relative `share`.

    For the trapezoidal rule :math:`L(1-\varphi^n)/2n \le` share, for the rectangular ones
    :math:`(1/L-L)(1-\varphi^n)/2n \le` share.

    Raises
    ------
    ValueError : `share` not above 0.
    """
    rate = float(walk_factor(float(_positive("mu", mu))))
    if not 0 < share < math.inf:
        raise ValueError(f"got share = {share}; needed a positive number, as 0.01 for one percent")
    offset = (1 / rate - rate if rectangle else rate) / 2

    def excess(n: float) -> float:
        return float(offset * -math.expm1(-n * mu) / n - share)

    if excess(1.0) <= 0:
        return 1.0
    return float(brentq(excess, 1.0, offset / share * (1 + 1e-9) + 1))


class SavageRecursion(NamedTuple):
    """Covariances of (13) cycle by cycle, (n + 1,) each, in units of σ_x and T."""

    p31: NDArray[np.float64]
    p32: NDArray[np.float64]
    p33: NDArray[np.float64]
    p22: NDArray[np.float64]

    @property
    def pee(self) -> Floats:
        """(13)."""
        return np.asarray(self.p33 + self.p22 - 2 * self.p32)


def savage_recursion(n: int, mu: float, p32_weight: float = 0.5, p22_slip: bool = False) -> SavageRecursion:
    r"""(18) with (25), (27) and (28) of savage2016 from zero initial conditions.

    Parameters
    ----------
    p32_weight : of :math:`\varphi_{21}P_{11}T` in the second line of (18): 1/2, printed 1.
    p22_slip : leave out the second :math:`1/\omega_{bw}` of (25), as printed; T in seconds is then taken as 1.
    """
    n, mu = int(_count(n)), float(_positive("mu", mu))
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


# -- other inputs ---------------------------------------------------------------------------------


@dataclass(frozen=True)
class Process:
    r"""A stationary Gaussian input with mean zero, :math:`R(\tau) = \sigma_x^2\,\mathrm{Re}\sum_j c_je^{-p_j|\tau|}`.

    Made by :func:`first_order` and :func:`resonant`. `drift` is the matrix F of :math:`\dot z = Fz + w`, whose steady
    state has the covariance :math:`\sigma_x^2 I`; the input is the first entry of z.
    """

    name: str
    sigma: float
    poles: tuple[complex, ...]
    weights: tuple[complex, ...]
    drift: tuple[tuple[float, ...], ...]

    def autocovariance(self, tau: ArrayLike) -> Floats:
        """R at the lags `tau`, s."""
        lag = np.abs(np.asarray(tau, dtype=np.float64))
        total: Any = sum(c * np.exp(-p * lag) for c, p in zip(self.weights, self.poles, strict=True))
        return np.asarray(self.sigma**2 * np.real(total))

    def psd(self, omega: ArrayLike) -> Floats:
        """Two-sided spectral density at `omega`, rad/s; its integral over frequencies in Hz is the variance."""
        s = np.asarray(omega, dtype=np.float64)
        total: Any = sum(2 * c * p / (p * p + s * s) for c, p in zip(self.weights, self.poles, strict=True))
        return np.asarray(self.sigma**2 * np.real(total))


def first_order(sigma_x: float, omega_bw: float) -> Process:
    r"""The input of savage2016, (1): :math:`R = \sigma_x^2e^{-\omega_{bw}|\tau|}`; `omega_bw` in rad/s."""
    sigma_x, omega_bw = _scalar("sigma_x", sigma_x), _scalar("omega_bw", omega_bw)
    return Process("first order", sigma_x, (complex(omega_bw),), (1 + 0j,), ((-omega_bw,),))


def resonant(sigma_x: float, omega_0: float, zeta: float) -> Process:
    r"""White noise through :math:`\ddot x + 2\zeta\omega_0\dot x + \omega_0^2x`, a second-order input with a resonance.

    Parameters
    ----------
    omega_0 : natural frequency, rad/s.
    zeta : damping ratio, above 0 and below 1.
    """
    sigma_x, omega_0 = _scalar("sigma_x", sigma_x), _scalar("omega_0", omega_0)
    if not 0 < zeta < 1:
        raise ValueError(f"got zeta = {zeta}; needed 0 < zeta < 1; use first_order for an input without resonance")
    damped = math.sqrt(1 - zeta * zeta)
    pole = omega_0 * complex(zeta, -damped)
    weight = complex(1, -zeta / damped)
    drift = ((0.0, omega_0), (-omega_0, -2 * zeta * omega_0))
    return Process(f"resonant, ζ = {zeta:g}", sigma_x, (pole,), (weight,), drift)


class Step(NamedTuple):
    r"""One cycle of a process and of the error of the trapezoidal rule: :math:`(z_n, d_n) = A z_{n-1} + Bw`.

    w are m + 1 independent standard normal numbers, A is (m + 1, m) and B (m + 1, m + 1), lower triangular; d is in
    the units of x times seconds.
    """

    a: NDArray[np.float64]
    b: NDArray[np.float64]


@lru_cache(maxsize=256)
def exact_step(process: Process, f_c: float) -> Step:
    r"""Discretize a process together with the error of the trapezoidal rule, exact at the sampling times.

    For the first order in closed form. With h the part of :math:`L\tanh(\mu/2)`,
    :math:`d_n = \tfrac12Th(x_{n-1}+x_n) + b`, where b has the variance ``bridge`` of :func:`discretize`. For others
    from the matrix exponential, with as many digits as the cancellation takes.
    """
    period = 1 / _scalar("f_c", f_c)
    sigma = process.sigma
    if len(process.drift) == 1:
        mu = -process.drift[0][0] * period
        one = discretize(mu)
        half = float(walk_factor(mu) * np.tanh(mu / 2)) / 2 * period
        phi, root = float(one.phi11), math.sqrt(float(one.q11)) * sigma
        a = np.array([[phi], [half * (1 + phi)]])
        return Step(a, np.array([[root, 0.0], [half * root, sigma * period * math.sqrt(float(one.bridge))]]))
    return Step(*_moments(process, period))


def _moments(process: Process, period: float) -> tuple[Floats, Floats]:
    r"""A and B of :class:`Step` for any drift F, from the covariances of z and of its integral y over a cycle.

    With T as the unit of time, :math:`\Phi = e^F` and :math:`\sigma_x = 1`, the steady state gives
    :math:`E(zz^T) = I`, :math:`E(zy) = F^{-1}(\Phi - I)\,e_1`, :math:`E(y^2) = 2e_1^TF^{-2}(\Phi - I - F)\,e_1`;
    what the state before explains is subtracted. Nothing grows with T; for small T all cancels, hence the digits.
    """
    m = len(process.drift)
    small = max(1.0, 1 / (max(abs(p) for p in process.poles) * period))
    with mpmath.workdps(40 + 10 * math.ceil(math.log10(small) + 1)):
        drift = mpmath.matrix(process.drift) * mpmath.mpf(period)
        phi, inverse, unit, first = mpmath.expm(drift), drift**-1, mpmath.eye(m), mpmath.eye(m)[:, 0]
        mixed = inverse * (phi - unit) * first
        transition = mpmath.zeros(m + 1, m)
        transition[:m, :], transition[m, :] = phi, first.T * inverse * (phi - unit)
        covariance = mpmath.eye(m + 1)
        covariance[:m, m], covariance[m, :m] = mixed, mixed.T
        covariance[m, m] = 2 * (first.T * inverse * (inverse * (phi - unit) - unit) * first)[0]
        covariance -= transition * transition.T
        # d = (x_n + x_{n-1})/2 - integral
        change = mpmath.eye(m + 1)
        change[m, 0], change[m, m] = mpmath.mpf(1) / 2, -1
        a = change * transition
        a[m, 0] += mpmath.mpf(1) / 2
        root = mpmath.cholesky(change * covariance * change.T)
        scale = [1.0] * m + [period]
        step = np.array([[float(a[i, j]) * scale[i] for j in range(m)] for i in range(m + 1)])
        noise = np.array([[float(root[i, j]) * scale[i] * process.sigma for j in range(m + 1)] for i in range(m + 1)])
    return step, noise


# -- other integrators ----------------------------------------------------------------------------


@dataclass(frozen=True)
class Rule:
    r"""A rule of integration: at step r of a period it adds :math:`T\sum_j w_{rj}\,x_{n-j}`.

    Parameters
    ----------
    weights : a tuple of w for each step of a period; empty where the rule waits.

    Raises
    ------
    ValueError : no step; or weights whose sum is not the number of steps, so that a constant is not integrated.
    """

    name: str
    weights: tuple[tuple[Fraction, ...], ...]

    def __post_init__(self) -> None:
        if not self.weights:
            raise ValueError("got a rule without steps; needed weights for at least one")
        total = sum((w for step in self.weights for w in step), start=Fraction(0))
        if total != len(self.weights):
            raise ValueError(
                f"got weights that sum to {total} over {len(self.weights)} steps; needed {len(self.weights)}, or a "
                "constant is integrated wrongly; scale the weights"
            )

    @property
    def period(self) -> int:
        """Steps after which the rule repeats."""
        return len(self.weights)

    @property
    def memory(self) -> int:
        """Cycles that the rule looks back."""
        return max(1, *(len(step) - 1 for step in self.weights))

    def sample_weights(self) -> tuple[Fraction, ...]:
        """Weights that the samples of a period have in the end; their mean is 1."""
        total = [Fraction(0)] * self.period
        for r, step in enumerate(self.weights):
            for j, w in enumerate(step):
                total[(r + 1 - j) % self.period] += w
        return tuple(total)

    def harmonics(self) -> tuple[complex, ...]:
        r"""Fourier coefficients :math:`W_0 \dots W_{p-1}` of :meth:`sample_weights`; W_0 is 1."""
        p, total = self.period, self.sample_weights()
        turn = [complex(math.cos(2 * math.pi * k / p), -math.sin(2 * math.pi * k / p)) for k in range(p)]
        return tuple(sum(float(a) * turn[m * i % p] for i, a in enumerate(total)) / p for m in range(p))


def _rule(name: str, *steps: Sequence[str]) -> Rule:
    return Rule(name, tuple(tuple(map(Fraction, step)) for step in steps))


#: Integrators by name. All but the closed Newton-Cotes rules give every sample the weight 1 in the end.
RULES = {
    rule.name: rule
    for rule in (
        _rule("rectangular, old sample", ["0", "1"]),
        _rule("rectangular, new sample", ["1"]),
        _rule("trapezoidal", ["1/2", "1/2"]),
        _rule("Adams-Bashforth 2", ["0", "3/2", "-1/2"]),
        _rule("Adams-Moulton 3", ["5/12", "8/12", "-1/12"]),
        _rule("two speeds, 4 samples", [], [], [], ["1/2", "1", "1", "1", "1/2"]),
        _rule("Simpson", [], ["1/3", "4/3", "1/3"]),
        _rule("Simpson 3/8", [], [], ["3/8", "9/8", "9/8", "3/8"]),
        _rule("Boole", [], [], [], ["14/45", "64/45", "24/45", "64/45", "14/45"]),
    )
}


def walk_rate(process: Process, f_c: float, rule: Rule = RULES["trapezoidal"]) -> float:
    r"""Random walk of any rule and process: growth of the error variance per second.

    .. math:: \dot P_{ee} = \sum_{k\ne0} S(2\pi kf_c) +
        \sum_{m=1}^{p-1} |W_m|^2 \sum_k S\bigl(2\pi f_c(k+\tfrac mp)\bigr)

    It is the part of the input's spectrum S that sampling folds down to frequency zero: at multiples of :math:`f_c`
    for every rule, and between them for a rule that weighs the samples unequally. The sums are evaluated by Poisson's
    formula, :math:`\sum_kS(2\pi f_c(k+\theta)) = T\sum_nR(nT)\cos2\pi n\theta`, in as many digits as they cancel.

    Returns
    -------
    rate : in the unit of the input squared, times seconds.
    """
    period = 1 / _scalar("f_c", f_c)
    harmonics = rule.harmonics()
    total = 0.0
    for m, weight in enumerate(harmonics):
        size = 1.0 if m == 0 else abs(weight) ** 2
        if size > 1e-30:
            total += size * folded(process, period, Fraction(m, rule.period))
    return total


def folded(process: Process, period: float, theta: Fraction = Fraction(0)) -> float:
    r"""Spectral density at :math:`2\pi f_c(k+\theta)` summed over all k, without k = 0 where :math:`\theta = 0`."""
    mu = max(abs(p) for p in process.poles) * period
    total = mpmath.mpf(0)
    with mpmath.workdps(30 + 8 * max(1, math.ceil(abs(math.log10(mu)) + 1))):
        # The weights rounded to float64 would not cancel; of a resonance they follow from the drift.
        for c, p in _exact_modes(process):
            z = p * mpmath.mpf(period)
            if theta == 0:
                total += mpmath.re(c * (mpmath.coth(z / 2) - 2 / z))
            else:
                angle = 2 * mpmath.pi * theta.numerator / theta.denominator
                total += mpmath.re(c * mpmath.sinh(z) / (mpmath.cosh(z) - mpmath.cos(angle)))
        return float(total * period) * process.sigma**2


def _exact_modes(process: Process) -> list[tuple[Any, Any]]:
    """Weights and poles in the precision at work."""
    if len(process.drift) == 1:
        return [(mpmath.mpf(1), mpmath.mpf(-process.drift[0][0]))]
    (_, omega_0), (_, minus) = process.drift
    omega = mpmath.mpf(omega_0)
    zeta = -mpmath.mpf(minus) / (2 * omega)
    damped = mpmath.sqrt(1 - zeta * zeta)
    return [(mpmath.mpc(1, -zeta / damped), omega * mpmath.mpc(zeta, -damped))]


def best_possible_rate(process: Process, f_c: float) -> float:
    r"""Least random walk of any weighing of the samples, right for constants or not, :math:`S(0)A/(S(0)+A)`.

    A is :func:`walk_rate` of the trapezoidal rule, which is the least for rules that are right for constants. The
    bound belongs to samples scaled by :math:`S(0)/(S(0)+A)`, the best estimate of the integral from all samples.
    """
    walk, low = walk_rate(process, f_c), float(process.psd(0.0))
    return low * walk / (low + walk)


def rule_variance(process: Process, f_c: float, rule: Rule, n: int) -> Floats:
    """Variance of the error of a rule after 0 … n cycles, from the covariance recursion of its state; exact.

    The state holds z, as many past samples as the rule looks back, and the error. Within a period the error of a rule
    that waits includes what it has not yet added.

    Returns
    -------
    variance : (n + 1,), in the unit of the input times seconds, squared.
    """
    n = int(_count(n))
    step = exact_step(process, f_c)
    m, h = len(process.drift), rule.memory
    size = m + h + 1  # z_n, x_{n-1} … x_{n-h}, e
    period = 1 / f_c
    covariance = _past(process, period, h)
    variance = np.zeros(n + 1)
    moves = [_moves(step, [float(w) for w in weights], m, h, period) for weights in rule.weights]
    state = np.zeros((size, size))
    state[: m + h, : m + h] = covariance
    for k in range(n):
        a, b = moves[k % rule.period]
        state = a @ state @ a.T + b @ b.T
        variance[k + 1] = state[-1, -1]
    return variance


def _past(process: Process, period: float, h: int) -> Floats:
    """Covariance of z_0, x_{-1} … x_{-h} in the steady state: from the oldest on, forwards."""
    m = len(process.drift)
    a, b = exact_step(process, 1 / period)
    move, drive = np.zeros((m + h, m + h)), np.zeros((m + h, m + 1))
    move[:m, :m], drive[:m] = a[:m], b[:m]
    move[m, 0] = 1.0
    for j in range(1, h):
        move[m + j, m + j - 1] = 1.0
    covariance = np.zeros((m + h, m + h))
    covariance[:m, :m] = process.sigma**2 * np.eye(m)
    for _ in range(h):
        covariance = move @ covariance @ move.T + drive @ drive.T
    return covariance


def _moves(step: Step, weights: Sequence[float], m: int, h: int, period: float) -> tuple[Floats, Floats]:
    """One cycle of the state of :func:`rule_variance`: its matrix, and what multiplies the normal numbers."""
    size = m + h + 1
    move, drive = np.zeros((size, size)), np.zeros((size, m + 1))
    move[:m, :m], drive[:m] = step.a[:m], step.b[:m]
    move[m, 0] = 1.0
    for j in range(1, h):
        move[m + j, m + j - 1] = 1.0
    # e_n = e_{n-1} + d_n + T Σ (w_j - trapezoid's) x_{n-j}; x_n from the new z, x_{n-1} from the old.
    move[-1, -1] = 1.0
    move[-1, :m], drive[-1] = step.a[m], step.b[m]
    for j in range(h + 1):
        w = period * ((weights[j] if j < len(weights) else 0.0) - (0.5 if j < 2 else 0.0))
        if j == 0:
            move[-1, :m] += w * step.a[0]
            drive[-1] += w * step.b[0]
        elif j == 1:
            move[-1, 0] += w
        else:
            move[-1, m + j - 2] += w
    return move, drive


# -- two errors meet: t-digit arithmetic ----------------------------------------------------------


def mean_square_rounding(fmt: FloatFormat) -> float:
    r"""Mean square of the relative error of one rounding to nearest, :math:`\kappa = b^{-2t}(b^2-1)/(24\ln b)`.

    For a number whose logarithm is spread evenly: an error spread evenly over a spacing :math:`b^{e-t}`.
    """
    b = fmt.base
    return float(b) ** (-2 * fmt.precision) * (b * b - 1) / (24 * math.log(b))


def mean_chopping(fmt: FloatFormat) -> float:
    r"""Mean relative error of chopping, :math:`\kappa_1 = b^{-t}(b-1)/(2\ln b)`, for the same numbers."""
    return float(fmt.base) ** -fmt.precision * (fmt.base - 1) / (2 * math.log(fmt.base))


class Errors(NamedTuple):
    """Standard deviations of the error of an integral, in the unit of the input times seconds."""

    discretization: float
    rounding: float

    @property
    def total(self) -> float:
        """Both, as independent errors add up."""
        return math.hypot(*self)


def correlation_factor(change: ArrayLike) -> Floats:
    r"""How much roundings that follow each other add up beyond independent ones.

    .. math:: F = 1 + \sum_{k\ge1} \frac{6}{\pi^2k^2\,\sinh(2\pi^2k^2s^2)}

    The accumulator is a multiple of its spacing u, so that the error of adding p depends on the fraction of p/u alone.
    While p changes little from cycle to cycle, so does the error. s is the rms change of p from one cycle to the
    next, in spacings; F is 1.05 at s = 0.5 and near :math:`1/(30s^2)` below.

    Parameters
    ----------
    change : s, positive. The formula is right while p itself is spread over more than a spacing.
    """
    s = _positive("change", change)[..., np.newaxis]
    k = np.arange(1, 65)
    with np.errstate(over="ignore"):
        return np.asarray(1 + np.sum(6 / (np.pi**2 * k**2 * np.sinh(2 * np.pi**2 * k**2 * s**2)), axis=-1))


def two_errors(sigma_x: float, omega_bw: float, f_c: float, duration: float, fmt: FloatFormat) -> Errors:
    r"""Errors of the trapezoidal rule run in a format, at the end of a `duration` t of many correlation times.

    Discretization: :func:`error_variance`. Rounding to nearest: the sum of

    - the errors of the additions to the accumulator, whose variance grows as (23); their mean square is that of a
      spacing u of the accumulator, :math:`u^2F/12`;
    - what ties add in an even base: one addition in u over the spacing of the increment is a tie, and half away from
      zero moves it outwards, by :math:`\kappa_1E|p|` in the mean. The sum has the rms
      :math:`\kappa_1\sigma_xt\sqrt{(1+\varphi)/2\pi}`, where 1/2 is the mean square of the share of time that a random
      walk is more often on one side than on the other;
    - the roundings of sample, sum and product, each of the mean square :math:`\kappa` of its number.

    T/2 counts as exact: its one rounding changes the integral by a share that no rate changes.

    Chopping: each addition takes the share :math:`\kappa_1` off the accumulator, which leaks. With
    :math:`a = \kappa_1f_ct` the error has the variance
    :math:`(2\sigma_x^2t/\omega_{bw})\,(2a-3+4e^{-a}-e^{-2a})/2a`, or :math:`2\sigma_x^2ta^2/3\omega_{bw}` for small a.

    Parameters
    ----------
    duration : s; at least two cycles.

    Raises
    ------
    ValueError : an argument is not positive and finite, or `duration` shorter than two cycles.
    """
    sigma_x, mu = _scalar("sigma_x", sigma_x), _mu(omega_bw, f_c)
    period, n = 1 / f_c, _scalar("duration", duration) * f_c
    if n < 2:
        raise ValueError(f"got a duration of {n:.3g} cycles; needed at least 2")
    discretization = sigma_x * period * math.sqrt(float(error_variance(n, mu)))
    phi = math.exp(-mu)
    excess = mu / 2 / math.tanh(mu / 2)  # of the digital integral's variance over that of the true one
    share = mean_chopping(fmt)
    if fmt.rounding is Rounding.CHOP:
        leak = share * n
        variance = sigma_x**2 * duration / omega_bw * leak * float(discretize(leak).q22) * excess
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
    # Sixteen octaves down from 8 standard deviations: what is below adds less than 2**-36 of the whole.
    e = top - np.arange(math.ceil(16 / math.log2(b)) + 1)[:, np.newaxis]
    spacing = b ** (e - fmt.precision)
    within = erf(b**e / (spread * math.sqrt(2)))
    share = within - np.concatenate([within[1:], np.zeros((1, len(spread)))])
    return np.asarray(np.sum(share * spacing**2 / 12 * correlation_factor(change / spacing), axis=0))


def independent_best_rate(omega_bw: float, duration: float, fmt: FloatFormat) -> float:
    r"""The best rate in Hz in closed form, for :math:`\mu\ll1` and independent roundings to nearest.

    .. math:: f_c = \left(\frac{\omega_{bw}^2}{3\kappa t}\right)^{1/3}

    There, the variance of the rounding error, :math:`\kappa\sigma_x^2t^2f_c/\omega_{bw}`, is twice that of the
    discretization error, :math:`\sigma_x^2\omega_{bw}t/6f_c^2`. With chopping both grow and fall alike, in
    :math:`f_c = (\omega_{bw}^2/4\kappa_1^2t^2)^{1/4}`. The rms of the input does not matter.
    """
    omega_bw, duration = _scalar("omega_bw", omega_bw), _scalar("duration", duration)
    if fmt.rounding is Rounding.CHOP:
        return math.sqrt(omega_bw / (2 * mean_chopping(fmt) * duration))
    return float((omega_bw**2 / (3 * mean_square_rounding(fmt) * duration)) ** (1 / 3))


def best_rate(omega_bw: float, duration: float, fmt: FloatFormat) -> float:
    """Iteration rate in Hz at which the total of :func:`two_errors` is least; below :func:`stall_rate`.

    Parameters
    ----------
    omega_bw : rad/s. `duration` : s, of many correlation times 1/omega_bw.

    Raises
    ------
    ValueError : at no rate is the total error below half of the integral's own rms: use more digits.
    """
    guess = independent_best_rate(omega_bw, duration, fmt)

    def total(log: float) -> float:
        return two_errors(1.0, omega_bw, math.exp(log), duration, fmt).total

    low, high = max(guess / 100, 2.001 / duration), max(guess * 10, 100 / duration)
    found: Any = minimize_scalar(
        total, bounds=(math.log(low), math.log(high)), method="bounded", options={"xatol": 1e-5}
    )
    if total(found.x) > math.sqrt(2 * duration / omega_bw) / 2:
        raise ValueError(
            f"got {fmt}, {duration:g} s, {omega_bw:g} rad/s; needed an error below half of the integral at some rate; "
            "use more digits"
        )
    return math.exp(found.x)


def needed_precision(
    omega_bw: float,
    f_c: float,
    duration: float,
    base: int = 2,
    rounding: Rounding = Rounding.NEAREST,
    share: float = 0.1,
) -> int:
    """Least digits with which the rounding error stays below `share` of the discretization error.

    Raises
    ------
    ValueError : `share` not above 0, or an argument of :func:`two_errors` is refused.
    """
    if not 0 < share < math.inf:
        raise ValueError(f"got share = {share}; needed a positive number, as 0.1 for a tenth")

    def enough(fmt: FloatFormat) -> bool:
        errors = two_errors(1.0, omega_bw, f_c, duration, fmt)
        return errors.rounding <= share * errors.discretization

    most = math.ceil(400 / math.log2(base))
    found = smallest_precision(enough, base, rounding, largest=most, monotone=True)
    if found is None:
        raise ValueError(
            f"got share = {share}, {f_c:g} Hz, {duration:g} s; needed at most {most} digits; allow a larger share"
        )
    return found.precision


def stall_rate(omega_bw: float, duration: float, fmt: FloatFormat) -> float:
    r"""Rate in Hz at which the rms increment is half a spacing of the accumulator at the end.

    Near it and beyond, additions are lost, :func:`two_errors` is no longer right, and the integral stands still.
    """
    omega_bw, duration = _scalar("omega_bw", omega_bw), _scalar("duration", duration)
    spacing = math.sqrt(12 * mean_square_rounding(fmt) * 2 * duration / omega_bw)
    return 2 / spacing


# -- what is refused ------------------------------------------------------------------------------


def _positive(name: str, values: ArrayLike) -> Floats:
    array = np.asarray(values, dtype=np.float64)
    if not np.all((array > 0) & (array < np.inf)):
        bad = array[~((array > 0) & (array < np.inf))].flat[0]
        raise ValueError(f"got {name} = {bad}; needed a positive, finite number; check its unit and sign")
    return array


def _scalar(name: str, value: float) -> float:
    array = _positive(name, value)
    if array.ndim:
        raise ValueError(f"got {name} of shape {array.shape}; needed one number; call it once for each")
    return float(array)


def _mu(omega_bw: float, f_c: float) -> float:
    mu = _scalar("omega_bw", omega_bw) / _scalar("f_c", f_c)
    if not 0 < mu < math.inf:
        raise ValueError(f"got omega_bw / f_c = {mu}; needed it within the range of float64; check the units")
    return mu


def _count(n: ArrayLike) -> Floats:
    array = np.asarray(n, dtype=np.float64)
    if not np.all((array >= 0) & (array < np.inf)):
        raise ValueError(f"got n = {n!r}; needed cycles, at least 0 and finite")
    return array
