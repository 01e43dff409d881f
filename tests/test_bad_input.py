"""Generated bad input: every public function refuses it with one of its documented exceptions, or gives a result."""

from __future__ import annotations

import math
import os
import re
from decimal import Decimal
from fractions import Fraction
from random import Random

import numpy as np
import pytest

from gpbnb import FixedFormat, FloatFormat, LinearModel, LinearSystem, Requirement, Rounding, required_precision
from gpbnb.wordlength.records import survey_records

# GPBNB_EXAMPLES=20000 tries more.
EXAMPLES = int(os.environ.get("GPBNB_EXAMPLES", "100"))
DOCUMENTED = (ValueError, TypeError, OverflowError, ZeroDivisionError)

NUMBERS = (
    (None, False, True),
    (math.nan, math.inf, -math.inf, -0.0, 1e308, 5e-324, 10**400, -1, 0, 1, 2, 3, 0.5),
    ("", "nan", "1_0", "٣", "0.1", "1/0", "x", "1e99999", b"1"),
    (1j, Decimal("NaN"), Decimal("0.1"), Fraction(1, 3), np.float32(2), np.int8(-1), np.datetime64(0, "s")),
    (object(), {}, {1}, lambda: 1, np.bool_(True)),
)
ARRAYS = np.zeros((0, 0)), np.zeros((2, 3)), np.zeros((1, 1, 1, 1)), np.full((2, 2), np.nan), np.eye(2, dtype=complex)
FUNCTIONS = (lambda k: [[1]], lambda k: k, lambda k: None, lambda k: np.eye(k), lambda: 1, int, len)


def number(random):
    return random.choice(random.choice(NUMBERS))


def row(random):
    return [number(random) for _ in range(random.randrange(4))]


def matrix(random):
    """A number, a row, a list of rows, which may have unequal lengths, or an array."""
    rows = [row(random) for _ in range(random.randrange(4))]
    return random.choice([number(random), row(random), rows, random.choice(ARRAYS)])


def tried(names=(None,), value=matrix, share=1):
    """A share of the examples: one of the names each, and a bad value for it."""
    random = Random(20261129)
    for _ in range(EXAMPLES // share):
        yield random.choice(names), value(random)


TRIED = {"accepted": 0, "refused": 0}
GOOD = {"Phi": [["0.5"]], "H": [[1]], "Q": [[1]], "R": [[1]], "x0": [0], "P0": [[1]]}
MODEL = LinearModel(**GOOD)
Z = np.ones((3, 1))


def answer(call, *arguments, **keywords):
    """What a call returns, or None; it may only fail with a documented exception that says what it got or needed."""
    try:
        found, message = call(*arguments, **keywords), None
    except DOCUMENTED as error:
        found, message = None, str(error)
    TRIED["accepted" if message is None else "refused"] += 1
    assert message is None or re.search("got|needed", message), message
    return found


@pytest.fixture(scope="module", autouse=True)
def _count():
    """With GPBNB_EXAMPLES, show how many calls were tried."""
    yield
    if "GPBNB_EXAMPLES" in os.environ:
        print(f"\n{sum(TRIED.values()):,} calls, {TRIED['refused']:,} refused")


def test_models():
    for letter, value in tried(list(GOOD)):
        answer(LinearModel, **(GOOD | {letter: value}))


def test_models_with_inputs():
    """A model with inputs is refused, or its inputs have the shapes of the states and measurements."""
    letters = ["B", "u", "b", "d", "steps", "Phi", "repair"]
    for letter, value in tried(letters, lambda random: random.choice([matrix(random), random.choice(FUNCTIONS)])):
        asked = GOOD | {"B": [[1]], "u": [[1], [2]], "b": [1], "d": [1]} | {letter: value}
        model = answer(LinearModel, **asked)
        if model is not None:
            assert model.steps is None or (type(model.steps) is not bool and model.steps >= 1)
            for k in range(model.steps or 2):
                assert [part.shape for part in model.known(k)] == [(1,), (1,)]


def test_surveys_of_records():
    for name, value in tried(["records", "tolerance", "formats", "form", "basis", "steps", "model"], share=4):
        asked = {"model": MODEL, "records": [Z], "tolerance": 0.1, "formats": [FloatFormat(2, 8)]} | {name: value}
        if name == "model" and isinstance(value, str):  # a path, and OSError is documented
            continue
        found = answer(survey_records, **asked)
        if found is not None:
            assert found.ratios.size
            assert not np.isnan(found.ratios).any()


def test_functions_as_models():
    """Whatever a function returns or gets: no silent result."""
    for place, value in tried(["value", "z", "tolerance"], share=4):
        asked = {"tolerance": 0.1, "z": Z} | ({} if place == "value" else {place: value})

        def run(fmt, *z, place=place, value=value):
            if place == "value":
                return value
            return z[0] * 1 if z else fmt.array([1, 2, 3])

        found = answer(required_precision, run, **asked)
        if found is not None:
            assert place != "value"
            assert found.tried


def test_linear_systems():
    for letter, value in tried(["A", "B", "C", "D", "x0"]):
        answer(LinearSystem, **({"A": [["0.5"]], "B": [[1]]} | {letter: value}))


def test_questions():
    """What is accepted gives an answer whose precisions were tried: no silent result."""
    for name, value in tried(["tolerance", "base", "rounding", "form", "basis", "z", "seed", "within"]):
        asked = {"model": MODEL, "tolerance": 0.1, "z": 3 if name == "seed" else Z} | {name: value}
        found = answer(required_precision, **asked)
        if found is not None:
            assert isinstance(found, Requirement)
            assert found.tried
            assert not isinstance(value, bool) or name not in ("z", "tolerance", "base", "form")
            assert found.format is None or dict(found.tried)[found.digits] <= 1


def test_formats_and_their_arrays():
    for _, (base, precision) in tried(value=lambda random: (number(random), number(random))):
        answer(FloatFormat, base, precision)
        answer(FixedFormat, base, precision)
        answer(FloatFormat(2, 24).round, base)


def test_arrays():
    for _, values in tried():
        answer(FloatFormat(10, 8).array, values)
        answer(FloatFormat(2, 24, Rounding.CHOP).array, values)
