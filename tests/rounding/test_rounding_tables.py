"""gpbnb.report.rounding.tables: every number in a cell is that of the trials."""

from __future__ import annotations

from fractions import Fraction

import numpy as np
import pytest
from tabulated import by_header

from gpbnb.arithmetic.formats import FloatFormat
from gpbnb.report.rounding import experiment, tables

TWO = FloatFormat(10, 2)
FOUR = FloatFormat(10, 4)


def test_bound_statistics_have_a_line_a_bound():
    trials = {sort: experiment.sweep(sort, TWO, [3], 2, np.random.default_rng(1)) for sort in ("sum", "dot")}
    table = tables.bound_statistics_table(trials)
    found = [(sort, each) for sort, group in trials.items() for each in experiment.bound_statistics(group)]
    assert len(table.body) == len(found) == 6
    for (sort, each), cells in zip(found, table.body, strict=True):
        assert cells[:4] == (sort, each.bound, str(each.trials), str(each.violations))
        assert (float(cells[4]), float(cells[5])) == (float(f"{each.largest:.3g}"), float(f"{each.median:.3g}"))
    assert len(table.header) == 6
    assert table.title == "6 bounds in random trials"


def test_each_statistic_of_a_bound_has_its_column():
    errors = [Fraction(1), Fraction(1, 7), Fraction(1, 9), Fraction(5), Fraction(1, 8)]
    bounds = {"strict": Fraction(2)}
    trials = [experiment.Trial(TWO, (), TWO.array(1), Fraction(1), error, bounds) for error in errors]
    assert by_header(tables.bound_statistics_table({"sum": trials})) == [
        {
            "computation": "sum",
            "bound": "strict",
            "trials": "5",
            "violations": "1",
            "largest error / bound": "2.5",
            "median error / bound": "0.0714",
        }
    ]


def test_worked_examples_show_operands_and_results():
    trial = experiment.sum_trial(TWO.array(["5.6", "5.9", "-11"]))
    table = tables.worked({"a sum": trial}, ["1982 (18)", "1984 (18)"])
    assert table.title == "1 worked examples"
    assert table.header == (
        "example",
        "operands",
        "format",
        "computed",
        "exact",
        "error / 1982 (18)",
        "error / 1984 (18)",
    )
    name, operands, fmt, computed, exact, *ratios = table.body[0]
    assert (name, operands, fmt) == ("a sum", "5.6, 5.9, -11", "2 decimal digits")
    assert (float(computed), float(exact)) == (1, 0.5)
    assert ratios[0] == "10"
    assert float(ratios[1]) == pytest.approx(trial.ratio("1984 (18)"), rel=5e-4)  # four digits or more


def test_worked_examples_of_matrices_products_and_many_terms():
    chain = experiment.chain_trial([FOUR.array([["1.001", "-1.002"]]), FOUR.array([["1.001"], ["1"]])])
    square = experiment.matrix_sum_trial(FOUR.array([[1, 2], [3, 4]]), FOUR.array([[5, 6], [7, 8]]))
    product = experiment.product_trial(FOUR.array([2, 3]), FOUR.array([]))
    long = experiment.tie_sum(FOUR, 100)
    trials = {"chain": chain, "square": square, "product": product, "long": long}
    rows = {cells[0]: cells for cells in tables.worked(trials, ["(31)", "(24)", "strict"]).body}
    assert rows["chain"][1] == "1.001, -1.002; 1.001; 1"
    assert rows["chain"][4:7] == ("1e-06", "1000", "none")
    assert float(rows["chain"][7]) == pytest.approx(chain.ratio("strict"), rel=5e-4)
    assert rows["square"][4] == "a matrix"
    assert rows["square"][1] == "1, 2; 3, 4; 5, 6; 7, 8"
    assert rows["square"][-1] == "none"
    assert rows["product"][1] == "2, 3"
    assert "…" in rows["long"][1]
    assert len(rows["long"][1]) <= 60
    assert Fraction(rows["long"][4]) == long.true


def test_operands_of_more_than_sixty_characters_are_cut():
    def shown(tens):
        operand = TWO.array([10] * tens + [1] * (20 - tens))
        return tables.worked({"sum": experiment.sum_trial(operand)}, []).body[0][1]

    assert shown(2) == "10, 10, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1"
    assert shown(3) == "10, 10, 10, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1 … , 1, 1, 1, 1"
