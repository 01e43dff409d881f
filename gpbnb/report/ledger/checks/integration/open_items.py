"""Checks of the work that savage2016 leaves undone: the transient, and a numerical example."""

from __future__ import annotations

from functools import cache

import numpy as np

from gpbnb.report.integration import derivation, experiment, theory
from gpbnb.report.ledger.checks.integration.registry import CHAPTER, CHECKS, MAIN
from gpbnb.report.ledger.finding import Finding, answer


@cache
def simulated() -> experiment.WalkSweep:
    """Return a small simulation of the random walk."""
    return experiment.sweep([0.01, 0.1, 1.0, 10.0], 300, 4000, np.random.default_rng(35))


def worst(found: experiment.WalkSweep) -> float:
    """Return the largest deviation from the exact variance, in standard errors."""
    return float(np.max(np.abs(found.deviations())))


@CHECKS.add(MAIN + "sanalysis.transient")
def transient() -> Finding:
    mu, n = 3.0, [1, 2, 5, 20]
    closed = theory.error_variance(np.arange(41), mu)
    again = float(np.max(abs(theory.error_variance_recursion(40, mu) - closed)))
    run = experiment.simulate(theory.first_order(1.0, mu), 1.0, n, np.random.default_rng(14), 4000)
    away = float(np.max(np.abs(run.deviations(closed[n]))))
    return answer(
        derivation.transient().holds and again < 1e-12 and away < 4,
        "$P_{ee_n}=\\sigma_x^2T^2[nL-\\frac12L^2(1-e^{-n\\mu})]$, $L=L(\\mu/2)$; simulations of "
        f"1 to 20 cycles differ from it by at most {away:.1f} standard errors",
        f"see the {CHAPTER}, section on the build-up",
    )


@CHECKS.add(MAIN + "sanalysis.numerical-example")
def numerical_example() -> Finding:
    omega, f_c = 2 * np.pi * 100, 1000.0
    ours = theory.random_walk(1.0, omega, f_c)
    again = np.sqrt(theory.walk_rate(theory.first_order(1.0, omega), f_c))
    rate = theory.required_rate(1.0, omega, ours)
    away = worst(simulated())
    return answer(
        bool(abs(ours / again - 1) < 1e-12 and abs(rate / f_c - 1) < 1e-9 and away < 4),
        f"noise of 1 °/s rms with a bandwidth of 100 Hz, sampled at 1 kHz, gives {ours:.3g} °/√s or "
        f"{60 * ours:.2g} °/√h; simulations agree within {away:.1f} standard errors",
        f"see the {CHAPTER}, sections on the simulation and on a sensor",
    )
