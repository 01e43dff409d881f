"""Many records through one gain get the digits of single runs, each in its own."""

from __future__ import annotations

import numpy as np

from gpbnb.arithmetic.formats import FloatFormat
from gpbnb.filters.forms import Form
from gpbnb.filters.model import LinearModel
from gpbnb.filters.run import Run
from gpbnb.report.gravity_probe_b import threshold
from gpbnb.report.gravity_probe_b.threshold import FORMS, SimpleYear, YearCell, compute, rows
from gpbnb.report.gravity_probe_b.year import MODELS, model


def test_a_filter_that_stops_leaves_no_numbers():
    """A state that grows by 1e60 a step has a variance of 1e360 after the third."""
    growing = LinearModel([["1e60", 0], [0, 1]], [[0, 1]], np.zeros((2, 2)), [[1]], [1, 1], np.eye(2))
    many, z = Run(growing, FloatFormat(2, 24), Form.HUNG, (), records=2), np.ones((9, 1, 2))
    before, after = many.carry(z[:2], 2), many.carry(z[2:], 2)
    assert np.isfinite(before).all()
    assert np.isnan(after).all()
    assert (many.stopped, many.steps) == (3, 2)
    largest = np.zeros((2, 2))
    threshold.raise_largest(largest, after)
    assert np.isinf(largest).all()


# -- the sweep ------------------------------------------------------------------------------------


SMALL = YearCell("", "deviation", 2, "nearest", "hung", (20, 24), 3, 2)


def test_errors_are_those_of_every_step():
    steps = 5000
    found = compute(SMALL, steps=steps)
    for i, precision in enumerate(SMALL.precisions):
        for j in range(2):
            z = SimpleYear("deviation").simulation(3 + j).measurements(steps)
            estimates = []
            for fmt, form in ((FloatFormat(2, precision), FORMS["hung"]), (FloatFormat(2, 53), Form.INNOVATION)):
                run = Run(model(MODELS[0], 2), fmt, form, range(1, steps + 1))
                run.take(z)
                estimates.append(run.X[:, :4, 0])
            error = np.abs(estimates[0] - estimates[1])
            assert np.array(found["largest"])[i, :, j].tolist() == error.max(axis=0).tolist()
            assert np.abs(found["end"])[i, :, j].tolist() == error[-1].tolist()
    lines = rows(SMALL, found)
    assert [line[:6] for line in lines] == [
        ("deviation", "2", "nearest", "hung", str(t), str(r)) for t in (20, 24) for r in (3, 4)
    ]
    one = found["largest"][1][2][1], found["largest"][1][3][1]
    assert lines[3][7] == f"{max(one):.6g}"
