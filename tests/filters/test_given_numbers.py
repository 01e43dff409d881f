"""Overflow is for results: a number of a filter that its format cannot hold is refused, by name, in every format."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from gpbnb import (
    FixedFormat,
    FixedIntervalSmoother,
    FloatFormat,
    LinearModel,
    LinearSystem,
    write_code,
)
from gpbnb.arithmetic.rounding import Rounding
from gpbnb.filters.emulation import emulate

SHORT = [
    FixedFormat(1, 14, overflow="saturate"),
    FixedFormat(1, 14, "chop", overflow="wrap"),
    FixedFormat(1, 14, "stochastic", overflow="saturate"),
    FloatFormat(2, 8, emin=-6, emax=0, overflow="saturate"),
]
"""Formats of numbers below 2."""

MODEL = {
    "Phi": [[1, "0.1"], [0, 1]],
    "H": [[1, 0]],
    "Q": [["0.01", 0], [0, "0.01"]],
    "R": [["0.5"]],
    "x0": [0, 0],
    "P0": [[1, 0], [0, 1]],
}
Z = np.full((20, 1), 0.1)


def system(largest="-1.5", first=(0, 0)):
    made = LinearSystem.from_coefficients(["0.02", "0.04", "0.02"], [1, largest, "0.64"])
    return replace(made, x0=list(first)) if any(first) else made


@pytest.mark.parametrize("fmt", SHORT, ids=str)
@pytest.mark.parametrize("letter", MODEL)
def test_a_model_beyond_the_range_is_refused_by_its_letter(fmt, letter, tmp_path):
    larger = np.array(MODEL[letter], dtype=object)
    larger[(0,) * larger.ndim] = 4
    model = LinearModel(**{**MODEL, letter: larger})
    if fmt.overflow != "wrap":  # which has no compiled loops
        assert len(emulate(LinearModel(**MODEL), Z, fmt).state)
        for form in ("innovation", "UD", "symmetrized"):
            with pytest.raises(OverflowError, match=rf"^{letter}: "):
                emulate(model, Z, fmt, form)
    if isinstance(fmt, FixedFormat) and fmt.rounding is not Rounding.STOCHASTIC and fmt.overflow != "wrap":
        with pytest.raises(OverflowError, match=rf"^{letter}: "):
            write_code(model, fmt, tmp_path)
    with pytest.raises(OverflowError):
        FixedIntervalSmoother(model, Z).run(fmt)


@pytest.mark.parametrize("fmt", SHORT, ids=str)
def test_a_coefficient_or_a_first_state_of_a_system_is_refused(fmt):
    def run(given):
        return given.outputs(Z, fmt)

    assert len(run(system()))
    with pytest.raises(OverflowError, match="a1"):
        run(system("-2.5"))
    with pytest.raises(OverflowError, match="x0: "):
        run(system(first=(3, 0)))
