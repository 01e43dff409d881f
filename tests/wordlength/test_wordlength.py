"""gpbnb.wordlength: what the chapter on wordlength measures, shows and tabulates."""

from __future__ import annotations

import math
from dataclasses import replace
from fractions import Fraction

import matplotlib.pyplot as plt
import numpy as np
import pytest

from gpbnb import plotting
from gpbnb.formats import FloatFormat, Rounding
from gpbnb.integration.theory import needed_precision
from gpbnb.inversion.bounds import smallest_precision
from gpbnb.kalman import year
from gpbnb.kalman.experiment import Form, emulate, log_spaced, reference
from gpbnb.kalman.precision import Requirement, required_precision, survey
from gpbnb.kalman.theory import coefficients
from gpbnb.wordlength import examples, figures, study, tables

TILT = examples.tilt()
Z = examples.tilt_measurements(300)
GOAL = (0.01, math.inf, math.inf)
FOUND = Requirement(FloatFormat(2, 17), "emulation", 300, ((16, 2.0), (17, 0.5), (18, 0.4)))
NONE = replace(FOUND, fmt=None)


@pytest.fixture
def ax():
    _, axes = plotting.figure()
    yield axes[0]
    axes[0].figure.canvas.draw()
    plt.close("all")


# -- examples -----------------------------------------------------------------------------------------


def test_the_models_are_what_their_docstrings_say():
    assert (TILT.n, TILT.m) == (3, 2) == (len(examples.TILT_STATES), 2)
    assert math.sqrt(TILT.R[0, 0, 0]) == pytest.approx(0.05, rel=1e-15)
    assert math.sqrt(TILT.R[0, 1, 1]) == 2
    assert examples.tilt("1e-6").Q[0, 2, 2] == Fraction("1e-6")
    assert examples.tracker("1000").x0[0] == 1000
    assert examples.precise().R[0, 0, 0] == Fraction("1e-12")
    for model in (examples.tracker(), examples.precise()):
        t = model.Phi[0, 0, 1]  # between measurements; white noise of the acceleration, 0.1 m²/s³
        assert model.Q[0].tolist() == [[t**3 / 30, t**2 / 20], [t**2 / 20, t / 10]]


def test_measurements_begin_alike_and_are_multiples_of_their_resolution():
    longer = examples.tilt_measurements(5000)
    assert np.array_equal(longer[:300], Z)
    assert np.array_equal(np.rint(longer * 4096), longer * 4096)
    assert not np.array_equal(examples.tilt_measurements(300, seed=1), Z)


def test_normal_numbers_are_those_of_numpy():
    for name, kind in (("binary16", np.float16), ("binary32", np.float32), ("binary64", np.float64)):
        low, high = examples.NORMAL[name]
        info = np.finfo(kind)
        assert 2.0**low == float(info.smallest_normal)
        assert 2.0**high <= float(info.max) < 2 * 2.0**high
        assert examples.STANDARD[name].precision == info.nmant + 1


def test_normal_matrix():
    found = examples.normal_matrix(2, [1, 2, 4])
    assert found.tolist() == [[3, 7, 21], [7, 21, 73], [21, 73, 273]]
    with pytest.raises(ValueError, match="got degree 2 and 2 different times; needed at least 3"):
        examples.normal_matrix(2, [1, 1, 2])
    with pytest.raises(ValueError, match="degree of 0 or more"):
        examples.normal_matrix(-1, [1, 2])


# -- study --------------------------------------------------------------------------------------------


@pytest.mark.parametrize("base", [2, 10])
def test_printed_precision_is_the_least_that_meets_125(base):
    goal, size = Fraction(1, 100), Fraction(40)
    t = study.printed_precision(6000, 3, 2, goal, size, base)
    total = sum(coefficients(6000, 3, 2)) * size
    assert total * FloatFormat(base, t).unit_roundoff <= goal < total * FloatFormat(base, t - 1).unit_roundoff
    assert study.printed_precision(6000, 3, 2, goal, size, base, carried=True) > t


def test_growth_answers_for_the_first_steps():
    model = year.model(year.MODELS[0], 2)
    z = year.simulation(year.MODELS[0]).measurements(12)
    goal = [1] * 4 + [math.inf] * 6
    (found,) = study.growth(model, z, goal, [12], form=Form.UD)
    assert found == required_precision(model, 12, goal, form=Form.UD, z=z)


def test_growth_grows():
    found = study.growth(TILT, Z, GOAL, (10, 300), basis="bound")
    assert [each.steps for each in found] == [10, 300]
    assert found[0].fmt.precision < found[1].fmt.precision
    assert {each.basis for each in found} == {"bound"}


def test_years_needed_against_each_run():
    kind = year.Case(year.MODELS[0], 2, 0, Rounding.NEAREST, Form.REPORT)
    runs = [run for run in year.load() if run.case == kind._replace(precision=run.case.precision)]
    found = dict(study.years_needed(runs, 1.0))
    for run in runs:
        worst = 0.0
        for i, step in enumerate(run.steps.tolist()):
            worst = max(worst, *np.abs(run.drift[i]), *np.abs(run.rate[i]))
            assert (run.case.precision >= found[step]) >= (worst <= 1)
            if run.case.precision == found[step]:
                assert worst <= 1
    assert list(found.values()) == sorted(found.values())
    assert found[year.YEAR] == 32
    with pytest.raises(ValueError, match="got runs of 2 kinds; needed one"):
        study.years_needed([runs[0], replace(runs[0], case=runs[0].case._replace(base=10))], 1.0)


def test_a_run_that_left_the_goal_does_not_come_back():
    (first, *_) = year.load()
    one = first.steps.tolist()[:3]
    drift = np.array([[0.5, 0.0], [0.0, -2.0], [0.5, 0.0]])
    run = replace(first, steps=first.steps[:3], drift=drift, rate=np.zeros((3, 2)))
    assert study.years_needed([run], 1.0) == ((one[0], run.case.precision),)


def test_spans_hold_every_number():
    kept = reference(TILT, Z, log_spaced(300, 16))
    numbers = {"estimate": kept.x, "gain": kept.K, "covariance": kept.P}
    found = {each.name: each for each in study.spans(TILT, Z)}
    for name, values in numbers.items():
        sizes = np.abs(values.astype(float)).ravel()
        sizes = sizes[sizes > 0]
        assert 2.0 ** found[name].least <= sizes.min() < 2 * 2.0 ** found[name].least
        assert 2.0 ** found[name].largest <= sizes.max() < 2 * 2.0 ** found[name].largest
    assert found["model"][1:] == (-34, 8)  # 1e-10 and 400


def test_deafness_is_that_of_the_runs():
    fmt, marks = FloatFormat(2, 12), tuple(range(1, 301))
    (coarse, fine) = study.deafness(TILT, Z, 2, [fmt, FloatFormat(2, 40)], last=200)
    history = emulate(TILT, Z, fmt, Form.USUAL, marks, reference(TILT, Z, marks))
    true = reference(TILT, Z, marks)
    bias = history.state[:, 2] + true.x[:, 2].astype(float)
    assert coarse.still == pytest.approx(np.mean(np.abs(np.diff(bias[-201:])) < 1e-9), abs=1e-12)
    assert coarse.still > 0
    assert fine.still == 0
    assert coarse.variance == pytest.approx(1 + history.covariance[-1, 2, 2] / float(true.P[-1, 2, 2]), rel=1e-12)
    assert coarse.error <= np.abs(history.state[:, 0]).max()
    assert abs(fine.variance - 1) < 1e-6
    assert study.hidden_bits(TILT, Z, 2) == pytest.approx(math.log2(float(true.P[-1, 2, 2]) / 1e-10), rel=1e-12)


def test_largest_estimate():
    kept = reference(TILT, Z, log_spaced(300, 16))
    assert study.largest_estimate(TILT, Z) == max(abs(x) for x in kept.x.ravel())


def test_a_companion_bounds_closely():
    error, bound = study.companion(TILT, Z, FloatFormat(2, 20))
    marks = log_spaced(300, 16)
    history = emulate(TILT, Z, FloatFormat(2, 20), Form.USUAL, marks)
    assert error == pytest.approx(np.abs(history.state).max(axis=0), rel=1e-12)
    assert (error > 0).all()
    assert (error <= bound).all()
    assert (bound <= 1.001 * error).all()


def test_a_companion_where_the_running_bound_says_nothing():
    model, z = examples.precise(), np.full((20, 1), 1.0)
    assert survey(model, z, 0.01, [40], basis="bound") == ((40, math.inf),)
    error, bound = study.companion(model, z, FloatFormat(2, 40))
    assert (error <= bound).all()
    assert bound[0] < 0.01


def test_inverse_knows_its_condition():
    matrix = examples.normal_matrix(2, range(11))
    found = study.inverse("fit", matrix, 1e-3)
    plain = matrix.astype(float)
    assert found.condition == pytest.approx(np.linalg.cond(plain, 1), rel=1e-9)
    scale = 2.0 ** -np.round(np.log2(plain.diagonal()) / 2)
    assert found.scaled == pytest.approx(np.linalg.cond(plain * np.outer(scale, scale), 1), rel=1e-9)
    beta = float(FloatFormat(2, found.expected).unit_roundoff)
    assert found.scaled * beta <= 1e-3 < 2 * found.scaled * beta
    assert found.proved == smallest_precision(matrix, 1e-3, 2).fmt.precision


def test_units_of_powers_of_two_change_nothing():
    fmt, sizes = FloatFormat(2, 15), (4, 1, Fraction(1, 1024))
    for form in Form:
        plain = emulate(TILT, Z, fmt, form).state
        other = emulate(study.in_units(TILT, sizes), Z, fmt, form).state
        assert np.array_equal(other / np.array(sizes, dtype=float), plain)
    tens = emulate(study.in_units(TILT, (1, 1, 1000)), Z, fmt, Form.USUAL).state / (1, 1, 1000)
    assert not np.array_equal(tens, emulate(TILT, Z, fmt, Form.USUAL).state)


def test_units_change_the_estimates_and_nothing_else():
    sizes = (3, Fraction(1, 7), 10)
    plain, other = (reference(model, Z, (300,)) for model in (TILT, study.in_units(TILT, sizes)))
    assert (other.x[0] / sizes).astype(float) == pytest.approx(plain.x[0].astype(float), rel=1e-25, abs=0)
    with pytest.raises(ValueError, match="needed 3 positive numbers"):
        study.in_units(TILT, (1, 2))
    with pytest.raises(ValueError, match="needed 3 positive numbers"):
        study.in_units(TILT, (1, 2, 0))


# -- tables -------------------------------------------------------------------------------------------


def test_answers():
    table = tables.answers({"report": [("a minute", FOUND), ("an hour", NONE)]})
    assert table.header == ("bits by", "a minute", "an hour")
    assert table.body == (("report", "17", "none"),)
    with pytest.raises(ValueError, match="got lines of 2 kinds"):
        tables.answers({"a": [("x", FOUND)], "b": [("y", FOUND)]})


def test_cells():
    deaf = tables.deaf([study.Deafness(FloatFormat(2, 12), 0.5, 0.25, 0.03)], 0.01)
    assert deaf.body == (("12 bits", "0.5", "25 %", "3"),)
    spans = tables.spans([study.Span("gain", -20, 3), study.Span("all", -2000, 2000), study.Span("x", -14, 15)])
    assert [row[-1] for row in spans.body] == ["binary32, binary64", "none", "binary16, binary32, binary64"]
    inverses = tables.inverses([study.Inverse("fit", 123.0, 45.0, 6, 7)])
    assert inverses.body == (("fit", "120", "45", "6", "7"),)


def test_integrator():
    table = tables.integrator(300.0, 1000.0, {"an hour": 3600.0}, FloatFormat(2, 24))
    needed = [str(needed_precision(300.0, 1000.0, 3600.0, 2, rounding)) for rounding in Rounding]
    assert table.body[0][1:3] == tuple(needed)
    best, stall = (float(cell.replace(",", "")) for cell in table.body[0][3:])
    assert best < stall


# -- figures ------------------------------------------------------------------------------------------


def test_survey(ax):
    artists = figures.survey({"UD": [(8, math.inf), (10, 5.0), (12, 0.1)]}, {"UD": [(10, math.inf), (12, 3.0)]}, ax)
    points, line, goal, *rest = artists
    assert points.get_xydata().tolist() == [[10, 5], [12, 0.1]]
    assert line.get_xydata().tolist() == [[12, 3]]
    assert points.get_color() == line.get_color()
    assert list(goal.get_ydata()) == [1, 1]
    assert [text.get_text() for text in rest[1::2]] == ["binary16"]
    assert ax.get_yscale() == "log"


def test_growth(ax):
    points, line, *rest = figures.growth({"run": [(10, 9), (1000, 24)]}, {"bound": [(10, 20), (1000, 60)]}, ax)
    assert points.get_xydata().tolist() == [[10, 9], [1000, 24]]
    assert line.get_xydata().tolist() == [[10, 20], [1000, 60]]
    assert line.get_color() == plotting.BOUND
    assert [text.get_text() for text in rest[1::2]] == ["binary16", "binary32", "binary64"]
    assert ax.get_xscale() == "log"


def test_overview(ax):
    found = {"tilt": {"emulation": 17, "bound": 32}, "gyro": {"theory": 17}}
    artists = figures.overview(found, ax)
    named = {artist.get_label(): artist for artist in artists if artist.get_label() in figures.KINDS}
    assert {name: each.get_xydata().tolist() for name, each in named.items()} == {
        "emulation": [[17, 0]],
        "bound": [[32, 0]],
        "theory": [[17, 1]],
    }
    assert [text.get_text() for text in ax.get_yticklabels()] == ["tilt", "gyro"]
    assert ax.yaxis_inverted()  # the first on top
    with pytest.raises(ValueError, match=r"got the kinds \['guess'\]; needed some of emulation"):
        figures.overview({"tilt": {"guess": 3}}, ax)
