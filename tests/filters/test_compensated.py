"""The filter as processors run it: sums kept in a wider format, compensated updates, and overflow that is named."""

from __future__ import annotations

from typing import Any

import numpy as np

from gpbnb.arithmetic.formats import FloatFormat
from gpbnb.arithmetic.rational import exact
from gpbnb.filters.emulation import emulate
from gpbnb.filters.forms import Form
from gpbnb.filters.model import LinearModel


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
