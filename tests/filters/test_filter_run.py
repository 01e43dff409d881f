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
from gpbnb.filters.blocks import BlockFormats
from gpbnb.filters.emulation import emulate
from gpbnb.filters.forms import WITH_PROGRAM, Form
from gpbnb.filters.model import LinearModel
from gpbnb.filters.run import Run
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


# -- runs -----------------------------------------------------------------------------------------


# -- simulated measurements -----------------------------------------------------------------------


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
