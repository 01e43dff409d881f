"""gpbnb.wordlength.requirement: an answer in words."""

from __future__ import annotations

from dataclasses import replace
from fractions import Fraction

import numpy as np
import pytest

from gpbnb import LinearSystem, required_precision
from gpbnb.arithmetic.formats import FloatFormat
from gpbnb.wordlength.requirement import Requirement, listed

FOUND = Requirement(FloatFormat(10, 9, "chop"), "bound", 60, ((8, 2.0), (9, 0.4567), (10, 0.04)))
NONE = Requirement(None, "emulation", 60, ((52, 3.0), (53, 2.0)))


def test_an_answer_says_its_format_its_error_and_its_basis():
    assert str(FOUND) == "9 decimal digits, chopped: 0.46 of the tolerance, proved for this run of 60 steps"
    assert str(NONE) == "no precision up to 53 bits meets the tolerance in a run of 60 steps"
    ended = replace(NONE, limit="where largest=53 ends the search")
    assert str(ended) == (
        "no precision up to 53 bits, where largest=53 ends the search, meets the tolerance in a run of 60 steps"
    )


def test_the_reason_is_told_where_it_prevented_a_smaller_answer():
    assert str(replace(FOUND, why="it stopped")) == str(FOUND)
    stopped = replace(FOUND, why="it stopped", tried=((8, float("inf")), (9, 0.4567)))
    assert str(stopped) == f"{FOUND}; it stopped"
    assert str(replace(NONE, why="it stopped")) == f"{NONE}; it stopped"


def test_notes_follow_in_the_order_of_their_weight():
    noted = replace(FOUND, irregular=(6, 7), tried=((6, 0.9), (7, 0.9), (8, 2.0), (9, 0.4)))
    noted = replace(noted, repairs=("Q made symmetric",), advice="Joseph meets it")
    assert str(noted).endswith(
        ", proved for this run of 60 steps; 6, 7 decimal digits meet it, but 8 do not; "
        "Q made symmetric; Joseph meets it"
    )
    irregular = replace(NONE, irregular=(50,), tried=((50, 0.5), (51, 2.0), (52, 3.0), (53, float("nan"))))
    assert str(irregular) == (
        "no precision up to 53 bits reliably meets the tolerance in a run of 60 steps; "
        "50 bits meet it, but 51–53 do not"
    )


@pytest.mark.parametrize(
    ("fmt", "tried", "named"),
    [
        (FloatFormat(2, 17), ((17, 0.7), (18, 0.3), (24, 0.01), (53, 0.0)), "17 bits (binary32 is enough): 0.7 of"),
        (FloatFormat(2, 24, "even"), ((24, 1.0), (25, 0.3)), "24 bits, ties to even (binary32 is enough): 1 of"),
        (FloatFormat(2, 17), ((17, 0.7), (18, 0.3), (24, 1.01), (53, 0.1)), "17 bits (binary64 is enough): 0.7 of"),
        (FloatFormat(2, 25), ((24, 0.9), (25, 0.7), (26, 0.3), (53, 0.1)), "25 bits (binary64 is enough): 0.7 of"),
        (FloatFormat(2, 17), ((17, 0.7), (18, 0.3)), "17 bits: 0.7 of"),
        (FloatFormat(2, 17, "chop"), ((17, 0.7), (24, 0.3)), "17 bits, chopped: 0.7 of"),
        (FloatFormat(2, 17, emin=-14, emax=15), ((17, 0.7), (24, 0.3)), "17 bits, exponents -14 to 15: 0.7 of"),
        (FloatFormat(10, 6), ((6, 0.7), (24, 0.3)), "6 decimal digits: 0.7 of"),
    ],
)
def test_a_bound_names_the_processor_format_that_was_tried_and_meets_the_tolerance(fmt, tried, named):
    assert str(Requirement(fmt, "bound", 1, tried)) == f"{named} the tolerance, proved for this run of 1 step"


@pytest.mark.parametrize(
    ("runs", "named"),
    [
        ((("binary32", 0.2),), "17 bits (binary32 is enough): 0.7 of"),
        (
            (("binary32", 1.12), ("binary64", 0.0)),
            "17 bits (binary32 misses the tolerance: 1.1; binary64 is enough): 0.7 of",
        ),
        ((("binary32", float("inf")),), "17 bits (binary32 misses the tolerance: inf): 0.7 of"),
        ((), "17 bits: 0.7 of"),
    ],
)
def test_an_observed_answer_names_what_a_run_in_the_processor_format_gives(runs, named):
    found = Requirement(FloatFormat(2, 17), "emulation", 1, ((17, 0.7), (24, 0.01)), processors=runs)
    assert str(found) == f"{named} the tolerance, observed in 1 step"


@pytest.mark.parametrize("seed", [7, 15, 30])
def test_binary32_is_enough_only_if_the_processor_itself_stays_within_the_tolerance(seed):
    """Inputs with many ties, which binary32 rounds to even and the search away from zero."""
    inputs = np.random.default_rng(seed).integers(-(2**24), 2**24, (60, 1)) / 2**20
    single, exact, largest = np.float32(0), Fraction(0), Fraction(0)
    for u in inputs[:, 0]:
        single = np.float32(0.75) * single + np.float32(u)
        exact = Fraction(3, 4) * exact + Fraction(float(u))
        largest = max(largest, abs(Fraction(float(single)) - exact))
    tolerance = 0.95 * float(largest)
    system = LinearSystem.from_coefficients([1], ["1", "-3/4"], structure="direct form I")
    found = required_precision(system, 60, tolerance, z=inputs)
    assert found.precision <= 24
    assert dict(found.tried)[24] <= 1
    assert found.processors[0] == ("binary32", pytest.approx(float(largest) / tolerance))
    assert found.processor_format == "binary64"
    assert "(binary32 misses the tolerance: 1.1; binary64 is enough)" in str(found)


@pytest.mark.parametrize(
    ("basis", "met", "missed"),
    [
        ("emulation", "observed in 60 steps", "in a run of 60 steps"),
        ("bound", "proved for this run of 60 steps", "by a bound on this run of 60 steps"),
        ("guarantee", "guaranteed for ever", "by a guarantee for ever"),
        ("probable", "as three times the probable error", "by three times the probable error"),
    ],
)
def test_each_basis_says_what_the_answer_rests_on(basis, met, missed):
    assert str(replace(FOUND, basis=basis)) == f"9 decimal digits, chopped: 0.46 of the tolerance, {met}"
    assert str(replace(NONE, basis=basis)) == f"no precision up to 53 bits meets the tolerance {missed}"
    unobserved = replace(NONE, basis=basis, cause="a state is never observed")
    assert str(unobserved) == f"no precision meets the tolerance {missed}: a state is never observed"


@pytest.mark.parametrize(
    ("numbers", "text"), [((), ""), ((2,), "2"), ((2, 3), "2, 3"), ((2, 3, 4), "2–4"), ((2, 5, 6, 7, 9), "2, 5–7, 9")]
)
def test_three_in_a_row_are_a_range(numbers, text):
    assert listed(numbers) == text
