"""gpbnb.wordlength: what the chapter on wordlength measures, shows and tabulates."""

from __future__ import annotations

import math
from dataclasses import replace
from fractions import Fraction

import numpy as np
import pytest

from gpbnb import required_precision
from gpbnb.arithmetic.formats import FloatFormat
from gpbnb.filters.emulation import emulate
from gpbnb.filters.forms import WITH_PROGRAM, Form
from gpbnb.filters.run import log_spaced, reference
from gpbnb.report import examples
from gpbnb.report.guarantees import table as guarantees
from gpbnb.report.wordlengths import study
from tests.surveying import survey

TILT = examples.tilt()
Z = examples.tilt_measurements(300)


# -- examples -----------------------------------------------------------------------------------------


# -- study --------------------------------------------------------------------------------------------


def test_spans_hold_every_number():
    checkpoints = reference(TILT, Z, log_spaced(300, 16))
    numbers = {"estimate": checkpoints.x, "gain": checkpoints.K, "covariance": checkpoints.P}
    found = {each.name: each for each in study.binary_ranges(TILT, Z)}
    for name, values in numbers.items():
        sizes = np.abs(values.astype(float)).ravel()
        sizes = sizes[sizes > 0]
        assert 2.0 ** found[name].least <= sizes.min() < 2 * 2.0 ** found[name].least
        assert 2.0 ** found[name].largest <= sizes.max() < 2 * 2.0 ** found[name].largest
    assert found["model"][1:] == (-34, 8)  # 1e-10 and 400


@pytest.mark.parametrize("state", range(3))
def test_a_curve_of_variances_is_that_of_the_exact_filter_to_the_digits_of_the_format(state):
    curve, lost = study.variances(TILT, FloatFormat(2, 50), state, 300)
    steps = tuple(range(3, 301, 3))
    assert [step for step, _ in curve] == list(steps)
    assert lost is None
    assert [P for _, P in curve] == pytest.approx(reference(TILT, Z, steps).P[:, state, state].astype(float), rel=1e-9)


def test_update_stagnation_is_that_of_the_runs():
    fmt, checkpoint_steps = FloatFormat(2, 12), tuple(range(1, 301))
    (coarse, fine) = study.update_stagnation(TILT, Z, 2, [fmt, FloatFormat(2, 40)], last=200)
    history = emulate(TILT, Z, fmt, Form.INNOVATION, checkpoint_steps, reference(TILT, Z, checkpoint_steps))
    true = reference(TILT, Z, checkpoint_steps)
    bias = history.state[:, 2] + true.x[:, 2].astype(float)
    assert coarse.unchanged == pytest.approx(np.mean(np.abs(np.diff(bias[-201:])) < 1e-9), abs=1e-12)
    assert coarse.unchanged > 0
    assert fine.unchanged == 0
    assert coarse.variance == pytest.approx(1 + history.covariance[-1, 2, 2] / float(true.P[-1, 2, 2]), rel=1e-12)
    watched = np.array(sorted({*log_spaced(300, 16), *range(100, 301)})) - 1
    assert coarse.error == np.abs(history.state[watched, 0]).max()
    assert abs(fine.variance - 1) < 1e-6
    # Of the last steps, each is compared with the one before it, the first of them as well.
    steady = [bool(step) for step in np.abs(np.diff(bias)) < 1e-9]
    for last in (next(k for k in range(1, 300) if steady[-k]), 299):
        (found,) = study.update_stagnation(TILT, Z, 2, [fmt], last=last)
        assert found.unchanged == sum(steady[-last:]) / last


def test_a_companion_where_the_running_bound_says_nothing():
    model, z = examples.precise_tracker(), np.full((20, 1), 1.0)
    assert survey(model, z, 0.01, [40], basis="bound") == ((40, math.inf),)
    found = required_precision(model, z, 0.01, basis="bound")
    last = max(digits for digits, ratio in found.tried if math.isinf(ratio) and digits < found.digits)
    assert last >= 40
    assert found.why == f"in {last} bits the bound says nothing"
    error, bound = study.companion_run(model, z, FloatFormat(2, 40))
    assert (error <= bound).all()
    assert bound[0] < 0.01


def test_a_row_of_the_table_of_guarantees_is_as_stored():
    """Of the filter that is cheapest to repeat, in seconds; only the processor time may differ."""
    case = next(case for case in guarantees.CASES if case.make().name == "Dyer and McReynolds")
    (expected,) = [row for row in guarantees.load() if row.name == "Dyer and McReynolds"]
    assert guarantees.compute(case)._replace(seconds=expected.seconds) == expected


@pytest.mark.parametrize("halvings", [-9, 0, 13])
def test_each_bit_of_a_guarantee_halves_its_bound(halvings):
    case = next(case for case in guarantees.CASES if case.make().name == "a second-order section")
    made = case.make()
    bound = guarantees.case_guarantee(case, made, guarantees.FORMAT).bound  # in 24 bits
    for room, more in ((1.02, 0), (0.98, 1)):
        tolerance = room * bound / 2.0**halvings
        assert guarantees._bits(case, made, "guarantee", tolerance, bound) == str(24 + halvings + more)
    assert guarantees._bits(case, made, "guarantee", bound * 2.0**40, bound) != ""
    assert guarantees._bits(case, made, "guarantee", bound / 2.0**40, bound) == ""


def rescaled(model, sizes):
    """The same filter with states in other units; sizes: old unit / new unit."""
    given = np.array(sizes, dtype=object)
    square = np.multiply.outer(given, given)
    Phi = model.Phi * np.multiply.outer(given, Fraction(1) / given)
    return replace(model, Phi=Phi, H=model.H / given, Q=model.Q * square, x0=model.x0 * given, P0=model.P0 * square)


def test_units_of_powers_of_two_change_nothing():
    fmt, sizes = FloatFormat(2, 15), (4, 1, Fraction(1, 1024))
    for form in WITH_PROGRAM:
        plain = emulate(TILT, Z, fmt, form).state
        other = emulate(rescaled(TILT, sizes), Z, fmt, form).state
        assert np.array_equal(other / np.array(sizes, dtype=float), plain)
    tens = emulate(rescaled(TILT, (1, 1, 1000)), Z, fmt, Form.INNOVATION).state / (1, 1, 1000)
    assert not np.array_equal(tens, emulate(TILT, Z, fmt, Form.INNOVATION).state)


# -- figures ------------------------------------------------------------------------------------------
