"""An answer in words."""

from __future__ import annotations

import math

import numpy as np
import pytest

from gpbnb import (
    FloatFormat,
    LinearModel,
    LinearSystem,
    limits,
    required_precision,
)
from gpbnb.wordlength.answer import judgement, share_text
from gpbnb.wordlength.judges import Judge

WALK = LinearModel([["0.9"]], [[1]], [["0.01"]], [[1]], [0], [[1]])


def test_a_judgement_is_a_sentence():
    for basis, ratio, ends, text in [
        ("emulation", 0.25, False, "10 bits meet the tolerance: 0.25 of it, observed in 1 step"),
        ("bound", 2, False, "nothing is proved for 10 bits: the bound on this run of 1 step is 2 times the tolerance"),
        ("guarantee", math.inf, True, "nothing is proved for 10 bits, without a guarantee for 1 step: lost"),
    ]:
        assert str(judgement(FloatFormat(2, 10), basis, 1, ratio, "lost", ends)) == text


def test_an_error_of_the_whole_tolerance_is_within_it():
    assert (share_text(1.0), share_text(1.01)) == ("1 of the tolerance", "1.01 times the tolerance")


@pytest.mark.parametrize(("error", "what"), [(1e300, "an error over its tolerance"), (np.inf, "an output or a bound")])
def test_what_is_beyond_float64_is_named(error, what):
    judge = Judge(lambda fmt: np.zeros(2), tolerances=np.array([1e-300, 1]))
    assert judge.outcome(np.array([error, 1])).why == f"{what} is beyond the range of float64"


@pytest.mark.parametrize(("z", "leaves"), [([0.5, 0.5, 5], ""), ([0.5, 7, 0.5], "step 2: innovation 0 is 6.")])
def test_a_guarantee_says_that_the_given_run_leaves_its_limits(z, leaves):
    found = required_precision(WALK, z, 0.05, basis="guarantee", within=limits(state=9, innovation=5))
    assert found.met
    assert ("leaves the limits" in str(found)) is bool(leaves)
    assert leaves in str(found)
    system = LinearSystem([["0.9"]], [["0.1"]])
    proved = required_precision(system, np.array(z), 0.05, basis="guarantee", within=limits(measurement=5))
    assert ("input 0 reaches 7, above 5" in str(proved)) is bool(leaves)
    assert ("leaves the limits" in str(proved)) is bool(leaves)
