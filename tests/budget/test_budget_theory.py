"""gpbnb.report.budget.theory: sums, shares, factors of averaging, and the file that holds a budget."""

from __future__ import annotations

import csv
import math
from dataclasses import replace
from fractions import Fraction

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from gpbnb.report.budget import theory
from gpbnb.report.budget.theory import Budget, ErrorForm, Kind, Source

SEEDED = settings(derandomize=True, deadline=None, database=None)

HEADER = "name,kind,form,error_mas,roll,orbit,filter,group,note"
GOOD = "a,random constant,bias,0.30,0.5,,,,"

words = st.text(st.characters(codec="utf-8", exclude_categories=("C",)), min_size=1).map(str.strip).filter(bool)
sizes = st.floats(-1e6, 1e6)
factors = st.floats(0, 1)
sources = st.builds(
    Source,
    words,
    st.sampled_from(Kind),
    st.sampled_from(ErrorForm),
    sizes,
    factors,
    factors,
    factors,
    st.sampled_from(["", "g", "h"]),
    st.sampled_from(["", 'a "note", with comma']),
)
budgets = st.lists(sources, max_size=8, unique_by=lambda source: source.name).map(tuple).map(Budget)


def made(*errors, group=""):
    return Budget(
        tuple(Source(f"s{k}", Kind.CONSTANT, ErrorForm.BIAS, error, group=group) for k, error in enumerate(errors))
    )


# -- sums -----------------------------------------------------------------------------------------


def test_independent_sources_add_up_as_squares_and_a_group_with_signs():
    assert made(3, 4).total == 5
    assert made(3, 4, group="g").total == 7
    assert made(3, -4, group="g").total == 1
    assert made(3, -4).worst_case == made(3, -4, group="g").worst_case == 7
    mixed = Budget((*made(3, 1, group="g").sources, Source("c", Kind.PROCESS, ErrorForm.NOISE, 6, filter=0.5)))
    assert mixed.total == 5
    assert [len(group) for group in mixed.groups()] == [2, 1]


@settings(SEEDED)
@given(budgets)
def test_total_against_exact_sums(budget):
    square = Fraction(0)
    for group in {source.group or source.name + "\0" for source in budget.sources}:
        inside = [s for s in budget.sources if (s.group or s.name + "\0") == group]
        square += sum((Fraction(s.residual) for s in inside), Fraction(0)) ** 2
    if square > Fraction(10) ** -200:
        # correctly rounded sums and hypot: a few ulps
        assert abs(Fraction(budget.total) ** 2 / square - 1) < Fraction(1, 10**14)
    assert budget.total <= budget.worst_case * (1 + 1e-15)


@settings(SEEDED)
@given(budgets)
def test_shares_add_up_to_one(budget):
    shares = [budget.share(source) for source in budget.sources]
    largest = max((abs(source.residual) for source in budget.sources), default=0)
    if budget.total > 1e-3 * largest > 1e-100:
        # a group that cancels to a thousandth has shares of a million, each with a rounding
        assert math.isclose(math.fsum(shares), 1, abs_tol=1e-9)
    if budget.total == 0:
        assert not any(shares)


def test_allowance_fills_the_goal():
    budget = made(0.6)
    assert budget.allowance() == pytest.approx(0.8)
    assert theory.root_sum_square((budget.total, budget.allowance(2.5))) == pytest.approx(2.5)
    assert math.isnan(made(1.253).allowance())
    assert made(1.0).allowance() == 0.0


def test_the_printed_example():
    assert theory.equal_error(1, 44) == pytest.approx(44**-0.5, rel=1e-15)
    assert theory.root_sum_square([0.15] * 44) < 1 < theory.root_sum_square([0.16] * 44)


# -- averages -------------------------------------------------------------------------------------


@settings(SEEDED)
@given(st.integers(1, 10**7))
def test_whole_cycles_leave_nothing(cycles):
    assert theory.cycles_factor(cycles) == 0


@settings(SEEDED)
@given(st.floats(0.01, 1e4))
def test_cycles_factor_is_that_of_sinc(cycles):
    # numpy's sinc takes the sine of a large number: its error is an ulp of that number
    assert theory.cycles_factor(cycles) == pytest.approx(abs(np.sinc(cycles)), rel=1e-12, abs=1e-15)
    assert theory.cycles_factor(cycles) <= min(1, 1 / (math.pi * cycles)) * (1 + 1e-15)
    assert theory.cycles_factor(0) == 1


@pytest.mark.parametrize("h", [1e-12, 1e-5, 0.1, 0.49, 0.5, 2.0, 40.0, 1e6])
def test_correlated_factor_against_many_digits(h):
    mpmath = pytest.importorskip("mpmath")
    with mpmath.workdps(60):
        x = mpmath.mpf(h)
        exact = mpmath.sqrt(2 * (x - 1 + mpmath.exp(-x))) / x
    # expm1 cancels to a fifth at worst
    assert theory.correlated_factor(h, 1.0) == pytest.approx(float(exact), rel=4e-15)


def test_what_chapter_ii_foresees():
    assert theory.foreseen(Kind.DETERMINISTIC, ErrorForm.DRIFT) == set()
    assert theory.foreseen(Kind.CONSTANT, ErrorForm.BIAS) == {"roll", "orbit"}
    assert theory.foreseen(Kind.CONSTANT, ErrorForm.SCALE_FACTOR) == {"roll", "orbit", "filter"}
    assert theory.foreseen(Kind.DETERMINISTIC, ErrorForm.NOISE) == {"filter"}
    source = Source("a", Kind.DETERMINISTIC, ErrorForm.BIAS, 1, roll=0.5, filter=0.5)
    assert source.unforeseen == ("filter",)
    assert replace(source, filter=1.0).unforeseen == ()


# -- files ----------------------------------------------------------------------------------------


@settings(SEEDED)
@given(budgets)
def test_what_is_written_is_read_again(budget):
    found = theory.parse(theory.to_csv(budget.sources))
    assert found.refused == ()
    assert found.budget == budget


def test_files(tmp_path):
    path = tmp_path / "budget.csv"
    budget = made(0.1, 1 / 3, -2e-17)
    before = theory.to_csv(budget.sources).encode()
    path.write_bytes(before)
    assert theory.read(path).budget == budget
    path.write_bytes(b"\xef\xbb\xbf" + before)
    assert theory.read(path).budget == budget
    path.write_bytes(before + "é".encode("latin-1"))
    with pytest.raises(ValueError, match=r"budget\.csv is not UTF-8"):
        theory.read(path)
    with pytest.raises(FileNotFoundError):
        theory.read(tmp_path / "none.csv")


@pytest.mark.parametrize(
    ("row", "reason"),
    [
        ("b,random constant,bias,TBD,,,,,", "error_mas is 'TBD'; enter a number"),
        ("b,random constant,bias,,,,,,", "error_mas is ''"),
        ("b,random constant,bias,?,,,,,", "error_mas is '?'"),
        ("b,random constant,bias,nan,,,,,", "got error nan; needed a finite number"),
        ("b,random constant,bias,1,x,,,,", "roll is 'x'; enter a number"),
        ("b,random constant,bias,1,,1.5,,,", "got orbit 1.5; needed a factor from 0"),
        ("b,random constant,bias,1,,,-0.1,,", "got filter -0.1; needed a factor from 0"),
        ("b,random constant,bias,1,nan,,,,", "got roll nan; needed a factor"),
        ("b,random,bias,1,,,,,", "kind is 'random'; needed one of deterministic, random constant, random process"),
        ("b,random constant,biased,1,,,,,", "form is 'biased'; needed one of bias, drift"),
        (",random constant,bias,1,,,,,", "got name ''; needed a text without"),
        ("b,random constant,bias,1", "got 4 cells; needed 9"),
        ("b,random constant,bias,1,,,,,,more", "got 10 cells; needed 9"),
        ("a,random constant,bias,1,,,,,", "name 'a' is already used in line 2"),
    ],
)
def test_a_bad_row_is_refused_by_line_and_the_rest_is_read(row, reason):
    alone = theory.parse(f"{HEADER}\n{GOOD}\nc,random process,noise,2,,,,,\n").budget
    reading = theory.parse(f"{HEADER}\n{GOOD}\n\n{row}\nc,random process,noise,2,,,,,\n")
    assert reading.budget == alone
    (refused,) = reading.refused
    assert refused.line == 4
    assert reason in refused.reason
    assert list(refused.cells) == row.split(",")


@pytest.mark.parametrize("text", ["=1+1", "+mast", "-mast", "@mast", "'=1", "''-x", "'mast", "mast'"])
def test_formulas_are_escaped_and_read_back(text):
    source = Source(text, Kind.CONSTANT, ErrorForm.BIAS, -1.0, group=text, note=text)
    written = theory.to_csv([source])
    assert theory.parse(written).budget.sources == (source,)
    cells = next(csv.reader(written.splitlines()[1:]))
    assert not any(cell.startswith(("=", "+", "@")) for cell in cells)
    assert sum(cell.startswith("-") for cell in cells) == 1  # the error, a number
