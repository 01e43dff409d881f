"""Errors of rounded steps beside the printed bounds (105), (108) and (125), in exact arithmetic."""

from __future__ import annotations

from typing import NamedTuple

from gpbnb.arithmetic.rational import exact, max_norm
from gpbnb.report.kalman import exact_step, report_bounds
from gpbnb.report.kalman.smallest import rounded_step


class Ratios(NamedTuple):
    """Largest error / bound over all entries; infinite for an error where the bound is zero."""

    covariance: float
    gain: float
    state: float


def ratios(fmt, case, second=False, steps=1):
    """Compare the errors of the last of some rounded steps, each with the same measurement, with the bounds."""
    rounded, exactly = case, case
    transitions, inputs = [], []
    for _ in range(steps):
        x, K, P = rounded_step(fmt, rounded, second)
        rounded = rounded._replace(x=x, P=P)
        true = exact_step.exact_step(*exactly)
        exactly = exactly._replace(x=true.x, P=true.P)
        transitions.append(true.transition)
        inputs.append(true.gain @ case.z)
    (n, m), beta = true.gain.shape, fmt.unit_roundoff
    counts = report_bounds.coefficients(steps, n, m)
    B = report_bounds.printed_input_bound(transitions, inputs)
    bound = beta * (counts.first * max_norm(true.x) + counts.second * B)
    return Ratios(
        _worst(P - true.P, report_bounds.covariance_count(n, m) * beta * abs(true.P)),
        _worst(K - true.gain, report_bounds.gain_count(n, m) * beta * abs(true.gain)),
        _worst(exact([max_norm(x - true.x)]), exact([bound])),
    )


def _worst(error, bound):
    pairs = zip(abs(error).flat, bound.flat, strict=True)
    return max((float(e / b) if b else float("inf") for e, b in pairs if e), default=0.0)
