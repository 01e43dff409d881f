"""gpbnb.kalman.tables: what the chapter's tables say."""

from __future__ import annotations

from fractions import Fraction

import pytest

from gpbnb.formats import FloatFormat, Rounding
from gpbnb.kalman import tables, theory


def cells(table):
    assert len({len(row) for row in (table.header, *table.body)}) == 1
    return [list(row) for row in table.body]


def test_the_example_by_every_formula():
    rows = cells(tables.example(*theory.EXAMPLE))
    assert [row[0] for row in rows] == list(theory.MENDINGS)
    assert rows[0][1:] == [
        r"$2.5860\times10^{8}$",
        r"$3.867\times10^{-9}$",
        "10",
        r"$4.0775\times10^{14}$",
        r"$2.452\times10^{-15}$",
        "16",
        r"$4.5\times10^{-2}$",
    ]
    assert [(row[3], row[6]) for row in rows] == [("10", "16"), ("10", "16"), ("10", "16"), ("15", "22")]


def test_the_slips():
    rows = {row[0]: row[1:] for row in cells(tables.slips(*theory.EXAMPLE))}
    assert list(rows) == [
        "first coefficient",
        "second coefficient",
        "first beta",
        "first digits",
        "second beta",
        "second digits",
    ]
    assert "84" in rows["first coefficient"][2]
    assert r"\cdot84$" in rows["second coefficient"][2]
    assert rows["first beta"] == [r"$.3775\times10^{-8}$", r"$3.867\times10^{-9}$", "one over the printed coefficient"]
    assert rows["first digits"] == ["$9$", "10", "the printed β is that of 9.12 digits; it needs 10"]
    assert rows["second digits"] == ["$17$", "16", "the printed β is that of 16.81 digits; it needs 17"]


def test_slips_that_are_none_are_not_claimed():
    rows = {row[0]: row[1:] for row in cells(tables.slips(1000, 3, 1))}
    assert rows["second coefficient"][2] == "not found"


def test_what_one_grants():
    rows = cells(tables.goals(*theory.EXAMPLE, Fraction(1), Fraction(6606)))
    assert [row[3:] for row in rows] == [["10", "28"], ["13", "41"], ["16", "49"], ["20", "62"]]
    assert rows[1][1:3] == [r"$1.5\times10^{-4}$", "$1.0$"]


def test_violations():
    rows = cells(tables.violations([FloatFormat(10, 4), FloatFormat(10, 4, Rounding.CHOP)]))
    assert rows[0] == ["4 decimal digits", "first", "333", "0.00222", "125"]
    assert rows[1] == ["4 decimal digits", "second", "333", "222", r"$1.25\times10^{7}$"]
    assert rows[2][0] == "4 decimal digits, chopped"


def test_the_order():
    assert cells(tables.order()) == [
        ["first", "(100) → (99) → (101) → (98)"],
        ["second", "none: (99) waits for (101), and (101) for (99)"],
    ]


@pytest.mark.parametrize(
    ("value", "figures", "text"),
    [(82, 2, r"$8.2\times10^{1}$"), (Fraction(1, 3), 3, r"$3.33\times10^{-1}$"), (1, 2, "$1.0$")],
)
def test_numbers(value, figures, text):
    assert tables.scientific(value, figures) == text
