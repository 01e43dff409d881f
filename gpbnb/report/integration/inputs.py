r"""Other inputs and other integrators: spectra, exact steps and random walks.

The letters are those of savage2016: :math:`\omega_{bw}` bandwidth of the input in rad/s, T cycle time in s,
:math:`f_c = 1/T` iteration rate in Hz, :math:`\mu = \omega_{bw}T`, :math:`\sigma_x` rms of the input in any unit. A
"factor" is dimensionless: it is divided by the units of the input and of T. Functions apply to arrays of
:math:`\mu` entry by entry.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from fractions import Fraction
from functools import lru_cache
from typing import Any, NamedTuple

import mpmath
import numpy as np
from numpy.typing import ArrayLike, NDArray

from gpbnb.report.integration.arguments import Floats, positive_number
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

    def folded(self, period: float) -> float:
        r"""Sum the density at :math:`2\pi kf_c` over all k except 0, in as many digits as the sum cancels.

        Poisson's formula gives :math:`\sum_kS(2\pi kf_c) = T\sum_nR(nT)`.
        """
        mu = max(abs(p) for p in self.poles) * period
        total = mpmath.mpf(0)
        with mpmath.workdps(30 + 8 * max(1, math.ceil(abs(math.log10(mu)) + 1))):
            # Weights rounded to float64 would not cancel; for a resonance, exact ones follow from the drift.
            for c, p in _exact_modes(self):
                z = p * mpmath.mpf(period)
                total += mpmath.re(c * (mpmath.coth(z / 2) - 2 / z))
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


# -- the random walk ------------------------------------------------------------------------------

TRAPEZOID = (Fraction(1, 2), Fraction(1, 2))
"""Weights of the new and of the old sample in (2), times T."""


def walk_rate(process: Process, f_c: float) -> float:
    r"""Return the random walk of the trapezoidal rule for any input: growth of the error variance per second.

    It is the part of the input's spectrum S that sampling folds down to frequency zero,
    :math:`\dot P_{ee} = \sum_{k\ne0} S(2\pi kf_c)`.
    """
    return process.folded(1 / positive_number("f_c", f_c))


def _exact_modes(process: Process) -> list[tuple[Any, Any]]:
    """Return weights and poles in the current working precision."""
    if len(process.drift) == 1:
        return [(mpmath.mpf(1), mpmath.mpf(-process.drift[0][0]))]
    (_, omega_0), (_, minus) = process.drift
    omega = mpmath.mpf(omega_0)
    zeta = -mpmath.mpf(minus) / (2 * omega)
    damped = mpmath.sqrt(1 - zeta * zeta)
    return [(mpmath.mpc(1, -zeta / damped), omega * mpmath.mpc(zeta, -damped))]


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
