"""The smallest precision that meets a tolerance is that, and says what it rests on."""

from __future__ import annotations

import math
from dataclasses import replace
from fractions import Fraction
from functools import cache

import numpy as np
import pytest

import gpbnb
from gpbnb import required_precision
from gpbnb.arithmetic.formats import FloatFormat
from gpbnb.arithmetic.named import arithmetic
from gpbnb.arithmetic.rational import exact
from gpbnb.arithmetic.rounding import Rounding
from gpbnb.bounds.guarantee import limits
from gpbnb.filters.emulation import emulate
from gpbnb.filters.forms import Form
from gpbnb.filters.model import LinearModel
from gpbnb.filters.run import reference
from gpbnb.filters.simulation import Simulation, fine_resolution, simulated_measurements
from gpbnb.filters.system import LinearSystem, unobserved
from tests.surveying import survey

STEPS = 60
MODEL = LinearModel(
    [["0.99", "0.1"], [0, "0.97"]], [[1, "0.3"]], [["1e-3", 0], [0, "2e-3"]], [["0.4"]], [3, -1], [[2, 0], [0, 1]]
)
Z = Simulation(MODEL, (3.0, -1.0), 0, fine_resolution(MODEL)).measurements(STEPS)


@cache
def true():
    return reference(MODEL, Z, range(1, STEPS + 1))


def error(fmt):
    return np.abs(emulate(MODEL, Z, fmt, Form.INNOVATION, range(1, STEPS + 1), true()).state)


@pytest.mark.parametrize("rounding", list(Rounding.documented()))
@pytest.mark.parametrize("base", [2, 10, 16])
def test_the_smallest_precision_meets_the_tolerance_and_one_less_does_not(base, rounding):
    tolerance = 1e-4
    found = required_precision(MODEL, STEPS, tolerance, base=base, rounding=rounding)
    assert found.format.base == base
    assert found.format.rounding is rounding
    t = found.digits
    ratios = dict(found.tried)
    assert list(ratios) == sorted(ratios)
    assert ratios[t] <= 1
    assert ratios[t + 1] <= 1
    assert ratios[t - 1] > 1
    for digits in (t - 1, t, t + 1):  # here at every step, there at sixteen a decade
        seen = error(FloatFormat(base, digits, rounding)).max() / tolerance
        assert ratios[digits] <= seen <= 3 * ratios[digits]
    assert (found.basis, found.steps) == ("emulation", STEPS)
    assert str(found).startswith(arithmetic(FloatFormat(base, t, rounding)))
    assert str(found).endswith("of the tolerance, observed in 60 steps")


@pytest.mark.parametrize(("form", "steps"), [("innovation", 300), ("UD", 300), ("symmetrized", 60)])
def test_an_answer_holds_in_every_step(form, steps):
    """A constant-velocity tracker whose largest error in 15 bits falls between the steps of a logarithmic scale."""
    Q = [["1/10000", "3/2000"], ["3/2000", "3/100"]]
    given = LinearModel([[1, "0.1"], [0, 1]], [[1, 0]], Q, [["0.5"]], [0, 0], [[100, 0], [0, 10]])
    z = simulated_measurements(given, steps, 0)
    tolerance = np.array([0.01, 0.1])
    found = required_precision(given, z, tolerance, form=form)
    every = range(1, steps + 1)
    true = reference(given, z, every)
    for digits, ratio in found.tried:
        history = emulate(given, z, FloatFormat(2, digits), form, every, true)
        if not history.indefinite and not history.stopped:
            assert (np.abs(history.state) / tolerance).max() == pytest.approx(ratio, rel=1e-12, abs=0)


def test_a_run_is_described_and_has_its_estimates():
    history = emulate(MODEL, Z, FloatFormat(2, 12), checkpoint_steps=[7, 30])
    largest = ", ".join(f"{each:.2g}" for each in abs(history.state).max(axis=0))
    assert repr(history) == f"innovation in 12 bits, 30 steps: largest error of each state {largest}"
    assert history.estimate.tolist() == gpbnb.emulate(MODEL, Z, FloatFormat(2, 12)).x.to_float()[[6, 29]].tolist()


def test_an_answer_says_why_fewer_digits_were_refused():
    """A Q of rank one, which few bits make indefinite."""
    thin = Fraction("0.35") * np.array([[Fraction(1, 2500), Fraction(1, 50)], [Fraction(1, 50), Fraction(1)]])
    single = LinearModel(MODEL.Phi, MODEL.H, thin, MODEL.R, MODEL.x0, MODEL.P0, repair=False)
    with pytest.raises(ValueError, match=r"; it misses that by no more than roundings may: .* to its diagonal, \d"):
        single.rounded(FloatFormat(2, 24, Rounding.NEAREST))
    ratios = survey(single, Z, 1e-3, range(3, 54, 3), basis="bound")
    refused = {digits for digits, ratio in ratios if math.isinf(ratio)}
    assert 24 in refused
    repaired = LinearModel(MODEL.Phi, MODEL.H, thin, MODEL.R, MODEL.x0, MODEL.P0)
    ratios = survey(repaired, Z, 1e-3, range(3, 54, 3), basis="bound")
    finite = [digits for digits, ratio in ratios if math.isfinite(ratio)]
    assert finite == list(range(finite[0], 54, 3))
    assert required_precision(MODEL, Z, 1e-3).why == ""


def test_a_missing_measurement_changes_nothing_but_the_prediction():
    """NaN, a mask, and a row of zeros in H give the same run; two sensors with correlated noise, one of them silent."""
    two = LinearModel(MODEL.Phi, [[1, "0.3"], [0, 1]], MODEL.Q, [["0.4", "0.1"], ["0.1", "0.5"]], MODEL.x0, MODEL.P0)
    z = Simulation(two, (3.0, -1.0), 0, fine_resolution(two)).measurements(12)
    silent = np.zeros((12, 2), dtype=bool)
    silent[3, 0] = silent[7] = True
    with_nan = np.where(silent, np.nan, z)
    by_nan = required_precision(two, with_nan, 1e-4)
    assert by_nan == required_precision(two, np.ma.MaskedArray(z, silent), 1e-4)
    assert by_nan != required_precision(two, z, 1e-4)
    replaced, filled = two.without_missing(with_nan)
    assert np.array_equal(filled, np.where(silent, 0, z))
    found = reference(replaced, filled, [3, 4, 8])
    assert not found.K[1][:, 0].any()
    assert not found.K[2].any()
    alone = LinearModel(two.Phi, two.H[0][1:], two.Q, two.R[0][1:, 1:], found.x[0], (found.P[0] + found.P[0].T) / 2)
    step = reference(alone, z[3:4, 1:], [1])
    assert step.x[0].astype(float) == pytest.approx(found.x[1].astype(float), rel=1e-14)
    assert step.P[0].astype(float) == pytest.approx(found.P[1].astype(float), rel=1e-14)
    history, again = emulate(two, with_nan, FloatFormat(2, 24)), emulate(replaced, filled, FloatFormat(2, 24))
    assert np.array_equal(history.state, again.state)
    within = limits(state=100, innovation=20)
    with pytest.raises(ValueError, match='got missing measurements and basis "guarantee"'):
        required_precision(two, with_nan, 1e-4, basis="guarantee", within=within)


WHOLE, WITH_INPUTS = np.round(Z[:12] * 4), replace(MODEL, d=["0.5"])
GAPS = (np.arange(12) % 5 == 2).reshape(-1, 1)


def answers_for(z):
    """The answers by each basis, for a filter with and without inputs, and the errors of a run."""
    models, bases = (MODEL, WITH_INPUTS), ("emulation", "bound")
    found = [required_precision(model, z, 1e-3, basis=basis) for model in models for basis in bases]
    return found, emulate(MODEL, z, FloatFormat(2, 9), checkpoint_steps=[12]).state.tolist()


def answers_for_system(z):
    """The answer for a system, and the estimate of the reference."""
    return required_precision(LinearSystem([["0.5"]], [[1]]), z, 1e-3), reference(MODEL, z, [12]).x.tolist()


@pytest.fixture(scope="module")
def expected():
    """What float64 gives for the numbers, whole and with gaps."""
    masked = np.ma.masked_array(WHOLE, GAPS)
    return {False: answers_for(WHOLE), True: answers_for(masked), "system": answers_for_system(WHOLE)}


@pytest.mark.parametrize(("dtype", "masked"), [(np.float32, True), (np.int8, False), ("U9", False)])
def test_measurements_of_any_type_are_read_exactly(dtype, masked, expected):
    """The same numbers in another type give the same answer, for a filter with and without inputs, and for a system."""
    z = WHOLE.astype(dtype)
    assert all(float(a) == b for a, b in zip(z.ravel(), WHOLE.ravel(), strict=True))
    assert answers_for(np.ma.masked_array(z, GAPS) if masked else z) == expected[masked]
    if not masked:
        assert answers_for_system(z) == expected["system"]


@pytest.mark.parametrize(
    ("Phi", "H", "text"),
    [
        ([["1.1"]], [[0]], "eigenvalue of size 1.1"),
        (
            [[1, "0.1"], [0, 1]],
            [[0, 1]],
            "eigenvalue of size 1 or more",
        ),  # a position of which only the speed is measured
        ([[1, "0.1"], [0, 1]], [[1, 0]], ""),
        ([["0.9", 0], [0, 1]], [[0, 1]], ""),
        ([["0.9", 0], [0, 1]], [[1, 0]], "eigenvalue of size 1 or more"),
        # the difference of two equal states is not observed, and decays if both do
        ([[2, 0], [0, 2]], [[1, 1]], "eigenvalue of size 2"),
        ([["1/2", 0], [0, "1/2"]], [[1, 1]], ""),
    ],
)
def test_a_part_of_the_state_that_no_measurement_observes_is_found_exactly(Phi, H, text):
    found = unobserved(exact(Phi), exact(H))
    assert (text in found) if text else found == ""
