r"""Rules that use derivatives of the input, and the least error of rules that do not.

The letters are those of savage2016: T cycle time in s, :math:`f_c = 1/T` iteration rate in Hz, :math:`\mu =
\omega_{bw}T`, :math:`\sigma_x` rms of the input in any unit.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction

import mpmath
import numpy as np
import scipy
from numpy.typing import ArrayLike

from gpbnb.report.integration.arguments import Floats, cycle_counts, positive_array, positive_number
from gpbnb.report.integration.inputs import Process, exact_step, lags, summed
from gpbnb.report.integration.walk import walk_factor


def least_variance(n: ArrayLike, mu: float) -> Floats:
    r"""Return the least error variance of n + 1 weighted samples that integrate a constant exactly; over σ²T².

    .. math:: \min_a\frac{P_{ee_n}}{\sigma_x^2T^2} = nL - L^2 + \frac{L^2}{1 + n\tanh(\mu/2)}, \qquad L = L(\mu/2)

    for a first-order input and any weights a that sum to n; they need not repeat. The least grows as fast as the
    variance of the trapezoidal rule, and is smaller by at most :math:`\tfrac12L^2`.

    Parameters
    ----------
    n : cycles, at least 0.
    """
    cycles, mu = cycle_counts(n), float(positive_array("mu", mu))
    rate = float(walk_factor(mu))
    return np.asarray(cycles * rate - rate**2 + rate**2 / (1 + cycles * math.tanh(mu / 2)))


@dataclass(frozen=True)
class DerivativeRule:
    r"""A rule that adds :math:`\sum_j w_jT^{j+1}\bigl[x^{(j)}_{n-1} + (-1)^jx^{(j)}_n\bigr]` in each cycle.

    Parameters
    ----------
    weights : :math:`w_0, w_1, \dots`; w_0 is 1/2, so that a constant is integrated correctly.
    """

    name: str
    weights: tuple[Fraction, ...]

    def __post_init__(self) -> None:
        if not self.weights or self.weights[0] != Fraction(1, 2):
            raise ValueError(
                f"got weights {self.weights}; needed 1/2 first, so that a constant is integrated correctly"
            )

    @property
    def derivatives(self) -> int:
        """Order of the highest derivative that the rule uses."""
        return len(self.weights) - 1

    def even(self) -> tuple[Fraction, ...]:
        """Return the total weights of the input, its second, fourth … derivative in a long run; the others cancel."""
        return tuple(2 * w for w in self.weights[::2])

    def gain(self, angle: ArrayLike) -> Floats:
        r"""Return the response :math:`\sum_iw_{2i}(-\theta^2)^i` of a long sum at :math:`\omega T = \theta`."""
        square = -(np.asarray(angle, dtype=np.float64) ** 2)
        return np.asarray(np.polynomial.polynomial.polyval(square, [float(w) for w in self.even()]), dtype=np.float64)


def hermite(derivatives: int) -> DerivativeRule:
    r"""Return the two-point rule with derivatives that is exact for the highest degree, 2·`derivatives` + 1.

    .. math:: w_j = \binom l{j+1}\frac{(2l-j-1)!}{(2l)!}, \qquad l = \text{derivatives} + 1

    With none it is the trapezoidal rule; with two, T/2, T²/10, T³/120.
    """
    if not 0 <= derivatives <= 8:
        raise ValueError(f"got {derivatives} derivatives; needed 0 to 8")
    last = derivatives + 1
    weights = (
        Fraction(math.comb(last, j) * math.factorial(2 * last - j), math.factorial(2 * last))
        for j in range(1, last + 1)
    )
    return DerivativeRule(f"two points, {derivatives} derivatives", tuple(weights))


def derivative_walk_rate(process: Process, f_c: float, rule: DerivativeRule) -> float:
    r"""Return the random walk of a rule with derivatives: growth of the error variance per second.

    .. math:: \dot P_{ee} = \sum_{k\ne0} S(2\pi kf_c)\,\Bigl|\sum_iw_{2i}(-1)^i(2\pi k)^{2i}\Bigr|^2

    A derivative of odd order adds up to its first value minus its last one, which does not grow.

    Parameters
    ----------
    process : an input with as many derivatives as the rule uses.
    f_c : iteration rate, Hz.

    Returns
    -------
    rate : in the unit of the input squared, times seconds.
    """
    _check(process, rule)
    f_c = positive_number("f_c", f_c)
    return 2 * summed(lambda k: process.psd(2 * np.pi * k * f_c) * rule.gain(2 * np.pi * k) ** 2)


def derivative_rule_variance(process: Process, f_c: float, rule: DerivativeRule, n: int) -> Floats:
    """Return the error variance of a rule after 0 … n cycles, from the exact covariance recursion, without spectra.

    Returns
    -------
    variance : (n + 1,), in the unit of the input times seconds, squared.
    """
    _check(process, rule)
    step, m, period = exact_step(process, f_c), len(process.drift), 1 / f_c
    # Each derivative of the input is a combination of the entries of z.
    drift, row = np.array(process.drift), np.eye(m)[0]
    old, new = np.zeros(m), np.zeros(m)
    for j, w in enumerate(rule.weights):
        if j:
            row = row @ drift
            old += float(w) * period ** (j + 1) * row
            new += (-1) ** j * float(w) * period ** (j + 1) * row
    move, drive = np.eye(m + 1), step.b.copy()
    move[:m, :m], move[m, :m] = step.a[:m], step.a[m] + old + new @ step.a[:m]
    drive[m] += new @ step.b[:m]
    state = np.zeros((m + 1, m + 1))
    state[:m, :m] = process.sigma**2 * np.eye(m)
    variance = [0.0]
    for _ in range(int(cycle_counts(n))):
        state = move @ state @ move.T + drive @ drive.T
        variance.append(float(state[m, m]))
    return np.array(variance)


def fast_sampling_ratio(weights: Sequence[Fraction], count: int) -> Fraction:
    r"""Return the limit of the random walk's variance relative to the trapezoidal rule for fast sampling; exact.

    .. math:: \frac1{\zeta(2m)}\sum_{k\ge1}k^{-2m}\Bigl|\sum_iw_{2i}(-1)^i(2\pi k)^{2i}\Bigr|^2, \qquad
        \frac{(2\pi)^{2j}\zeta(2m-2j)}{\zeta(2m)} = \frac{(2m)!\,|B_{2m-2j}|}{(2m-2j)!\,|B_{2m}|}

    Parameters
    ----------
    weights : total weights of the input, its second, fourth … derivative, as :meth:`DerivativeRule.even` returns them.
    count : m, the number of lags through which the input has passed.
    """
    if 2 * (len(weights) - 1) >= count:
        raise ValueError(f"got {count} lags; needed more than {2 * (len(weights) - 1)}, one more than derivatives")

    def zeta(s: int) -> Fraction:
        p, q = mpmath.bernfrac(s)
        return Fraction(abs(int(p)), int(q) * math.factorial(s))

    total = Fraction(0)
    for i, a in enumerate(weights):
        for j, b in enumerate(weights):
            total += (-1) ** (i + j) * a * b * zeta(2 * (count - i - j)) / zeta(2 * count)
    return total


def largest_useful_mu(rule: DerivativeRule, count: int) -> float:
    """Return the ratio of bandwidth to rate, rad, above which a rule is worse than the trapezoidal one."""
    if not fast_sampling_ratio(rule.even(), count) < 1:
        raise ValueError(f"got the rule {rule.name!r}; needed one that is better for fast sampling after {count} lags")

    def gain(log: float) -> float:
        process = lags(1.0, math.exp(log), count)
        return math.log(derivative_walk_rate(process, 1.0, rule) / process.folded(1.0))

    return math.exp(scipy.optimize.brentq(gain, math.log(0.01), math.log(1e4)))


def tolerable_derivative_error(process: Process, f_c: float, rule: DerivativeRule) -> float:
    r"""Return the independent error of each second derivative that cancels the gain of a rule over the trapezoidal one.

    Errors of rms s add :math:`(2w_2)^2T^5s^2` to the variance in each second.

    Parameters
    ----------
    rule : a rule with two or three derivatives.

    Returns
    -------
    share : s relative to the rms of the second derivative; dimensionless.
    """
    if rule.derivatives not in (2, 3):
        raise ValueError(f"got {rule.derivatives} derivatives; needed 2 or 3, so that the second alone counts")
    saved = process.folded(1 / f_c) - derivative_walk_rate(process, f_c, rule)
    if not saved > 0:
        raise ValueError(f"got the rule {rule.name!r} at {f_c:g} Hz; needed one that is better than the trapezoidal")
    curvature = process.sigma * float(np.linalg.norm(np.linalg.matrix_power(np.array(process.drift), 2)[0]))
    return math.sqrt(saved * f_c**5) / (float(rule.even()[1]) * curvature)


def _check(process: Process, rule: DerivativeRule) -> None:
    """Raise ValueError if an input has fewer derivatives than a rule uses."""
    available = len(process.drift) - 1
    if rule.derivatives > available:
        raise ValueError(
            f"got an input with {available} derivatives; needed {rule.derivatives} for the rule {rule.name!r}; take "
            "an input that has passed more lags"
        )
