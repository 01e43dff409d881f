"""gpbnb.inversion.tables: each line says what was computed."""

from __future__ import annotations

import math

import pytest

from gpbnb.arithmetic.formats import FloatFormat
from gpbnb.inversion import costs, example, existence, experiment, tables
from gpbnb.inversion.experiment import Frozen

PRINTED = example.PRINTED["bound"]


def number(value):
    exponent = math.floor(math.log10(value))
    return rf"${float(value) / 10**exponent:.3f}\times10^{{{exponent}}}$"


def test_table1():
    found = [example.search("bound"), example.search("error")]
    table = tables.table1(found)
    assert [line[0] for line in table.body] == ["3", "5", "8"]
    assert [line[1] for line in table.body] == [number(float(value)) for value in PRINTED]
    assert table.body[2][3] == r"$4.672\times10^{-10}$"
    for column, one in ((2, found[0]), (4, found[1])):
        assert [line[column] for line in table.body] == [number(value) for value in one.closest.values]
    assert len(table.header) == 5


def test_searches():
    found = [example.search("bound"), example.search("error")]
    first, second = tables.searches(found).body
    assert first[:3] == ("By proposed method", "800", f"{found[0].agreements} of 2400")
    assert second[:3] == ("Actual value", "240", f"{found[1].agreements} of 720")
    assert first[3] == f"{found[0].expected:.2g}"
    assert first[5] == ", ".join(f"{v / float(p):.3g}" for v, p in zip(found[0].closest.values, PRINTED, strict=True))


def test_claims():
    found = example.claims()
    lines = tables.claims(found).body
    assert [line[1] for line in lines] == [f"{one.holds} of {one.readings}" for one in found]
    assert [line[2] == "none" for line in lines] == [one.holds == one.readings for one in found]


def test_possibilities():
    found = existence.all_possible()
    table = tables.possibilities(found)
    assert len(table.body) == 6 * 4 * 2
    assert table.body[-1][0] == "t = places, chop, matrix rounded to this format"
    answers = [answer for line in table.body for answer in line[3:]]
    assert answers == ["no" if one.witness is None else "yes" for one in found]
    assert table.header[3] == "3 places: 7.782e-5"


ROWS = tuple(
    {
        "family": family,
        "format": fmt,
        "bound": bound,
        "trials": "40",
        "failed": "0",
        "absent": "3",
        "violations": str(k),
        "regular": "30",
        "violations_regular": str(7 + k),
        "smallest": "0.5",
        "median": "2",
        "largest": "1.5e+09",
    }
    for fmt in ("2:24:nearest", "all")
    for family in ("random", "Kahan", "all")
    for k, bound in enumerate(("signed, chart, A_T", "ball"))
)


def test_violations():
    table = tables.violations(Frozen({}, ROWS), ("signed, chart, A_T", "ball"))
    assert table.body == (
        ("with signs, norm of (95), $A_T^{-1}$", "30", "7", "23.3%"),
        ("ball", "30", "8", "26.7%"),
    )
    assert len(table.header) == 4


def test_summary():
    table = tables.summary(Frozen({}, ROWS), ("ball",))
    assert table.body == (("ball", "3", "1", "0.5", "2", r"$1.500\times10^{9}$"),)
    assert table.header[:3] == ("bound", "gives no bound", "error above the bound")
    assert table.header[3:] == tuple(f"bound / error, {name}" for name in ("smallest", "median", "largest"))


def test_prices():
    found = (costs.Price("Higham", (31.62, 1234.5), 2.266, "53 bits"),)
    table = tables.prices(found, (2, 10))
    assert table.header == (
        "bound",
        "bound / error, n = 2",
        "bound / error, n = 10",
        "operations / those of the inverse",
        "digits",
    )
    assert table.body == (("Higham", "31.6", "1230", "2.3", "53 bits"),)


def test_worst():
    one = experiment.trial(FloatFormat(10, 3).array([[-12, -11], [-17, 83]]), True, ("signed, chart, A",), "by hand")
    (line,) = tables.worst({"signed, chart, A": one}).body
    assert line[1:3] == ("by hand, 2 rows, with pivoting", "3 decimal digits")
    assert line[3:] == ("8", f"{float(one.error) / one.bounds['signed, chart, A']:.3g}")
    assert one.condition == pytest.approx(7.95, abs=0.01)


def test_worked():
    fmt = FloatFormat(10, 3)
    one = experiment.trial(fmt.array([[-12, -11], [-17, 83]]), names=("signed, chart, A", "a posteriori"))
    table = tables.worked({"two rows": one}, ("signed, chart, A", "ball"))
    (line,) = table.body
    assert line[:2] == ("two rows", "-12 -11; -17 83")
    assert line[2] == "; ".join(" ".join(str(v) for v in row) for row in one.computed)
    assert line[3:] == (number(one.error), number(one.bounds["signed, chart, A"]), "none")
    assert table.header[4] == "with signs, norm of (95), $A^{-1}$"
