"""gpbnb.wordlength: what the chapter on wordlength measures, shows and tabulates."""

from __future__ import annotations

import math

import numpy as np
import pytest

from gpbnb import required_precision
from gpbnb.arithmetic.formats import FloatFormat
from gpbnb.report import examples
from gpbnb.report.guarantees import table as guarantees
from gpbnb.report.wordlengths import study
from tests.surveying import survey

# -- examples -----------------------------------------------------------------------------------------


# -- study --------------------------------------------------------------------------------------------


def test_a_companion_where_the_running_bound_says_nothing():
    model, z = examples.precise_tracker(), np.full((20, 1), 1.0)
    assert survey(model, z, 0.01, [40], basis="bound") == ((40, math.inf),)
    found = required_precision(model, z, 0.01, basis="bound")
    last = max(digits for digits, ratio in found.tried if math.isinf(ratio) and digits < found.digits)
    assert last >= 40
    assert found.why == f"in {last} bits the bound says nothing"
    error, bound = study.companion_run(model, z, FloatFormat(2, 40))
    assert (error <= bound).all()
    assert bound[0] < 0.01


def test_a_row_of_the_table_of_guarantees_is_as_stored():
    """Of the filter that is cheapest to repeat, in seconds; only the processor time may differ."""
    case = next(case for case in guarantees.CASES if case.make().name == "Dyer and McReynolds")
    (expected,) = [row for row in guarantees.load() if row.name == "Dyer and McReynolds"]
    assert guarantees.compute(case)._replace(seconds=expected.seconds) == expected


@pytest.mark.parametrize("halvings", [-9, 0, 13])
def test_each_bit_of_a_guarantee_halves_its_bound(halvings):
    case = next(case for case in guarantees.CASES if case.make().name == "a second-order section")
    made = case.make()
    bound = guarantees.case_guarantee(case, made, guarantees.FORMAT).bound  # in 24 bits
    for room, more in ((1.02, 0), (0.98, 1)):
        tolerance = room * bound / 2.0**halvings
        assert guarantees._bits(case, made, "guarantee", tolerance, bound) == str(24 + halvings + more)
    assert guarantees._bits(case, made, "guarantee", bound * 2.0**40, bound) != ""
    assert guarantees._bits(case, made, "guarantee", bound / 2.0**40, bound) == ""


# -- figures ------------------------------------------------------------------------------------------
