"""Generated bad input: every public function refuses it with one of its documented exceptions, or gives a result."""

from __future__ import annotations

import math
import os
from decimal import Decimal
from fractions import Fraction

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from gpbnb import FixedFormat, FloatFormat, LinearModel, LinearSystem, Requirement, Rounding, required_precision
from gpbnb.wordlength.records import survey_records

# GPBNB_EXAMPLES=20000 tries more.
EXAMPLES = int(os.environ.get("GPBNB_EXAMPLES", "100"))
MANY = settings(derandomize=True, deadline=None, database=None, max_examples=EXAMPLES)
SLOW = settings(MANY, max_examples=EXAMPLES // 4)
DOCUMENTED = (ValueError, TypeError, OverflowError, ZeroDivisionError)

numbers = st.one_of(
    st.none(),
    st.booleans(),
    st.sampled_from([math.nan, math.inf, -math.inf, -0.0, 1e308, 5e-324, 10**400, -1, 0, 1, 2, 3, 0.5]),
    st.sampled_from(["", "nan", "1_0", "٣", "0.1", "1/0", "x", "1e99999", b"1"]),
    st.sampled_from(
        [1j, Decimal("NaN"), Decimal("0.1"), Fraction(1, 3), np.float32(2), np.int8(-1), np.datetime64(0, "s")]
    ),
    st.sampled_from([object(), {}, {1}, lambda: 1, np.bool_(True)]),
)
rows = st.lists(numbers, max_size=3)
matrices = st.one_of(
    numbers,
    rows,
    st.lists(rows, max_size=3),
    st.sampled_from(
        [np.zeros((0, 0)), np.zeros((2, 3)), np.zeros((1, 1, 1, 1)), np.full((2, 2), np.nan), np.eye(2, dtype=complex)]
    ),
)
TRIED = {"accepted": 0, "refused": 0}
GOOD = {"Phi": [["0.5"]], "H": [[1]], "Q": [[1]], "R": [[1]], "x0": [0], "P0": [[1]]}
MODEL = LinearModel(**GOOD)
Z = np.ones((3, 1))
functions = st.sampled_from([lambda k: [[1]], lambda k: k, lambda k: None, lambda k: np.eye(k), lambda: 1, int, len])


def accepted(call, *arguments, **keywords):
    """Whether a call gives a result; it may only fail with the documented exceptions, and with a message."""
    message = refusal(lambda: call(*arguments, **keywords))
    assert message != ""
    return message is None


def refusal(call):
    """The message of a documented exception, or None."""
    try:
        call()
    except DOCUMENTED as error:
        TRIED["refused"] += 1
        return str(error)
    TRIED["accepted"] += 1
    return None


@pytest.fixture(scope="module", autouse=True)
def _count():
    """With GPBNB_EXAMPLES, show how many calls were tried."""
    yield
    if "GPBNB_EXAMPLES" in os.environ:
        print(f"\n{sum(TRIED.values()):,} calls, {TRIED['refused']:,} refused")


@MANY
@given(st.sampled_from(list(GOOD)), matrices)
def test_models(letter, value):
    accepted(LinearModel, **(GOOD | {letter: value}))


@MANY
@given(st.sampled_from(["B", "u", "b", "d", "steps", "Phi", "repair"]), st.one_of(matrices, functions))
def test_models_with_inputs(letter, value):
    """A model with inputs is refused, or its inputs have the shapes of the states and measurements."""
    asked = GOOD | {"B": [[1]], "u": [[1], [2]], "b": [1], "d": [1]} | {letter: value}
    found = []
    if accepted(lambda: found.append(LinearModel(**asked))):
        (model,) = found
        assert model.steps is None or (type(model.steps) is not bool and model.steps >= 1)
        for k in range(model.steps or 2):
            assert [part.shape for part in model.known(k)] == [(1,), (1,)]


@SLOW
@given(st.sampled_from(["records", "tolerance", "formats", "form", "basis", "steps", "model"]), matrices)
def test_surveys_of_records(name, value):
    asked = {"model": MODEL, "records": [Z], "tolerance": 0.1, "formats": [FloatFormat(2, 8)]} | {name: value}
    found = []
    if name == "model" and isinstance(value, str):  # a path, and OSError is documented
        return
    if accepted(lambda: found.append(survey_records(**asked))):
        assert found[0].ratios.size
        assert not np.isnan(found[0].ratios).any()


@SLOW
@given(matrices, st.sampled_from(["value", "z", "tolerance", "steps"]))
def test_functions_as_models(value, place):
    """Whatever a function returns or gets: no silent result."""
    asked = {"steps": 3, "tolerance": 0.1, "z": Z} | ({} if place == "value" else {place: value})
    run = (lambda fmt, *z: value) if place == "value" else (lambda fmt, *z: z[0] * 1 if z else fmt.array([1, 2, 3]))
    found = []
    if accepted(lambda: found.append(required_precision(run, **asked))):
        assert place != "value"
        assert found[0].tried


@MANY
@given(st.sampled_from(["A", "B", "C", "D", "x0"]), matrices)
def test_linear_systems(letter, value):
    accepted(LinearSystem, **({"A": [["0.5"]], "B": [[1]]} | {letter: value}))


@MANY
@given(st.sampled_from(["tolerance", "base", "rounding", "form", "basis", "z", "seed", "within"]), matrices)
def test_questions(name, value):
    """What is accepted gives an answer whose precisions were tried: no silent result."""
    asked = {"model": MODEL, "tolerance": 0.1, "z": 3 if name == "seed" else Z} | {name: value}
    found = []
    message = refusal(lambda: found.append(required_precision(**asked)))
    if message is not None:
        assert "needed" in message
        return
    (found,) = found
    assert isinstance(found, Requirement)
    assert found.tried
    assert not isinstance(value, bool) or name not in ("z", "tolerance", "base", "form")
    assert found.format is None or dict(found.tried)[found.digits] <= 1


@MANY
@given(numbers, numbers)
def test_formats_and_their_arrays(base, precision):
    accepted(FloatFormat, base, precision)
    accepted(FixedFormat, base, precision)
    accepted(FloatFormat(2, 24).round, base)


@MANY
@given(matrices)
def test_arrays(values):
    accepted(FloatFormat(10, 8).array, values)
    accepted(FloatFormat(2, 24, Rounding.CHOP).array, values)
