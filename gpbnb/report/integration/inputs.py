r"""Other inputs and other integrators: spectra, exact steps and random walks.

The letters are those of savage2016: :math:`\omega_{bw}` bandwidth of the input in rad/s, T cycle time in s,
:math:`f_c = 1/T` iteration rate in Hz, :math:`\mu = \omega_{bw}T`, :math:`\sigma_x` rms of the input in any unit. A
"factor" is dimensionless: it is divided by the units of the input and of T. Functions apply to arrays of
:math:`\mu` entry by entry.
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

from gpbnb.report.integration.arguments import Floats, cycle_counts, positive_number
from gpbnb.report.integration.walk import discretize, walk_factor

# -- other inputs ---------------------------------------------------------------------------------


@dataclass(frozen=True)
class Process:
    r"""A stationary Gaussian input with mean zero, :math:`R(\tau) = \sigma_x^2\,\mathrm{Re}\sum_j c_je^{-p_j|\tau|}`.

    :func:`first_order` and :func:`resonant` create processes. `drift` is the matrix F of :math:`\dot z = Fz + w`, whose
    steady state has the covariance :math:`\sigma_x^2 I`; the input is the first entry of z.
    """

    name: str
    sigma: float
    poles: tuple[complex, ...]
    weights: tuple[complex, ...]
    drift: tuple[tuple[float, ...], ...]

    def autocovariance(self, tau: ArrayLike) -> Floats:
        """Return the autocovariance R at the lags `tau` in s."""
        lag = np.abs(np.asarray(tau, dtype=np.float64))
        total: Any = sum(c * np.exp(-p * lag) for c, p in zip(self.weights, self.poles, strict=True))
        return np.asarray(self.sigma**2 * np.real(total))

    def psd(self, omega: ArrayLike) -> Floats:
        """Return the two-sided spectral density at `omega` in rad/s; integrated over frequency in Hz, it gives σ²."""
        s = np.asarray(omega, dtype=np.float64)
        total: Any = sum(2 * c * p / (p * p + s * s) for c, p in zip(self.weights, self.poles, strict=True))
        return np.asarray(self.sigma**2 * np.real(total))

    def folded(self, period: float, theta: Fraction = Fraction(0)) -> float:
        r"""Sum the density at :math:`2\pi f_c(k+\theta)` over all k, except k = 0 if :math:`\theta = 0`.

        Poisson's formula, :math:`\sum_kS(2\pi f_c(k+\theta)) = T\sum_nR(nT)\cos2\pi n\theta`, is evaluated in as many
        digits as it cancels.
        """
        mu = max(abs(p) for p in self.poles) * period
        total = mpmath.mpf(0)
        with mpmath.workdps(30 + 8 * max(1, math.ceil(abs(math.log10(mu)) + 1))):
            # Weights rounded to float64 would not cancel; for a resonance, exact ones follow from the drift.
            for c, p in _exact_modes(self):
                z = p * mpmath.mpf(period)
                if theta == 0:
                    total += mpmath.re(c * (mpmath.coth(z / 2) - 2 / z))
                else:
                    angle = 2 * mpmath.pi * theta.numerator / theta.denominator
                    total += mpmath.re(c * mpmath.sinh(z) / (mpmath.cosh(z) - mpmath.cos(angle)))
            return float(total * period) * self.sigma**2


def first_order(sigma_x: float, omega_bw: float) -> Process:
    r"""Return the input of savage2016, (1): :math:`R = \sigma_x^2e^{-\omega_{bw}|\tau|}`; `omega_bw` in rad/s."""
    sigma_x, omega_bw = positive_number("sigma_x", sigma_x), positive_number("omega_bw", omega_bw)
    return Process("first order", sigma_x, (complex(omega_bw),), (1 + 0j,), ((-omega_bw,),))


def resonant(sigma_x: float, omega_0: float, zeta: float) -> Process:
    r"""Return a resonant input: white noise through :math:`\ddot x + 2\zeta\omega_0\dot x + \omega_0^2x`."""
    sigma_x, omega_0 = positive_number("sigma_x", sigma_x), positive_number("omega_0", omega_0)
    if not 0 < zeta < 1:
        raise ValueError(f"got zeta = {zeta}; needed 0 < zeta < 1; use first_order for an input without resonance")
    damped = math.sqrt(1 - zeta * zeta)
    pole = omega_0 * complex(zeta, -damped)
    weight = complex(1, -zeta / damped)
    drift = ((0.0, omega_0), (-omega_0, -2 * zeta * omega_0))
    return Process(f"resonant, ζ = {zeta:g}", sigma_x, (pole,), (weight,), drift)


class Cycle(NamedTuple):
    r"""One cycle of a process and of the error of the trapezoidal rule: :math:`(z_n, d_n) = A z_{n-1} + Bw`.

    w holds m + 1 independent standard normal numbers. A is (m + 1, m), and B is (m + 1, m + 1) and lower triangular.
    d has the unit of x times seconds.
    """

    a: NDArray[np.float64]
    b: NDArray[np.float64]


@lru_cache(maxsize=256)
def exact_step(process: Process, f_c: float) -> Cycle:
    r"""Discretize a process together with the error of the trapezoidal rule, exact at the sampling times.

    First-order inputs have a closed form. With :math:`h = L\tanh(\mu/2)`,
    :math:`d_n = \tfrac12Th(x_{n-1}+x_n) + b`, where b has the variance ``bridge`` of ``discretize``. Other
    inputs use the matrix exponential, with enough digits to survive the cancellation.
    """
    period = 1 / positive_number("f_c", f_c)
    sigma = process.sigma
    if len(process.drift) == 1:
        mu = -process.drift[0][0] * period
        one = discretize(mu)
        half = float(walk_factor(mu) * np.tanh(mu / 2)) / 2 * period
        phi, root = float(one.phi11), math.sqrt(float(one.q11)) * sigma
        a = np.array([[phi], [half * (1 + phi)]])
        return Cycle(a, np.array([[root, 0.0], [half * root, sigma * period * math.sqrt(float(one.bridge))]]))
    return Cycle(*_moments(process, period))


def _moments(process: Process, period: float) -> tuple[Floats, Floats]:
    r"""A and B of :class:`Cycle` for any drift F, from the covariances of z and of its integral y over a cycle.

    With T as the unit of time, :math:`\Phi = e^F` and :math:`\sigma_x = 1`, the steady state gives
    :math:`E(zz^T) = I`, :math:`E(zy) = F^{-1}(\Phi - I)\,e_1`, :math:`E(y^2) = 2e_1^TF^{-2}(\Phi - I - F)\,e_1`;
    the part that follows from the previous state is subtracted. Nothing grows with T. For small T all terms cancel,
    which is why many digits are used.
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
    r"""An integration rule: at step r of a period it adds :math:`T\sum_j w_{rj}\,x_{n-j}`."""

    name: str
    weights: tuple[tuple[Fraction, ...], ...]

    @property
    def period(self) -> int:
        """Number of steps after which the rule repeats."""
        return len(self.weights)

    @property
    def memory(self) -> int:
        """Number of past cycles whose samples the rule uses."""
        return max(1, *(len(step) - 1 for step in self.weights))

    def sample_weights(self) -> tuple[Fraction, ...]:
        """Return the total weight of each sample in a period; their mean is 1."""
        total = [Fraction(0)] * self.period
        for r, step in enumerate(self.weights):
            for j, w in enumerate(step):
                total[(r + 1 - j) % self.period] += w
        return tuple(total)

    def harmonics(self) -> tuple[complex, ...]:
        r"""Return the Fourier coefficients :math:`W_0 \dots W_{p-1}` of :meth:`sample_weights`; W_0 is 1."""
        p, total = self.period, self.sample_weights()
        turn = [complex(math.cos(2 * math.pi * k / p), -math.sin(2 * math.pi * k / p)) for k in range(p)]
        return tuple(sum(float(a) * turn[m * i % p] for i, a in enumerate(total)) / p for m in range(p))


def _rule(name: str, *steps: Sequence[str]) -> Rule:
    return Rule(name, tuple(tuple(map(Fraction, step)) for step in steps))


#: Integrators by name. All but the closed Newton-Cotes rules give every sample a total weight of 1.
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
    r"""Return the random walk for any rule and input: growth of the error variance per second.

    .. math:: \dot P_{ee} = \sum_{k\ne0} S(2\pi kf_c) +
        \sum_{m=1}^{p-1} |W_m|^2 \sum_k S\bigl(2\pi f_c(k+\tfrac mp)\bigr)

    It is the part of the input's spectrum S that sampling folds down to frequency zero: at multiples of :math:`f_c`
    for every rule, and between them for a rule that weighs the samples unequally.
    """
    period = 1 / positive_number("f_c", f_c)
    harmonics = rule.harmonics()
    total = 0.0
    for m, weight in enumerate(harmonics):
        size = 1.0 if m == 0 else abs(weight) ** 2
        if size > 1e-30:
            total += size * process.folded(period, Fraction(m, rule.period))
    return total


def _exact_modes(process: Process) -> list[tuple[Any, Any]]:
    """Return weights and poles in the current working precision."""
    if len(process.drift) == 1:
        return [(mpmath.mpf(1), mpmath.mpf(-process.drift[0][0]))]
    (_, omega_0), (_, minus) = process.drift
    omega = mpmath.mpf(omega_0)
    zeta = -mpmath.mpf(minus) / (2 * omega)
    damped = mpmath.sqrt(1 - zeta * zeta)
    return [(mpmath.mpc(1, -zeta / damped), omega * mpmath.mpc(zeta, -damped))]


def rule_variance(process: Process, f_c: float, rule: Rule, n: int) -> Floats:
    """Return the error variance of a rule after 0 … n cycles, from the exact covariance recursion of its state.

    The state consists of z, the past samples that the rule uses, and the error. Within a period, the error includes
    samples that the rule has not added yet.
    """
    n = int(cycle_counts(n))
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
    """Return the steady-state covariance of z_0, x_{-1} … x_{-h}, computed forwards from the oldest sample."""
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


def _moves(step: Cycle, weights: Sequence[float], m: int, h: int, period: float) -> tuple[Floats, Floats]:
    """Return one cycle of the state of :func:`rule_variance`: the transition matrix, and the factor of the noise."""
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
