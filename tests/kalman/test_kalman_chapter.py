"""The step that the chapter writes out has every digit of the oracle, and its random steps are counted rightly."""

from __future__ import annotations

import json
from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from printed_ratios import ratios
from small_filter import CHOP

from gpbnb.arithmetic.formats import FloatFormat
from gpbnb.arithmetic.rational import exact
from gpbnb.report.kalman import smallest

BOOK = Path(__file__).resolve().parents[2] / "book"


def run(code: str, old: str = "", new: str = "") -> dict[str, Any]:
    """Run the cell of the chapter that contains some code, with a change, after the cell that defines the step."""
    cells = json.loads((BOOK / "kalman.ipynb").read_text(encoding="utf-8"))["cells"]
    sources = ["".join(cell["source"]) for cell in cells if cell["cell_type"] == "code"]
    (source,) = (each for each in sources if code in each)
    assert old in source
    found: dict[str, Any] = {}
    exec(sources[0], found)
    exec(source.replace(old, new), found)
    return found


@pytest.fixture(scope="module")
def chapter() -> dict[str, Any]:
    return run("def compare")


@pytest.mark.parametrize("second", [False, True])
@pytest.mark.parametrize("fmt", [FloatFormat(10, 4), FloatFormat(2, 6, CHOP)], ids=str)
def test_a_step_has_the_digits_of_the_oracle(chapter, fmt, second):
    rng = np.random.default_rng(1)
    cases = [smallest.scalar(fmt), smallest.scalar(fmt, r="1/2", h="3/2", z=2), smallest.correlated()]
    for n in (1, 2, 3):
        Phi, H, x = (exact(rng.integers(-9, 10, shape)) / 8 for shape in ((n, n), (1, n), n))
        P = exact(np.diag(rng.integers(1, 9, n)))
        cases.append(smallest.FilterCase(Phi, H, P / 4, exact([["1/4"]]), x, P, exact([1])))
    for case in cases:
        model = case.Phi, case.H, case.Q, case.R
        fl = np.vectorize(fmt.round, otypes=[object])
        x, K, P = chapter["step"](case.x[:, None], case.P, case.z[:, None], model, fl, second)
        expected = smallest.rounded_step(fmt, case, second)
        for found, wanted in zip((x[:, 0], K, P), expected, strict=True):
            assert found.tolist() == wanted.tolist()


@pytest.mark.parametrize("second", [False, True])
@pytest.mark.parametrize("z", [0, 1])
def test_the_table_has_the_ratios_of_the_oracle(chapter, second, z):
    four = FloatFormat(10, 4)
    *found, sigmas = chapter["compare"](four, "1e-5", second, exact([[z]]))
    assert found == pytest.approx(list(ratios(four, smallest.scalar(four, z=z), second)), rel=1e-12)
    if second and not z:
        assert sigmas == pytest.approx(float(1 / (1 + Fraction(1, 10**5))) / float(Fraction(1, 100_001)) ** 0.5)


def test_random_steps_are_counted_as_exact_ratios_say():
    found = run("def before_gain", "200_000", "400")
    Phi, H, x, z, P, Q, R = (exact(each.to_fractions()) for each in found["numbers"])
    assert min([*P, *Q, *R]) > 0
    covariance, state = [], []
    for i in range(400):
        entries = ([[Phi[i]]], [[H[i]]], [[Q[i]]], [[R[i]]], [x[i]], [[P[i]]], [z[i]])
        found_ratios = ratios(found["fmt"], smallest.FilterCase(*map(exact, entries)))
        covariance.append(found_ratios.covariance > 1)
        state.append(found_ratios.state > 1)
    assert found["wrong_P"].tolist() == covariance
    assert found["wrong_x"].tolist() == state
    assert any(covariance)
    assert any(state)
