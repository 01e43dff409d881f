"""gpbnb.wordlength.requirement: an answer in words."""

from __future__ import annotations

from dataclasses import replace
from fractions import Fraction

import numpy as np
import pytest

from gpbnb import BINARY32, LinearModel, LinearSystem, guarantee, limits, required_precision
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
    ("ratios", "named"),
    [
        ((("binary32", 0.2),), "17 bits (binary32 is enough): 0.7 of"),
        (
            (("binary32", 1.12), ("binary64", 0.0)),
            "17 bits (binary32 is not proved to meet the tolerance: 1.1; binary64 is enough): 0.7 of",
        ),
        ((), "17 bits: 0.7 of"),
    ],
)
def test_a_bound_names_what_is_proved_in_the_processor_format(ratios, named):
    found = Requirement(FloatFormat(2, 17), "bound", 1, ((17, 0.7), (24, 0.01)), processors=ratios)
    assert str(found) == f"{named} the tolerance, proved for this run of 1 step"


def float32_run_of_a_hostile_record():
    """A filter in NumPy's float32, whose measurements make its errors large: errors, measurements, and exact sizes."""
    f, rng = np.float32, np.random.default_rng(1)
    phi, h, q, r, p = FAST
    Phi, H, Q, R, P, x = map(f, (phi, h, q, r, p, 0))
    exact_x, worst, sizes, record = Fraction(0), 0.0, [0.0, 0.0], []
    for _ in range(60):
        V = (Phi * P) * Phi + Q
        K = V * H * (f(1) / (H * (V * H) + R))
        P = (f(1) - K * H) * V
        variance = phi * p * phi + q
        gain = variance * h / (h * variance * h + r)
        p = Fraction(round((1 - gain * h) * variance * 2**200), 2**200)
        outcomes, predicted = [], Phi * x
        for size in (1, -1, 0.999, -0.999, *rng.uniform(-1, 1, 60)):
            z = f(float(h * phi * exact_x) + size)
            innovation = Fraction(float(z)) - h * phi * exact_x
            after = Fraction(round((phi * exact_x + gain * innovation) * 2**200), 2**200)
            computed = predicted + K * (z - H * predicted)
            if abs(innovation) <= 1 and abs(after) <= Fraction(62, 100):
                outcomes.append((Fraction(float(computed)) - after, computed, after, innovation, z))
        error, x, exact_x, innovation, z = max(outcomes, key=lambda each: each[0])
        record.append([float(z)])
        worst, sizes = max(worst, abs(float(error))), [max(sizes[0], abs(exact_x)), max(sizes[1], abs(innovation))]
    return worst, record, sizes


FAST = Fraction(3, 2), Fraction(7, 4), Fraction(49, 65536), Fraction(1, 32), Fraction(15, 4)
FAST_FILTER = LinearModel(*([[each]] for each in FAST[:4]), [0], [[FAST[4]]])


def test_what_is_said_of_binary32_holds_for_numpys_float32():
    """In 24 bits with ties away from zero, this gain has a smaller error than in binary32, whose ties go to even."""
    error, record, (state, innovation) = float32_run_of_a_hostile_record()
    within = limits(1, 1, state=1, innovation=1)
    assert state <= 1
    assert innovation <= 1
    for given, tolerance in ({"basis": "guarantee", "within": within}, 2.6e-6), ({"basis": "bound", "z": record}, 8e-6):
        assert error > tolerance
        found = required_precision(FAST_FILTER, 60, tolerance, **given)
        assert dict(found.tried)[24] <= 1
        assert found.processor_format == "binary64"
    (_, proved), _ = required_precision(FAST_FILTER, 60, 2.6e-6, basis="guarantee", within=within).processors
    assert proved == guarantee(FAST_FILTER, BINARY32, within, horizon=1).bound[0] / 2.6e-6


def test_a_bound_in_binary32_knows_its_range():
    """In 24 bits with any exponent, a gain of 2**-150 is one; in binary32, it is zero."""
    tiny = LinearSystem([[0]], [[2.0**-90]], [[2.0**-60]], [[0]])
    found = required_precision(tiny, 10, 2.0**-160, basis="bound", z=np.ones((10, 1)))
    (name, ratio), *_ = found.processors
    assert name == "binary32"
    assert ratio > 1
    assert found.processor_format == "binary64"


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
