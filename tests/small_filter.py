"""A small filter with every entry different, and a run of it in any format."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from gpbnb.arithmetic.formats import FloatFormat
from gpbnb.arithmetic.rational import exact
from gpbnb.arithmetic.rounding import Rounding
from gpbnb.filters import program
from gpbnb.filters.model import LinearModel
from gpbnb.filters.run import Run
from tests.oracles import EXACT
from tests.plain_filters import Filter, model_of
from tests.plain_program import OPERATIONS

NEAREST, CHOP = Rounding.NEAREST, Rounding.CHOP
FORMATS = (
    FloatFormat(2, 11, NEAREST),
    FloatFormat(2, 24, CHOP),
    FloatFormat(2, 53, NEAREST),
    FloatFormat(10, 4, CHOP),
    FloatFormat(10, 8, NEAREST),
    FloatFormat(10, 12, NEAREST),
    FloatFormat(16, 6, CHOP),
)
STEPS = 6


class Step(NamedTuple):
    x: NDArray[Any]
    gain: NDArray[Any]
    P: NDArray[Any]


def model(**changed):
    """Three states and two measurements, nothing zero, one or the same; H and R are cycles of 2 and 3."""
    return LinearModel(
        **{
            "Phi": [["0.91", "0.3", "-0.07"], ["-0.23", "0.84", "0.11"], ["0.05", "-0.4", "0.77"]],
            "H": [[["1.3", "-0.7", "0.2"], ["0.4", "0.9", "-1.1"]], [["0.6", "0.1", "1.7"], ["-0.3", "1.2", "0.8"]]],
            "Q": [["0.3", "0.1", "0.02"], ["0.1", "0.4", "-0.03"], ["0.02", "-0.03", "0.5"]],
            "R": [
                [["0.7", "0.2"], ["0.2", "0.9"]],
                [["1.1", "-0.3"], ["-0.3", "0.6"]],
                [["0.8", "0.05"], ["0.05", "1.2"]],
            ],
            "x0": ["1.7", "-2.3", "0.6"],
            "P0": [["2.1", "0.3", "-0.4"], ["0.3", "1.9", "0.2"], ["-0.4", "0.2", "1.4"]],
            **changed,
        }
    )


def measurements(steps=STEPS, m=2):
    return np.round(np.random.default_rng(1).standard_normal((steps, m)) * 3, 2)


def run(fmt, form, given=None, z=None):
    given, z = given or model(), measurements() if z is None else z
    found = Run(given, fmt, form, range(1, len(z) + 1))
    found.take(z)
    return found


def exact_steps(given, z):
    """The filter after each step, in fractions, with inputs and offsets, by an oracle without the package."""
    plain, found = Filter(model_of(given), EXACT, "innovation"), []
    for row in exact(z):
        x = plain.step(row.tolist())
        found.append(Step(*(np.array(each, dtype=object) for each in (x, plain.K, plain.P))))
    return found


def named_operations(given):
    """The operations of a linear program as an oracle takes them, with the names of their codes."""
    names = {getattr(program, name): name for name in OPERATIONS}
    return [(names[code], a, b) for code, a, b in given.operations.tolist()]
