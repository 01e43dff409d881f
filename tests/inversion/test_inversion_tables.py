"""gpbnb.report.inversion.tables: each line says what was computed."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest
from tabulated import by_header

from gpbnb.arithmetic.formats import FloatFormat
from gpbnb.arithmetic.rounding import Rounding
from gpbnb.report.inversion import costs, example, existence, experiment, tables
from gpbnb.report.inversion.experiment import Frozen

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


def search(column, wordlength, detail, norm, relative, *values):
    closest = example.PrintedColumn(
        column, example.Wordlength(wordlength, Rounding.CHOP), detail, norm, relative, values
    )
    return example.Agreements(column, 80, 240, 7, 1, 0.4567, closest)


SEARCHES = (
    search("bound", "t = places", "sizes, (96), A_T", "column sum", False, 0.03706, 7.412e-4, 1.2345e-7),
    search("error", "fixed point", "rounded once", "Frobenius", True, 7.782e-5, 9.06e-7, 4.672e-10),
)


def test_each_column_of_table1_has_a_printed_number_and_the_closest():
    table = tables.table1(SEARCHES)
    assert table.title == "Table 1 as printed and as computed"
    assert by_header(table)[1] == {
        "places after decimal point": "5",
        "By proposed method, printed": r"$3.706\times10^{-4}$",
        "By proposed method, closest reading": r"$7.412\times10^{-4}$",
        "Actual value, printed": r"$4.530\times10^{-7}$",
        "Actual value, closest reading": r"$9.060\times10^{-7}$",
    }


def test_the_closest_reading_is_described():
    table = tables.searches(SEARCHES)
    assert table.title == "2 searches"
    first, second = by_header(table)
    assert first == {
        "column": "By proposed method",
        "readings": "80",
        "numbers that agree in four digits": "7 of 240",
        "expected by chance": "0.46",
        "closest reading": "t = places, chopped; absolute values, product (96), $A_T^{-1}$; column sum, absolute",
        "its numbers / printed numbers": "1, 2, 0.333",
    }
    assert second["closest reading"] == "fixed point, chopped; rounded once; Frobenius, relative"


def test_the_first_exception_of_a_claim_is_described():
    table = tables.claims(
        [example.SectionClaim("one", 9, 5, "signed, chart, A"), example.SectionClaim("other", 8, 8, "")]
    )
    assert table.title == "2 claims"
    assert by_header(table) == [
        {"claim": "one", "holds in": "5 of 9", "first exception": "with signs, norm of (95), $A^{-1}$"},
        {"claim": "other", "holds in": "8 of 8", "first exception": "none"},
    ]


def test_each_printed_error_has_a_column_of_possibilities():
    length = example.Wordlength("t = places", Rounding.CHOP)
    matrix = [[1, 2], [3, 4]]
    relative = [
        existence.Possible(length, "stored", p, "row sum", True, "", w) for p, w in ((3, None), (5, matrix), (8, None))
    ]
    absolute = [
        existence.Possible(length, "given", p, "row sum", False, "", w)
        for p, w in ((3, matrix), (5, matrix), (8, None))
    ]
    table = tables.possibilities([*relative, *absolute])
    assert table.title == "settings that could give the printed errors"
    assert by_header(table) == [
        {
            "wordlength": "t = places, chopped, matrix rounded to this format",
            "norm": "row sum",
            "kind of error": "relative",
            "3 places: 7.782e-5": "no",
            "5 places: 4.530e-7": "yes",
            "8 places: 4.672e-10": "no",
        },
        {
            "wordlength": "t = places",
            "norm": "row sum",
            "kind of error": "absolute",
            "3 places: 7.782e-5": "yes",
            "5 places: 4.530e-7": "yes",
            "8 places: 4.672e-10": "no",
        },
    ]


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
    assert table.body[-1][0] == "t = places, chopped, matrix rounded to this format"
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
        "absent": "1003",
        "violations": str(k),
        "regular": "3000",
        "violations_regular": str(1007 + k),
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
        ("with signs, norm of (95), $A_T^{-1}$", "3,000", "1,007", "33.6%"),
        ("ball", "3,000", "1,008", "33.6%"),
    )
    assert len(table.header) == 4
    assert table.title == "2 bounds"
    assert by_header(table)[1] == {
        "bound": "ball",
        "inverses": "3,000",
        "error above the bound": "1,008",
        "share": "33.6%",
    }


def test_summary():
    table = tables.summary(Frozen({}, ROWS), ("ball",))
    assert table.body == (("ball", "1,003", "1", "0.5", "2", r"$1.500\times10^{9}$"),)
    assert table.header[:3] == ("bound", "gives no bound", "error above the bound")
    assert table.header[3:] == tuple(f"bound / error, {name}" for name in ("smallest", "median", "largest"))
    assert table.title == "1 bounds"


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
    assert table.title == "Sharpness and cost of 1 bounds"


def test_worst():
    one = experiment.trial(FloatFormat(10, 3).array([[-12, -11], [-17, 83]]), True, ("signed, chart, A",), "by hand")
    unpivoted = replace(one, pivot=False, bounds={"a posteriori": 0.0})
    table = tables.worst({"signed, chart, A": one, "a posteriori": unpivoted})
    assert table.title == "2 inversions"
    line, other = table.body
    assert other[:2] == ("residual", "by hand, 2 rows, without pivoting")
    assert by_header(table)[0] == {
        "bound": "with signs, norm of (95), $A^{-1}$",
        "matrix": "by hand, 2 rows, with pivoting",
        "format": "3 decimal digits",
        "condition number": "8",
        "error / bound": "1.18",
    }
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
    assert table.title == "1 worked examples"
    assert table.header == (
        "example",
        "matrix, by rows",
        "computed inverse",
        "error norm",
        "with signs, norm of (95), $A^{-1}$",
        "ball",
    )
