"""Filter runs: every digit against a filter on integers that takes nothing from the package."""

from __future__ import annotations

from fractions import Fraction

import numpy as np
import pytest
from small_filter import CHOP, run

from gpbnb.arithmetic.formats import FloatFormat
from gpbnb.filters.forms import Form
from gpbnb.filters.model import LinearModel
from gpbnb.filters.run import Run
from gpbnb.report.gravity_probe_b.model import gravity_probe_b
from gpbnb.report.kalman import smallest
from tests.plain_filters import Filter


def check_each_step(found, slow, z):
    """Compare estimates, gains and covariances of a run and of the independent filter."""
    assert found.steps == len(z)
    ours = [found.exactly(each) for each in (found.X, found.G, found.C)]
    for k, row in enumerate(z):
        slow.step([Fraction(float(v)) for v in row])
        for one, other in zip((each[k] for each in ours), (slow.x, slow.K, slow.P), strict=True):
            assert one.tolist() == other


@pytest.mark.parametrize("second", [False, True])
@pytest.mark.parametrize("fmt", [FloatFormat(10, 4), FloatFormat(2, 6, CHOP)])
def test_the_smallest_filters_come_out_of_the_emulation_too(fmt, second):
    """The chapter's counterexamples were found in exact arithmetic, on rounded Fractions."""
    form = Form.HUNG_SECOND_GAIN if second else Form.HUNG
    for case in (smallest.scalar(fmt), smallest.scalar(fmt, z=1), smallest.correlated()):
        if case.P.shape == (2, 2) and fmt.base == 2:
            continue  # its numbers are decimal
        given = LinearModel(case.Phi, case.H, case.Q, case.R, case.x, case.P)
        checkpoints = run(fmt, form, given, np.array([case.z] * 3, dtype=object)).checkpoints()
        for k in range(3):
            x, K, P = smallest.rounded_step(fmt, case, second)
            case = case._replace(x=x, P=P)
            assert (checkpoints.x[k] == x).all()
            assert (checkpoints.K[k] == K).all()
            assert (checkpoints.P[k] == P).all()


def test_a_year_of_gravity_probe_b_begins_like_the_exact_filter():
    """Three steps of ten states, in every digit: the model of the book, not a small one."""
    fmt = FloatFormat(2, 24)
    given = gravity_probe_b().rounded(FloatFormat(2, 14))
    z = np.array([[12.0, -7.0], [30.0, 4.0], [-5.0, 9.0]])
    check_each_step(run(fmt, Form.HUNG, given, z), Filter.of(given, fmt, Form.HUNG), z)


def test_the_parts_of_a_double_double_are_added_exactly():
    given = LinearModel([[1]], [[1]], [[1]], [[1]], [0], [[1]])
    parts = np.array([[1.5, 2.0**-70], [2.0**-60, -(2.0**-130)], [3.0, 0.0]])
    found = Run(given, None, Form.INNOVATION, ()).exactly(parts)
    assert found.tolist() == [Fraction(3, 2) + Fraction(1, 2**70), Fraction(2**70 - 1, 2**130), 3]
