"""gpbnb.report.kalman.tables: what the chapter's tables say."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest
from tabulated import by_header

from gpbnb.arithmetic.formats import FloatFormat
from gpbnb.arithmetic.rounding import Rounding
from gpbnb.filters.forms import Form
from gpbnb.report.confidence import interval
from gpbnb.report.display.tables import short
from gpbnb.report.gravity_probe_b import tables as gravity_probe_b_tables
from gpbnb.report.gravity_probe_b import year
from gpbnb.report.gravity_probe_b.answers import Moved
from gpbnb.report.gravity_probe_b.model import gravity_probe_b
from gpbnb.report.gravity_probe_b.threshold import Share
from gpbnb.report.kalman import independent, printed, report_bounds, tables
from gpbnb.wordlength.requirement import Requirement


def cells(table):
    assert len({len(row) for row in (table.header, *table.body)}) == 1
    return [list(row) for row in table.body]


def test_the_states():
    table = gravity_probe_b_tables.states(gravity_probe_b())
    rows = cells(table)
    assert table.title == "10 states"
    assert by_header(table)[8] == {
        "state": "readout bias",
        "unit": "mas",
        "transition per step": "0.999",
        "initial standard deviation": "2.24",
        "random walk per step": "0.1",
    }
    assert rows[2] == ["drift rate 2", "mas/yr", "1", "10000", "0.0001"]
    assert rows[4] == ["pointing α2", "mas", "0.9", "20", "8.72"]
    assert len(rows) == 10


USUAL = year.MODELS[0]


def run(**changes):
    values = {
        "case": year.YearCase(USUAL, 2, 24, Rounding.NEAREST, Form.HUNG),
        "steps": np.array([1, 3]),
        "drift": np.array([[9.0, 9.0], [-2.0, 1.0]]),
        "rate": np.array([[9.0, 9.0], [0.25, -0.5]]),
        "state": np.array([9.0, 2.0]),
        "gain": np.array([9.0, 0.125]),
        "covariance": np.array([9.0, 1e-6]),
        "least_eigenvalue": np.array([9.0, -0.5]),
        "indefinite": None,
        "stopped": None,
        "seconds": 1.0,
    }
    return year.Year(**{**values, **changes})


def test_year_ends():
    table = gravity_probe_b_tables.year_ends([run(), run(indefinite=12345)])
    assert table.header[:4] == ("arithmetic", "form", "error of the drift (mas)", "error of the rate (mas/yr)")
    assert table.title == "errors after a year"
    assert by_header(table)[0] == {
        "arithmetic": "24 bits",
        "form": "Hung (1984)",
        "error of the drift (mas)": "2",
        "error of the rate (mas/yr)": "0.5",
        "relative error of the gain": "0.12",
        "relative error of the covariance": r"$1.0\times10^{-6}$",
        "smallest eigenvalue": "-0.5",
    }
    rows = cells(table)
    assert rows[0] == ["24 bits", "Hung (1984)", "2", "0.5", "0.12", r"$1.0\times10^{-6}$", "-0.5"]
    assert rows[1][-1] == "-0.5; first non-positive variance at step 12,345"
    other = run(case=run().case._replace(model=year.MODELS[1]))
    table = gravity_probe_b_tables.year_ends([run(), other])
    assert table.header[0] == "model"
    assert [row[0] for row in cells(table)] == list(year.MODELS[:2])
    with pytest.raises(ValueError, match="got the reference"):
        gravity_probe_b_tables.year_ends([run(case=run().case.reference)])


def test_slack():
    k, beta = 3, float(FloatFormat(2, 24).unit_roundoff)
    terms = printed.Terms(10, 2, *(np.array([size]) for size in (7.0, 5.0, 2.0, 2.0)))
    zeros = (np.zeros(2), np.zeros(2), np.zeros(2))
    bounds = year.YearBounds(
        run().case.reference, run().steps, np.zeros((2, 2)), np.array([[0, 0], [0, 0.125]]), *zeros
    )
    table = gravity_probe_b_tables.slack([run()], [bounds], terms)
    row = cells(table)[0]
    first, second = report_bounds.coefficients(k, 10, 2)
    assert table.title == "bound over error, 1 years"
    assert table.header == (
        "arithmetic",
        "error of the rate (mas/yr)",
        "(125), as printed",
        "(125), roundings counted once",
        "(125), and errors of either sign",
        "(125), and covariance errors carried on",
        "companion bound",
    )
    assert row[:3] == ["24 bits", "0.5", short(beta * (7 * first + 5 * second) / 0.5)]
    assert row[-1] == "1.25000"
    with pytest.raises(ValueError, match="needed one up to step 3"):
        gravity_probe_b_tables.slack(
            [run(steps=np.array([1, 3]))],
            [year.YearBounds(*[*vars(bounds).values()][:1], np.array([1, 2]), *[*vars(bounds).values()][2:])],
            terms,
        )


def test_requirements():
    answers = [
        ("one", Requirement(FloatFormat(2, 9), "bound", 5, ((8, 2.0), (9, 0.5432)))),
        ("two", Requirement(None, "emulation", 5, ((8, 2.0),))),
    ]
    table = gravity_probe_b_tables.requirements(answers)
    assert table.title == "2 answers"
    assert by_header(table)[0] == {
        "filter": "one",
        "found by": "bound",
        "steps": "5",
        "smallest precision": "9 bits",
        "error or bound / tolerance": "0.54",
    }
    assert cells(table)[1] == ["two", "emulation", "5", "none", ""]


def share(precision, within, records, **changes):
    errors = np.where(np.arange(records) < within, 0.1, 2.0)
    low, high = interval(within, records)
    found = Share("simple", "absolute", "hung", FloatFormat(2, precision), errors, within, low, high, 0.5)
    return found._replace(**changes)


def test_shares():
    """Nine errors of 0.1 and one of 2: the 90 % quantile lies a tenth of the way from the ninth to the last."""
    table = gravity_probe_b_tables.shares([share(32, 9, 10, quantile_limit=0.5432)])
    assert table.title == "records that stay within a milliarcsecond for a year"
    assert by_header(table) == [
        {
            "state": "absolute angles",
            "form": "Hung (1984)",
            "arithmetic": "32 bits",
            "within tolerance": "9 of 10",
            "probability": "0.606 to 0.995",
            "median": "0.1",
            "90 %": "0.29",
            "largest": "2",
            "upper limit for 99 % of records": "0.54",
        }
    ]


def test_needed_precisions():
    found = [share(32, 9, 10), share(33, 300, 300), share(27, 5, 5, states="deviation")]
    chopped = share(36, 1, 30)._replace(fmt=FloatFormat(2, 36, Rounding.CHOP))
    assert cells(gravity_probe_b_tables.needed_precisions([chopped]))[0][2:5] == ["none", "–", "–"]
    table = gravity_probe_b_tables.needed_precisions(found)
    assert table.title == "smallest precision that stays within a milliarcsecond"
    assert by_header(table)[0] == {
        "model and states": "simple, absolute angles",
        "form and rounding": "Hung (1984), rounded to nearest",
        "99 % of the records": "33 bits",
        "passed": "300 of 300",
        "probability": "0.990 to 1.000",
        "99 %, lognormal": "32 bits",
        "99 %, proved with 95 % confidence": "33 bits",
    }
    row = [
        "simple, deviations",
        "Hung (1984), rounded to nearest",
        "27 bits",
        "5 of 5",
        "0.549 to 1.000",
        "27 bits",
        "none",
    ]
    assert cells(table)[1] == row
    decimal = gravity_probe_b_tables.needed_precisions([share(10, 5, 5, fmt=FloatFormat(10, 10))])
    assert cells(decimal)[0][2] == "10 decimal digits"


def test_what_moves_the_answer_is_told_in_words_that_a_reader_knows():
    pairs = [("nearest", "chop"), ("hung", "ud"), ("deviation", "absolute"), ("mission", "known roll phase")]
    table = gravity_probe_b_tables.sensitivity([Moved("choice", *pair, -1.25, 3) for pair in pairs])
    assert [row[1:3] for row in cells(table)] == [
        ["rounded to nearest", "chopped"],
        ["Hung (1984)", "UD"],
        ["deviations", "absolute angles"],
        ["mission", "known roll phase"],
    ]
    assert {row[3] for row in cells(table)} == {"−1.2"}


def test_first_steps_and_shares_by_form():
    first = independent.FirstStep("stable", 100, 25, 0.18, 0.33)
    table = tables.first_steps([first])
    assert table.title == "models that exceed (105) in their first step"
    assert by_header(table) == [
        {"kind": "stable", "models": "100", "models that exceed (105)": "25", "probability": "0.18 to 0.33"}
    ]
    by_model = independent.ModelShare("105", Form.HUNG, 170, 0.845, 0.7997, 0.8904, 159)
    table = tables.shares_by_form([by_model])
    assert table.title == "random models that exceed a bound"
    assert by_header(table) == [
        {
            "form": "Hung (1984)",
            "bound": "(105)",
            "models": "170",
            "mean share of formats": "84 %",
            "95 % interval by model": "80 to 89 %",
        }
    ]


def test_the_parameters_of_the_mission():
    table = gravity_probe_b_tables.parameters()
    assert table.title == "parameters of the mission model"
    assert by_header(table)[7] == {
        "parameter": "right ascension of IM Pegasi",
        "value": "343.259",
        "unit": "deg",
        "source": "star catalogues, J2000",
    }


def test_what_a_bound_costs():
    fmt, k = FloatFormat(2, 24), 3
    terms = printed.Terms(10, 2, *(np.array([size]) for size in (7.0, 5.0, 2.0, 2.0)))
    error, bound = np.zeros((2, 10)), np.full((2, 10), 9.0)
    error[1, 2:4], bound[1, 2:4] = (0.25, -0.5), (1.0, 4.0)
    history = SimpleNamespace(steps=np.array([1, k]), state=error)
    found = SimpleNamespace(history=history, state=bound)
    reference = SimpleNamespace(steps=np.array([1, k]), rate=np.array([[0, 0], [0, 0.125]]))
    first, second = report_bounds.coefficients(k, 10, 2)
    table = gravity_probe_b_tables.bound_costs([(fmt, found)], terms, reference, 8.2)
    rows = cells(table)
    assert table.title == "what a bound costs, after 3 steps"
    assert by_header(table)[1] == {
        "bound": "running bound",
        "processor time": "8 times the run",
        "extra precision": "106 bits, to repeat each step",
        "bound / error, 24 bits": "8",
    }
    beta = float(fmt.unit_roundoff)
    assert rows[0] == ["(125), least $B$", "a formula", "none", f"{beta * (7 * first + 5 * second) / 0.5:.3g}"]
    assert rows[1] == ["running bound", "8 times the run", "106 bits, to repeat each step", "8"]
    assert rows[2] == ["companion bound", "8 times the run", "106 bits, for a second run", "1.25"]
