"""Tables of the chapter on digital integration."""

from __future__ import annotations

import math
from collections.abc import Sequence

from gpbnb.arithmetic.formats import FloatFormat
from gpbnb.arithmetic.named import digits, rounding_text
from gpbnb.arithmetic.rounding import Rounding
from gpbnb.report.display.tables import Table
from gpbnb.report.integration import derivation, theory
from gpbnb.report.integration.theory import Process


def sensor(sigma_x: float, bandwidth_hz: float, unit: str, rates: Sequence[float]) -> Table:
    """Tabulate the random walk of an integrated sensor at some iteration rates.

    Parameters
    ----------
    sigma_x : rms of the signal, in `unit` per second.
    bandwidth_hz : bandwidth of the signal, Hz.
    unit : unit of the integral, such as "°".
    rates : iteration rates, Hz.
    """
    omega = 2 * math.pi * bandwidth_hz
    body: list[tuple[str, ...]] = []
    for f_c in rates:
        exact, printed = (walk(sigma_x, omega, f_c) for walk in (theory.random_walk, theory.printed_random_walk))
        body.append(
            (
                f"{f_c:g}",
                f"{omega / f_c:.3g}",
                f"{exact:.3g}",
                f"{printed:.3g}",
                f"{printed / exact - 1:.2g}",
                f"{exact * 60:.3g}",
            )
        )
    header = (
        "$f_c$, Hz",
        "$\\mu$, rad",
        f"(35), {unit}/√s",
        f"(39), {unit}/√s",
        "(39)/(35) − 1",
        f"(35), {unit}/√h",
    )
    return Table(f"random walk at {len(body)} rates", header, tuple(body))


def rules(processes: Sequence[tuple[Process, float]]) -> Table:
    """Tabulate the random walk of rules relative to the trapezoidal one, for pairs of an input and a rate in Hz."""
    body: list[tuple[str, ...]] = []
    for rule in theory.RULES.values():
        weights = rule.sample_weights()
        alike = len(set(weights)) == 1
        cells = [rule.name, str(rule.period), "1" if alike else ", ".join(map(str, sorted(weights)))]
        for process, f_c in processes:
            ratio = theory.walk_rate(process, f_c, rule) / theory.walk_rate(process, f_c)
            cells.append(f"{math.sqrt(ratio):.4g}")
        body.append(tuple(cells))
    names = (f"{process.name}, $|p|T = {max(abs(p) for p in process.poles) / f_c:.3g}$" for process, f_c in processes)
    return Table(f"{len(body)} rules", ("rule", "period (cycles)", "weights of the samples", *names), tuple(body))


def misprints(mu: float = 0.1, period: float = 0.01) -> Table:
    """Tabulate the random walk that each misprint would have caused, for one μ and a cycle time in s."""
    right = float(derivation.walk().subs(derivation.MU, mu))
    body: list[tuple[str, ...]] = []
    for place, rate in derivation.misprints().items():
        value = float(rate.subs({derivation.MU: mu, derivation.T: period}))
        spoiled = "no" if math.isclose(value, right, rel_tol=1e-9) else "yes"
        body.append((place, f"{value:.5g}", f"{right:.5g}", spoiled))
    header = ("misprint in", f"result as printed / ($\\sigma_x^2T$), at $\\mu = {mu:g}$", "correct", "affects (35)")
    return Table(f"{len(body)} misprints", header, tuple(body))


def design(omega_bw: float, duration: float, precisions: Sequence[int], base: int = 2) -> Table:
    """Tabulate the best rate for formats and both errors, relative to the rms of the input; "none" if no rate works."""
    body: list[tuple[str, ...]] = []
    for t in precisions:
        for rounding in Rounding.documented():
            fmt = FloatFormat(base, t, rounding)
            try:
                rate = theory.best_rate(omega_bw, duration, fmt)
            except ValueError:
                body.append((digits(fmt), rounding_text(rounding), "none", "", "", ""))
                continue
            errors = theory.two_errors(1.0, omega_bw, rate, duration, fmt)
            body.append(
                (
                    digits(fmt),
                    rounding_text(rounding),
                    f"{rate:,.3g}",
                    f"{theory.independent_best_rate(omega_bw, duration, fmt):,.3g}",
                    f"{errors.discretization:.2g}",
                    f"{errors.rounding:.2g}",
                )
            )
    header = (
        "format",
        "rounding",
        "best $f_c$, Hz",
        "best $f_c$ by closed form, Hz",
        "discretization error, s",
        "rounding error, s",
    )
    return Table(f"{len(body)} formats", header, tuple(body))


def derivative_rules(most: int, counts: Sequence[int]) -> Table:
    """Tabulate the random walk of rules with up to `most` derivatives, relative to the trapezoidal one.

    There is a column for each number of lags: the ratio for fast sampling, and the largest μ below which the
    rule is the better one. An input without the derivatives has no entry.
    """
    body: list[tuple[str, ...]] = []
    for derivatives in range(most + 1):
        rule = theory.hermite(derivatives)
        cells = [str(derivatives) if derivatives else "none (trapezoidal)", ", ".join(map(str, rule.weights))]
        for count in counts:
            if count <= derivatives:
                cells.append("")
                continue
            share = theory.fast_sampling_ratio(rule.even(), count)
            below = f", $\\mu<{theory.largest_useful_mu(rule, count):.2g}$" if share < 1 else ""
            cells.append(f"{math.sqrt(share):.2g}{below}")
        body.append(tuple(cells))
    header = ("derivatives", "weights of $T$, $T^2$, …", *(f"{count} lags" for count in counts))
    return Table(f"{len(body)} rules with derivatives", header, tuple(body))


def least_errors(cycles: Sequence[int], ratios: Sequence[float]) -> Table:
    """Tabulate the rms error of the trapezoidal rule relative to the least of all weights, for cycles and ratios μ."""
    body = [
        (
            f"{n:,}",
            *(f"{math.sqrt(float(theory.error_variance(n, mu) / theory.least_variance(n, mu))):.3f}" for mu in ratios),
        )
        for n in cycles
    ]
    header = ("cycles $n$", *(f"at $\\mu = {mu:g}$" for mu in ratios))
    return Table(f"{len(body)} lengths", header, tuple(body))
