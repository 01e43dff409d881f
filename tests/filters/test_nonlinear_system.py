"""Systems whose step is a function: runs, searches, and the operations of a step."""

from __future__ import annotations

import numpy as np
import pytest

from gpbnb import (
    BINARY32,
    BINARY64,
)
from tests.step_functions import SYSTEMS, Native

needs = pytest.mark.parametrize


def inputs(system, steps, level=0.25):
    return level * np.random.default_rng(7).uniform(-1, 1, (steps, system.m))


@needs("fmt", [(BINARY32, np.float32), (BINARY64, np.float64)], ids=["binary32", "binary64"])
@needs("system", SYSTEMS, ids=lambda each: each.name)
def test_runs_have_the_digits_of_the_processor(system, fmt):
    fmt, native = fmt[0], Native(fmt[1])
    u = inputs(system, 300)
    found = system.states(fmt, u).to_float()
    x, given = native.array([float(each) for each in system.x0]), native.array(u)
    for k, row in enumerate(given):
        x, y = system.step(native, x, row)
        assert x.dtype == y.dtype == native.dtype
        assert found[k].tolist() == [*x.tolist(), *y.tolist()]
    assert np.ptp(found, axis=0).min() > 0.001
