"""What a filter starts with in a format: the guarantee is for the filter that a user's run computes."""

from __future__ import annotations

from fractions import Fraction
from typing import Any

import numpy as np
import pytest

from gpbnb import FixedFormat, FloatFormat, LinearModel, Rounding
from gpbnb.arithmetic.rational import exact
from gpbnb.bounds.gains import schedule
from gpbnb.bounds.guarantee import limits
from gpbnb.filters.forms import Form
from gpbnb.filters.run import Run

# -- the guarantee is for that filter ---------------------------------------------------------------------------------


def raised_while_factored(**changes: Any) -> LinearModel:
    """Three states whose Q has rank two, and loses its definiteness while nine bits factor it."""
    G = exact([["160/101", "54/89"], ["2/101", "-38/97"], ["-151/89", "25/89"]])
    given = {
        "Phi": exact([[0, 0, 0], [0, "1/8", 0], [0, 0, "1/8"]]),
        "H": exact([["7/4", "-2", "-5/4"]]),
        "Q": G @ G.T,
        "R": exact([["1/4"]]),
        "x0": [0, 0, 0],
        "P0": np.eye(3, dtype=int),
    }
    return LinearModel(**(given | changes))


NINE = FloatFormat(2, 9)
WITHIN = limits(state=[19.6905, 1.21509, 19.40933], innovation=59.8751)


def _drawn(seed: int) -> LinearModel:
    """Singular Q, P0 or both, and R nearly so, in cycles of their own."""
    rng = np.random.default_rng([7, seed])
    n, m = int(rng.integers(2, 4)), int(rng.integers(1, 3))

    def singular(size: int, rank: int) -> Any:
        G = np.array([[Fraction(int(rng.integers(-99, 100)), 97) for _ in range(rank)] for _ in range(size)])
        return G @ G.T

    R = singular(m, m) + exact(np.eye(m) * 2.0**-9)
    return LinearModel(
        Phi=exact(np.round(rng.uniform(-0.5, 0.5, (n, n)) * 64) / 64),
        H=exact(np.round(rng.uniform(-2, 2, (int(rng.integers(1, 3)), m, n)) * 8) / 8),
        Q=np.array([singular(n, n - 1) for _ in range(int(rng.integers(1, 4)))]),
        R=R,
        x0=exact(rng.uniform(-1, 1, n)),
        P0=singular(n, n - 1),
    )


def _raised_models(fmt: FloatFormat | FixedFormat, count: int) -> list[LinearModel]:
    """Models whose variances a format raises while it factors them; other factors would follow from those stored."""
    found: list[LinearModel] = []
    for seed in range(1000):
        model = _drawn(seed)
        run, other = (Run(each, fmt, Form.UD, ()) for each in (model, model.rounded(fmt)))  # type: ignore[arg-type]
        if not np.array_equal(run.letters["UQ"], other.letters["UQ"]) or not np.array_equal(run.P, other.P):
            found.append(model)
        if len(found) == count:
            return found
    raise AssertionError(f"{len(found)} models")


FORMATS = [NINE, FloatFormat(2, 7, Rounding.CHOP), FloatFormat(10, 3, Rounding.UP)]


@pytest.mark.parametrize("fmt", FORMATS, ids=str)
def test_the_coefficients_of_a_guarantee_are_those_of_the_run(fmt: FloatFormat) -> None:
    """For models whose factors are raised in cycles, and in forms without factors."""
    for model in _raised_models(fmt, 2):
        for form in (Form.UD, Form.INNOVATION):
            run = Run(model, fmt, form, range(1, 7))
            run.take(fmt.array(np.zeros((6, model.m))))
            if run.stopped or run.indefinite:
                continue
            given = schedule(model, fmt, form, 40)
            assert np.array_equal(given.packed[:6], run.coefficients())
