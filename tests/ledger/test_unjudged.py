"""Definitions, given data and missing pages: rows of data, whose given values are those that the package uses."""

from fractions import Fraction

import pytest
from alterations import altered

from gpbnb.report.budget.theory import GOAL
from gpbnb.report.inversion import example as inverse
from gpbnb.report.ledger.checks import TOPICS
from gpbnb.report.ledger.checks import kalman as year
from gpbnb.report.ledger.checks.rolling import SIX, TEN
from gpbnb.report.ledger.formula import Number, Undefined, Words
from gpbnb.report.ledger.judge import CheckRow
from gpbnb.report.ledger.statements import statement
from gpbnb.report.rolling.theory import PERIOD

UNJUDGED = {
    key: checks
    for checks in TOPICS.values()
    for key, check in checks.items()
    if isinstance(check, CheckRow) and not check.domain and check.verdict in ("given", "unverifiable")
}
SECTION_12 = {"n": year.N, "m": year.M}
USED = {
    "hung1984.II.s11-4.matrix-a": {"A": inverse.MATRIX},
    "hung1982.III.s11-4.matrix-a": {"A": inverse.MATRIX},
    "hung1984.II.s12.example-sampling": {
        "interval": (year.STEP, "s"),
        "duration": (Fraction(year.YEAR, 365 * 86400), "year"),
    },
    "hung1984.II.s12.example-n-m": SECTION_12,
    "hung1982.III.s12.example-n-m-and-sampling": {"interval": (year.STEP, "s"), **SECTION_12},
    "hung1984.III.s4.sample-1-t": {"T": (PERIOD, "seconds")},
    "hung1984.III.s4.sample-1-places": {"places": SIX.precision},
    "hung1984.III.s4.sample-2-places": {"places": TEN.precision},
    "hung1982.I.design-goal": {"goal": (Fraction(GOAL) / 1000, "arcsecond/year")},
    "hung1982.I.drift-rate": {"drift rate": (Fraction(GOAL) / 1000, "arcsecond/year")},
    "hung1982.II.rss-basis": {"total": (Fraction(GOAL), "milliarcsecond")},
}
"""The values that the package uses for the given data of the examples."""
NOT_USED = {"hung1982.II.nine-groups", "hung1982.II.rss-total"}
"""Numbers of a lost diagram, and the total of a lost table, whose row says what would follow from it."""
IN_WORDS = {"six": 6, "ten": 10}


def printed_values(given):
    """The values that a statement prints, by their names; a quantity with a unit is a pair."""
    values = {}
    for part in given.parts:
        if isinstance(part, Number):
            values[part.label] = (part.value, part.unit)
        elif isinstance(part, Words):
            values[part.label] = IN_WORDS[part.printed]
        else:
            (link,) = part.links({}, Fraction)
            values[str(link.left)] = (link.symbol, link.right)
    return values


def used_values(key):
    """Those that the package uses, in the same form."""
    values = {}
    for name, value in USED[key].items():
        if name == "A":
            values[name] = ("==", [[Fraction(entry) for entry in row] for row in value])
        else:
            values[name] = ("==", value) if name in SECTION_12 else value
    return values


@pytest.mark.parametrize("key", USED)
def test_a_given_value_is_the_one_that_the_package_uses(key):
    assert printed_values(statement(key)) == used_values(key)


@pytest.mark.parametrize("key", USED)
def test_an_altered_given_value_is_another_one(key):
    found = 0
    for name, other in altered(statement(key)):
        try:
            assert printed_values(other) != used_values(key), name
        except (Undefined, ValueError):
            continue
        found += 1
    assert found


def test_each_given_number_is_compared_with_the_package():
    numbers = {key for key in UNJUDGED if statement(key).form and statement(key).kind in ("number", "example", "table")}
    assert numbers == {*USED, *NOT_USED}
