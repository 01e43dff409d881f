"""Filter runs, their errors and bounds: the exact filter, and what ends a run."""

from __future__ import annotations

import math
from fractions import Fraction

import numpy as np
import pytest
from numba.core.runtime import rtsys
from numba.core.runtime._nrt_python import memsys_disable_stats, memsys_enable_stats
from small_filter import STEPS, exact_steps, measurements, model, run

from gpbnb.arithmetic.formats import FloatFormat
from gpbnb.arithmetic.rational import exact
from gpbnb.filters.blocks import BlockFormats
from gpbnb.filters.emulation import compare_runs, emulate
from gpbnb.filters.forms import WITH_PROGRAM, Form
from gpbnb.filters.model import LinearModel
from gpbnb.filters.run import Run, reference
from gpbnb.filters.simulation import Simulation
from gpbnb.report.gravity_probe_b.year import norms

# -- the reference --------------------------------------------------------------------------------


@pytest.mark.parametrize("form", WITH_PROGRAM)
def test_all_forms_are_one_filter(form):
    """In double-double each is the exact filter; in many digits, each comes near."""
    given, z = model(), measurements()
    precise = Run(given, None, form, (STEPS,))
    precise.take(z)
    checkpoints, step = precise.checkpoints(), exact_steps(given, z)[-1]
    for found, true in ((checkpoints.x[0], step.x), (checkpoints.P[0], step.P)):
        assert np.abs(found - true).max() < Fraction(1, 2**85)
    if form is not Form.HUNG_SECOND_GAIN:  # whose own gain is P H' R^-1 as well, but by another rounding
        assert np.abs(checkpoints.K[0] - step.gain).max() < Fraction(1, 2**85)
    history = emulate(given, z, FloatFormat(2, 53), form)
    state, gain, covariance, _ = norms(history)
    assert 0 < state.max() < 1e-14
    assert gain.max() < 1e-14
    assert covariance.max() < 1e-14
    assert history.indefinite is None
    assert history.stopped is None


def test_a_reference_of_the_model_as_given_adds_the_errors_of_storing_it():
    given, z, fmt = model(), measurements(), FloatFormat(10, 4)
    alone = emulate(given, z, fmt, Form.INNOVATION, (STEPS,))
    stored = np.array([[fmt.round(float(v)) for v in row] for row in z], dtype=object)
    both = emulate(given, z, fmt, Form.INNOVATION, (STEPS,), reference(given, z, (STEPS,)))
    step = exact_steps(given.rounded(fmt), stored)[-1]
    assert alone.state[0] == pytest.approx(
        (run(fmt, Form.INNOVATION).checkpoints().x[-1] - step.x).astype(float), rel=1e-12
    )
    step = exact_steps(given, z)[-1]
    assert both.state[0] == pytest.approx(
        (run(fmt, Form.INNOVATION).checkpoints().x[-1] - step.x).astype(float), rel=1e-12
    )


def test_compensation_keeps_what_a_step_rounds_away():
    """A bias that is known well moves by less than half of its last digit a step."""
    still = LinearModel(np.eye(2), [[1, "0.5"]], np.zeros((2, 2)), [["0.25"]], [1, 0], np.eye(2) * Fraction(1, 100))
    z, fmt = np.full((4000, 1), 1.9), FloatFormat(2, 11)
    plain, kept = (np.abs(emulate(still, z, fmt, form).state[-1]).max() for form in (Form.INNOVATION, Form.COMPENSATED))
    assert kept < plain / 4


# -- runs -----------------------------------------------------------------------------------------


@pytest.mark.parametrize("form", [Form.HUNG, Form.UD])
@pytest.mark.parametrize("fmt", [FloatFormat(2, 24), FloatFormat(2, 24, "stochastic"), FloatFormat(10, 8), None])
def test_a_run_in_pieces_is_the_run_in_one(fmt, form):
    given, z = model(), measurements(20)
    whole, parts = run(fmt, form, given, z), Run(given, fmt, form, range(1, 21))
    for piece in (z[:1], z[1:1], z[1:8], z[8:]):
        parts.take(piece)
    assert parts.steps == whole.steps == 20
    for name in ("x", "P", "X", "G", "C", "steps", "saved", "indefinite"):
        assert np.array_equal(getattr(parts, name), getattr(whole, name))


def scalar(r, p=1, h=1, q=0):
    return LinearModel([[1]], [[h]], [[q]], [[r]], [1], [[p]])


def test_a_variance_that_is_lost_is_a_result():
    fmt = FloatFormat(10, 4)
    history = emulate(scalar("1e-6"), np.ones((5, 1)), fmt, Form.HUNG, range(1, 6))
    # 1 + 1e-6 is 1 in four digits, the gain is 1, and nothing is left of 1 - 1.
    assert history.indefinite == 1
    assert history.stopped is None
    assert history.steps.tolist() == [1, 2, 3, 4, 5]
    assert history.covariance[0, 0, 0] == pytest.approx(-1e-6, rel=1e-5)
    assert emulate(scalar("1e-6"), np.ones((5, 1)), fmt, Form.JOSEPH).indefinite is None


def test_a_covariance_that_is_indefinite_in_a_run_is_a_result():
    """Two states that are nearly one, measured precisely, in four digits."""
    given = LinearModel(np.eye(2), [[1, "0.99"]], np.zeros((2, 2)), [["1e-5"]], [0, 0], [[1, "0.97"], ["0.97", 1]])
    found = {form: emulate(given, np.ones((30, 1)), FloatFormat(10, 4), form, range(1, 31)) for form in WITH_PROGRAM}
    assert found[Form.HUNG].indefinite == 5
    assert norms(found[Form.HUNG])[-1].min() < -1
    # Joseph's keeps its variances, and loses the rest by less; the factors keep all.
    assert found[Form.JOSEPH].indefinite is None
    assert -1e-4 < norms(found[Form.JOSEPH])[-1].min() < 0
    assert found[Form.UD].indefinite is None
    assert norms(found[Form.UD])[-1].min() > 0
    assert all(history.steps[-1] == 30 for history in found.values())


def test_a_division_by_zero_ends_a_run_and_is_a_result():
    """In the first step, P comes out as 0; R, whose size one digit does not tell from 0, must hold the rest."""
    given = LinearModel([[1]], [[[1]], [[1]]], [[0]], [[[1]], [["1e-40"]]], [1], [[1]])
    # The second row: P = 0.5 after the first step; S = 0.5 + 1e-40 = 0.5 in a format; K = 1, P = 0.
    history = emulate(given, np.ones((4, 1)), FloatFormat(2, 8), Form.HUNG, range(1, 5))
    assert history.indefinite == 2
    # A negative variance can make S zero: P0 = 1, H'P H + R with one digit.
    run = Run(scalar(1), FloatFormat(2, 8), Form.HUNG, range(1, 5))
    run.P[...] = -1.0
    run.take(np.ones((3, 1)))
    assert run.stopped == 1
    assert run.steps == 0
    before = run.x.copy()
    run.take(np.ones((3, 1)))
    assert run.steps == 0
    assert np.array_equal(run.x, before)
    assert run.checkpoints().steps == ()


def test_a_zero_pivot_ends_a_run_at_its_step():
    """In the second step, both sensors measure the same, and eleven bits cannot hold their noise beside it."""
    one, same = np.eye(2, dtype=int), [[1, 0], [1, 0]]
    given = LinearModel(one, np.array([one, same, one]), one, exact([["1e-6", 0], [0, "1e-6"]]), [0, 0], one)
    found = run(FloatFormat(2, 11), Form.INNOVATION, given, np.ones((4, 2)))
    assert (found.steps, found.stopped) == (1, 2)
    assert found.reason == "a zero pivot in the innovation covariance at step 2"


@pytest.mark.parametrize("form", WITH_PROGRAM)
def test_a_number_beyond_the_backend_ends_a_run_and_is_a_result(form):
    """A state that grows by 1e60 a step, and that nobody sees: its variance would be 1e360 after the third."""
    given = LinearModel([["1e60", 0], [0, 1]], [[0, 1]], np.zeros((2, 2)), [[1]], [1, 1], np.eye(2))
    found = run(FloatFormat(2, 24), form, given, np.ones((9, 1)))
    assert (found.steps, found.stopped) == (2, 3)
    checkpoints = found.checkpoints()
    history = compare_runs(found, reference(given, np.ones((2, 1)), (1, 2)))
    assert history.stopped == 3
    assert history.steps.tolist() == list(checkpoints.steps) == [1, 2]
    # Base 10 has exponents for it.
    assert run(FloatFormat(10, 8), form, given, np.ones((9, 1))).steps == 9


def test_a_run_is_compared_at_its_own_steps_with_a_reference_that_reached_them():
    with pytest.raises(ValueError, match="needed equal steps"):
        compare_runs(run(FloatFormat(2, 24), Form.HUNG), reference(model(), measurements(), (2, 4)))
    huge = LinearModel([["1e200"]], [[1]], [[0]], [[1]], [1], [[1]])
    assert float(reference(huge, np.ones((3, 1)), (3,)).x[0, 0]) == 1


# -- simulated measurements -----------------------------------------------------------------------


def test_measurements_are_those_of_the_model():
    """The filter that knows the model finds its innovations white, with the covariance that it predicts."""
    given = model()
    z = Simulation(given, tuple(given.x0.astype(float)), seed=5, resolution=2.0**-20).measurements(4000)
    x, P = given.x0.astype(float), given.P0.astype(float) * 0 + np.eye(3) * 1e-12
    given, squares, lagged, last = given.to_float(), [], [], None
    for k in range(len(z)):
        Phi, H, Q, R = (given[name][k % len(given[name])] for name in ("Phi", "H", "Q", "R"))
        P = Phi @ P @ Phi.T + Q
        S = H @ P @ H.T + R
        innovation = np.linalg.solve(np.linalg.cholesky(S), z[k] - H @ Phi @ x)
        K = P @ H.T @ np.linalg.inv(S)
        x, P = Phi @ x + K @ (z[k] - H @ Phi @ x), P - K @ H @ P
        squares.append(np.outer(innovation, innovation))
        if last is not None:
            lagged.append(np.outer(innovation, last))
        last = innovation
    # Means of 4000 products of unit normals: variance 2 or 1; five standard errors.
    assert np.abs(np.mean(squares, axis=0) - np.eye(2)).max() < 5 * math.sqrt(2 / 4000)
    assert np.abs(np.mean(lagged, axis=0)).max() < 5 / math.sqrt(3999)


# -- the bound beside a run -----------------------------------------------------------------------


@pytest.mark.parametrize("fmt", [FloatFormat(2, 11), FloatFormat(2, 24, "chop"), FloatFormat(10, 8)], ids=str)
@pytest.mark.parametrize("form", WITH_PROGRAM)
def test_no_error_exceeds_the_bound_beside_the_run(fmt, form):
    """Against the exact filter, not the reference."""
    given, z = model(), measurements()
    found = emulate(given, z, fmt, form, range(1, STEPS + 1), bounded=True)
    ratios = found.ratios()
    assert ratios.max() <= 1
    stored = np.array([[fmt.round(float(v)) for v in row] for row in z], dtype=object)
    checkpoints = run(fmt, form).checkpoints()
    worst = 0.0
    for k, step in enumerate(exact_steps(given.rounded(fmt), stored)):
        P = (checkpoints.P[k] + checkpoints.P[k].T) / 2
        for error, bound in (
            (checkpoints.x[k] - step.x, found.bounds.state[k]),
            (checkpoints.K[k] - step.gain, found.bounds.gain[k]),
            (P - step.P, found.bounds.covariance[k]),
        ):
            assert (np.abs(error).astype(float) <= bound * (1 + 1e-12)).all()
            worst = max(worst, float((np.abs(error).astype(float) / bound).max()))
    if fmt.precision * math.log2(fmt.base) > 20:  # with fewer, the covariance's error may be too large
        assert worst > 0.01
        assert np.isfinite(found.bounds.state).all()
    # The run itself is the one without a bound at its side.
    assert np.array_equal(found.state, emulate(given, z, fmt, form, range(1, STEPS + 1)).state)


def test_the_bound_of_the_reference_holds():
    """Also where the stored model is no double-double number."""
    given, z = model(), measurements(40)
    run = Run(given, None, Form.INNOVATION, range(1, 41), bounded=True)
    run.take(z[:7])
    run.take(z[7:])
    checkpoints = run.checkpoints()
    for k, step in enumerate(exact_steps(given, z)):
        for error, bound in (
            (checkpoints.x[k] - step.x, run.bounds[0][k]),
            (checkpoints.P[k] - step.P, run.bounds[2][k]),
        ):
            ratio = (np.abs(error).astype(float) / bound).max()
            assert ratio <= 1
            assert (bound < 1e-22).all()


def test_a_step_releases_exactly_the_arrays_that_it_makes():
    """Steps count no references to the arrays that they borrow: one too few would release an array in use."""
    fmt, random, eye = FloatFormat(2, 24), FloatFormat(2, 20, "stochastic"), [[1, 0], [0, 1]]
    blocks = BlockFormats.uniform(fmt).with_block("covariance", FloatFormat(2, 40))
    model = LinearModel([["1", "0.1"], ["0", "0.9"]], [["1", "0"]], eye, [["2"]], [0, 0], eye)
    counts = []
    for formats, form in ((fmt, "Joseph"), (fmt, "UD"), (random, "innovation"), (blocks, "UD")):
        run = Run(model, formats, form, (100,))
        run.take(np.ones((60, 1)))
        memsys_enable_stats()
        first = rtsys.get_allocation_stats()
        run.take(np.ones((40, 1)))
        last = rtsys.get_allocation_stats()
        memsys_disable_stats()
        made, released = last.mi_alloc - first.mi_alloc, last.mi_free - first.mi_free
        counts.append(made)
        assert (made - released, last.alloc - first.alloc - (last.free - first.free)) == (0, 0)
    assert max(counts) > 0


def test_the_first_quantity_that_leaves_the_range_stops_a_run():
    """A variance of 1/16 that grows by 4 a step is 2**16 after the tenth."""
    given = LinearModel([["0.5", 0], [0, 2]], [[1, 0]], [[1, 0], [0, 0]], [[1]], [0, 0], [[1, 0], [0, "0.0625"]])
    for k, reason in ((4, "the estimate at step 6"), (12, "the predicted covariance at step 10")):
        z = np.repeat([0.0, 60_000, -60_000], [k, 1, 19 - k])[:, None]
        assert run(FloatFormat(2, 11, "even", -14, 15), Form.INNOVATION, given, z).reason == f"overflow in {reason}"
