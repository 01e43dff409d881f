"""gpbnb.report.rolling.phase: the weight of the fit, against the derivation, quadrature and simulated years."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy import integrate
from tabulated import by_header

from gpbnb.report.measurement import YEAR
from gpbnb.report.rolling import derivation, experiment, phase, tables, theory

LIMIT = theory.largest_phase(theory.DRIFTS, 1.0)


def test_the_weight_is_that_of_the_fit():
    share = np.linspace(0, 1, 11)
    # A line fitted to the drift across, times the time, each divided by their values at the end.
    assert phase.weight(share) == pytest.approx(12 * (share - 0.5) * share, abs=1e-15)
    assert integrate.quad(phase.weight, 0, 1)[0] == pytest.approx(1)
    assert (phase.weight(share[1:5]) < 0).all()
    assert (phase.weight(share[6:]) > 0).all()


def test_weighted_means_are_the_derived_ones():
    steps = {step.name: float(step.right) for step in derivation.varying_phase().steps[:5]}
    found = {name: phase.means(shape) for name, shape in phase.SHAPES.items()}
    for name, (plain, weighted) in {
        "constant": (1, steps["a constant error of 1"]),
        "ramp from − to +": (0, steps["a ramp from −1 to 1, whose mean is zero"]),
        "− in the first half, + in the second": (
            0,
            steps["−1, then 1: these are the signs of the weight, so no error costs more"],
        ),
        "zero in the first half": (0.5, steps["in the second half alone"]),
        "zero in the second half": (0.5, steps["an error of 1 in the first half alone"]),
    }.items():
        assert found[name] == pytest.approx((plain, weighted), abs=1e-12)
    cosine, sine = 6 / math.pi**2, 3 / math.pi
    assert found["one oscillation a year"] == pytest.approx((0, math.hypot(cosine, sine)), abs=1e-12)
    turns = YEAR / phase.ORBIT
    whole = round(turns)
    # Nearly whole cycles: a sine counts 3/(πn).
    assert abs(found["one oscillation an orbit"][1]) < 2 * 3 / (math.pi * whole)


def test_nothing_within_the_same_limits_costs_more():
    rng = np.random.default_rng(31)
    assert phase.means(lambda share: np.sign(share - 0.5))[1] == pytest.approx(phase.WORST, rel=1e-12)
    for _ in range(20):
        cuts = rng.uniform(-1, 1, 64)
        assert abs(phase.means(lambda share, c=cuts: c[np.minimum((share * 64).astype(int), 63)])[1]) < phase.WORST


def test_independent_errors_average_out():
    rng, count, trials = np.random.default_rng(4), 1024, 400
    drawn = rng.standard_normal((trials, count))
    middle = phase.weight((np.arange(count) + 0.5) / count) / count
    found = float(np.sqrt(np.mean((drawn @ middle) ** 2)))
    expected = phase.independent_mean(YEAR / count)
    assert abs(found / expected - 1) < 4 / math.sqrt(2 * trials)  # four standard errors


@pytest.mark.parametrize("name", phase.SHAPES)
def test_a_simulated_year_finds_the_weighted_mean(name):
    shape = phase.SHAPES[name]
    found = experiment.clean_drift_error(theory.DRIFTS, lambda t: LIMIT * shape(t / YEAR))
    # To first order in the phase error, 1.5e-4; the year is sampled every 100 s.
    expected = phase.means(shape)[1] * LIMIT * theory.DRIFTS[0]
    assert found[1] == pytest.approx(expected, abs=1e-3)


def test_the_table_of_varying_phases():
    table = tables.varying_phases(LIMIT)
    assert table.title == "What phase errors that vary cost"
    rows = by_header(table)
    assert [row["phase error between ±31″"] for row in rows] == list(phase.SHAPES)
    costs = {row["phase error between ±31″"]: row["false frame dragging (mas a year)"] for row in rows}
    assert list(costs.values()) == ["1.00", "1.00", "1.50", "1.25", "0.25", "1.13", "0.00"]
    assert [row["simulated (mas a year)"] for row in rows] == list(costs.values())
    averages = [row["its mean (arcseconds)"] for row in rows]
    assert averages == ["31.25", "0.00", "0.00", "15.63", "15.63", "0.00", "0.00"]
