"""gpbnb.filters.nonlinear: runs against plain loops over fractions, digit for digit."""

from __future__ import annotations

from fractions import Fraction

import numpy as np
import pytest

from gpbnb import (
    BINARY32,
    FixedFormat,
    FloatFormat,
    Form,
    LinearModel,
    NonlinearModel,
    required_precision,
)
from gpbnb.filters.nonlinear_run import NonlinearRun, nonlinear_reference, simulated, true_states
from gpbnb.filters.steps import lower_root
from gpbnb.wordlength.records import survey_records
from tests.step_functions import tracked_motion, tracked_sight
from tests.surveying import survey


@pytest.mark.parametrize("form", ["innovation", "Joseph"])
def test_fraction_bits_of_a_linear_filter_are_those_of_its_functions(form):
    Phi, H, noises = [[1, 0.5], [0, 1]], [[1, 0]], ([[0, 0], [0, 0.01]], [[1]], [0, 0], np.eye(2))
    linear = LinearModel(Phi, H, *noises)
    alike = NonlinearModel(lambda x: x.format.array(Phi) @ x, None, lambda x: x.format.array(H) @ x, None, *noises)
    z = np.ma.masked_equal(np.round(simulated(linear, 40, seed=1), 3), 100)
    z[7] = np.ma.masked
    one, other = (
        required_precision(each, z, 0.01, kind="fixed", like=FixedFormat(8, 1), form=form) for each in (linear, alike)
    )
    assert one.format is not None
    assert one.format == other.format
    # Compiled loops limit the search of the linear filter, so the two searches try different numbers of bits.
    bits, tried, others = one.digits, dict(one.tried), dict(other.tried)
    both = tried.keys() & others.keys()
    assert {bits - 1, bits} <= both
    assert [tried[each] for each in both] == [others[each] for each in both]


# -- linear functions -------------------------------------------------------------------------------------------------

PHI, SEEN = [["1", "0.1"], ["-0.1", "0.9"]], [["1", "0.3"], ["0.2", "1"]]
NOISE = {"Q": [[0, 0], [0, "0.01"]], "R": [["0.5", "0.1"], ["0.1", 1]], "x0": [0, 1], "P0": [[1, 0], [0, 1]]}
RECORD = np.random.default_rng(0).standard_normal((60, 2))


def linear():
    return LinearModel(PHI, SEEN, **NOISE)


def by_functions(**options):
    def f(x):
        return x.format.array(PHI) @ x

    def h(x):
        return x.format.array(SEEN) @ x

    return NonlinearModel(f, None, h, None, **NOISE, **options)


def test_the_reference_is_that_of_the_linear_filter():
    difference = (true_states(by_functions(), RECORD) - true_states(linear(), RECORD)).sum(axis=2)
    assert np.abs(difference).max() < 1e-28  # double-double, with 32 digits


def test_the_reference_agrees_with_one_in_more_digits():
    """The same program in 1200 bits, read as fractions: a tenth of the digits are enough to agree to 2**-104."""
    noises = (np.diag([0, 0, 2.0**-10, 2.0**-10]), [["1e-4", 0], [0, "1e-8"]])
    start = ([-2000, 600, 0, -30], np.diag([10**6, 10**6, 100, 100]))
    model = NonlinearModel(tracked_motion, None, tracked_sight, None, *noises, *start, angles=[1])
    z = simulated(model, 8, seed=3)
    run = NonlinearRun(model, FloatFormat(2, 1200), Form.INNOVATION, [8])
    run.take(z[:8])
    found = nonlinear_reference(model, z[:8]).x[-1].to_fractions()
    assert max(abs(a - b) for a, b in zip(run.checkpoints().x[0], found, strict=True)) < Fraction(1, 2**200)


# -- angles, missing measurements, normalization ----------------------------------------------------------------------


def heading(**options):
    def same(x):
        return x

    return NonlinearModel(same, None, same, None, [[0]], [["0.01"]], ["3.1"], [["0.01"]], **options)


def test_an_angle_wraps_across_pi():
    z = [["-3.1"], ["-3.14"], ["3.1"]]
    values = [
        NonlinearRun(heading(**options), FloatFormat(2, 24)).states(z)[0, 0, 0] for options in ({}, {"angles": [0]})
    ]
    # half of the way from 3.1 to -3.1, directly and across pi; binary32 has 7 digits
    assert values == pytest.approx([0, 3.1 + (np.pi - 3.1)], abs=1e-6)
    wrapped = heading(residual=lambda z, y: (z - y + 3) % z.format.array("6.25") - 3)
    assert NonlinearRun(wrapped, FloatFormat(2, 24)).states(z)[0, 0, 0] == pytest.approx(3.125, abs=1e-6)


@pytest.mark.parametrize("turns", [-3, -1, 0, 1, 2])
def test_whole_turns_make_no_difference(turns):
    fmt = FloatFormat(2, 60)
    model, y = heading(angles=[0]), fmt.array([2.5])
    turn = 2 * np.arctan2(fmt.array(0), fmt.array(-1))
    assert float(model.difference(y + turns * turn, y * 0)[0].to_float()) == pytest.approx(2.5, abs=1e-14)  # 60 bits


@pytest.mark.parametrize("options", [{}, {"method": "unscented"}])
def test_a_missing_measurement_changes_nothing(options):
    z = RECORD[:3].copy()
    z[1] = np.nan
    model, filled = by_functions(**options).without_missing(z)
    run = NonlinearRun(model, FloatFormat(2, 30), Form.INNOVATION, [2])
    run.take(filled)
    assert not run.checkpoints().K[0].any()
    z[1, 0] = 1
    model, filled = by_functions(**options).without_missing(z)
    run = NonlinearRun(model, FloatFormat(2, 30), Form.INNOVATION, [2])
    run.take(filled)
    assert run.checkpoints().K[0][:, 0].all()
    assert not run.checkpoints().K[0][:, 1].any()


@pytest.mark.parametrize(
    ("part", "reason"),
    [
        (lambda x: x[0] * 0 + np.sqrt(-1 - x[0] * x[0]), "the square root of a negative number"),
        (lambda x: np.log(x[0] * 0 - 1), "an argument outside the domain of a function"),
        (lambda x: x[0] / (x[0] - x[0]), "a division by zero"),
        (lambda x: (x[0] * x[0] + 2) ** 1000 * (x[0] * x[0] + 2) ** 1000, "overflow"),
    ],
)
def test_a_run_that_ends_says_why(part, reason):
    for fmt in (BINARY32, FloatFormat(10, 7, emin=-30, emax=30)):
        model = NonlinearModel(
            lambda x: np.stack([part(x), x[1]]), lambda x: [[1, 0], [0, 1]], lambda x: x, None, **NOISE
        )
        run = NonlinearRun(model, fmt)
        run.take(RECORD)
        assert (run.stopped, run.steps) == (1, 0)
        assert reason in run.reason


def test_a_model_is_described_by_its_sizes_and_those_of_its_numbers_that_are_not_zero():
    assert repr(by_functions(iterations=2, steps=9)).splitlines() == [
        "NonlinearModel 'a nonlinear model', extended, iterated 2 times, 2 states; 2 measurements; at most 9 steps",
        "  Q 0.01, R 0.1 … 1",
        "  x0 1, P0 1",
    ]


def test_a_zero_pivot_of_a_root_gives_a_zero_column():
    """The second pivot is 1 - 1, although 3 - 1 remains below it."""
    for fmt in (FloatFormat(2, 24), FloatFormat(10, 5)):
        root = lower_root(fmt.array([[4, 2, 2], [2, 1, 3], [2, 3, 5]]))
        assert root.tolist() == [[2, 0, 0], [1, 0, 0], [1, 0, 2]]


def test_new_estimates_are_normalized():
    def unit(x):
        return x / np.linalg.norm(x)

    run = NonlinearRun(by_functions(normalize=unit), FloatFormat(2, 40))
    sizes = np.sqrt((run.states(RECORD)[:, :, 0] ** 2).sum(axis=1))
    assert np.abs(sizes - 1).max() < 2**-38  # a few units in the last place


# -- questions --------------------------------------------------------------------------------------------------------


def test_a_search_a_survey_and_records_answer_for_a_nonlinear_filter():
    model = by_functions()
    found = required_precision(model, RECORD[:20], 0.01)
    assert found.digits == required_precision(linear(), RECORD[:20], 0.01).digits
    ratios = dict(survey(model, RECORD[:20], 0.01, [found.digits - 1, found.digits, 70]))
    assert ratios[found.digits] <= 1 < ratios[found.digits - 1]
    assert ratios[70] < 2**-50
    formats = [FloatFormat(2, found.digits - 1), FloatFormat(2, 30)]
    assert survey_records(model, [RECORD[:20], RECORD[20:40]], 0.01, formats).shares[1] == 1
    blocks = required_precision(model, RECORD[:20], 0.01, kind="blocks")
    assert blocks.digits <= found.digits
    assert blocks.alone == required_precision(linear(), RECORD[:20], 0.01, kind="blocks").alone


def test_exact_numbers_may_stand_in_lists():
    """A Jacobian of constants, or of constants beside functions of the state, is the one with arrays of the format."""

    def moved(x):
        return [x[0] + x[1] / 8, x[1]]

    def seen(x):
        return [np.arctan2(x[0], 10)]

    def rows(x):
        return [[10 / (x[0] * x[0] + 100), 0]]

    given = {**NOISE, "R": [[1]]}
    record = RECORD[:, :1]
    found = [
        NonlinearRun(NonlinearModel(moved, F, seen, rows, **given), FloatFormat(2, 24)).states(record).tolist()
        for F in (lambda x: [[1, 0.125], [0, 1]], lambda x: x.format.array([[1, "1/8"], [0, 1]]))
    ]
    assert found[0] == found[1]
    inexact = NonlinearModel(moved, lambda x: [[1, 0.1], [0, 1]], seen, rows, **given)
    with pytest.raises(ValueError, match=r"got the operand 0\.1; needed a number that .* holds exactly"):
        NonlinearRun(inexact, FloatFormat(2, 24)).states(record)
