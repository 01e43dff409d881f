"""The filter as processors run it: sums kept in a wider format, compensated updates, and overflow that is named."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from gpbnb.arithmetic import named
from gpbnb.arithmetic.fixed import FixedFormat
from gpbnb.arithmetic.formats import FloatFormat
from gpbnb.arithmetic.rational import exact
from gpbnb.arithmetic.rounding import Rounding
from gpbnb.filters.emulation import emulate
from gpbnb.filters.forms import Form
from gpbnb.filters.model import LinearModel
from gpbnb.filters.run import Run

STEPS = 40


def model(**changes: Any) -> LinearModel:
    parts: dict[str, Any] = {
        "Phi": exact([["1", "0.125"], ["0", "1"]]),
        "H": exact([["1", "0.5"]]),
        "Q": exact([["0.001", "0"], ["0", "0.01"]]),
        "R": exact([["0.25"]]),
        "x0": exact(["1", "0"]),
        "P0": exact([["1", "0"], ["0", "1"]]),
        "name": "two states",
    }
    return LinearModel(**(parts | changes))


MEASURED = np.random.default_rng(3).normal(size=(STEPS, 1)) + 2


def test_compensation_keeps_what_a_step_rounds_away() -> None:
    """A bias that is known well moves by less than half of its last digit a step."""
    still = model(
        Phi=exact([["1", "0"], ["0", "1"]]),
        Q=exact([["0", "0"], ["0", "0"]]),
        P0=exact([["1e-2", "0"], ["0", "1e-2"]]),
    )
    z = np.full((4000, 1), 1.9)
    fmt = FloatFormat(2, 11)
    plain, kept = (
        np.abs(emulate(still, z, fmt, Form.INNOVATION, compensated=each).state[-1]).max() for each in (False, True)
    )
    assert kept < plain / 4


def test_a_run_names_what_overflows() -> None:
    huge = model(P0=exact([["1e5", "0"], ["0", "1"]]), x0=exact(["0", "0"]))
    run = Run(model(Q=exact([["3e4", "0"], ["0", "3e4"]])), named.BINARY16, Form.INNOVATION, ())
    run.take(MEASURED)
    assert run.stopped
    assert run.reason == f"overflow in the predicted covariance at step {run.stopped}"
    run = Run(model(H=exact([["300", "0"]])), named.BINARY16, Form.INNOVATION, ())
    run.take(MEASURED)
    assert run.reason == "overflow in the innovation covariance at step 1"
    run = Run(model(H=exact([["1.9", "0"]])), FixedFormat(1, 14, Rounding.EVEN), Form.INNOVATION, ())
    run.take(MEASURED / 8)
    assert run.reason == "overflow in the innovation covariance at step 1"
    with pytest.raises(OverflowError):
        Run(huge, named.BINARY16, Form.INNOVATION, ())


def test_only_forms_that_add_to_the_estimate_are_compensated() -> None:
    with pytest.raises(ValueError, match="needed the innovation form or Joseph's"):
        Run(model(), named.BINARY32, Form.UD, (), compensated=True)
