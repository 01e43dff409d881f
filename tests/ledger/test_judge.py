"""The one judge: which statements hold in a domain, and what a row of data says about them."""

from fractions import Fraction

import numpy as np
import pytest
import sympy as sp

from gpbnb.report.ledger.finding import Verdict
from gpbnb.report.ledger.first_order import matrix
from gpbnb.report.ledger.formula import Link, read
from gpbnb.report.ledger.judge import CheckRow, holds, judge
from gpbnb.report.ledger.judge import read as read_rows
from gpbnb.report.ledger.quantities import BETA
from gpbnb.report.ledger.statements import Statement


def judged(form, *names, mode="bound"):
    return judge(read(form), names, mode)


def test_a_bound_is_right_if_it_holds_and_is_attained():
    assert judged("x <= y", {"x": Fraction(1), "y": Fraction(1)}, {"x": Fraction(1), "y": Fraction(3)}).right
    loose = judged("x <= y", {"x": Fraction(1), "y": Fraction(3)})
    assert loose.holds
    assert not loose.right
    assert judged("x <= y", {"x": Fraction(1), "y": Fraction(3)}, mode="exact").right
    assert str(loose) == "holds in all 1 instances, but the bound is never attained"
    assert judged("x <= y", {"x": Fraction(2), "y": Fraction(1)}).count == "holds in 0 of 1 instances"
    assert not judged("x <= y", {"x": Fraction(0), "y": Fraction(0)}).right
    one, other = matrix([[1, 0]]), matrix([[1, 3]])
    assert judged("x <= y", {"x": one, "y": other}).right  # in one entry
    assert judged("x >= 0", {"x": Fraction(0)}).right


def test_a_statement_must_not_hold_where_the_domain_says_so():
    counter = {"x": Fraction(2), "holds": False}
    assert judged("x < 2", {"x": Fraction(1)}, counter, mode="exact").right
    assert not judged("x <= 2", {"x": Fraction(1)}, counter, mode="exact").right
    assert judged("x == 1; y < 2", {"x": 1, "y": 1}, {"y": 2, "part": 2, "holds": False}, mode="exact").right
    attained_where_it_must_fail = {"x": Fraction(2), "y": Fraction(1), "holds": False}
    assert not judged("x <= y", {"x": Fraction(1), "y": Fraction(3)}, attained_where_it_must_fail).right


def test_nothing_is_right_without_an_instance_or_a_part():
    assert not judged("x == x").right
    assert not judge((), [{"x": 1}]).right


def test_phrases_and_numbers_have_true_values_by_their_labels():
    assert judged("word: so | otherwise", {"word": "so"}).right
    assert judged("word: so | otherwise", {"word": {"so", "thus"}}).right
    assert not judged("word: so | otherwise", {"word": lambda phrase: phrase == "otherwise"}).right
    assert judged("size: 1.24 mm", {"size": Fraction(12349, 10**4)}).right is False
    assert judged("size: 1.24 mm", {"size": Fraction(12400, 10**4)}).right
    with pytest.raises(KeyError):
        judged("word: so | otherwise", {"other": "so"})


def test_differences_of_second_order_count_only_for_exact_statements():
    names = {"x": 1 + BETA + BETA**2, "y": 1 + BETA}
    assert not judged("x == y", names).holds
    assert judged("x == y", names, mode="first order").holds
    assert judged("x ≈ y", names).holds
    assert not judged("x ≈ y", {**names, "y": Fraction(1)}).holds
    assert not judged("x <= y", names).holds
    assert judged("x <= y", names, mode="first order").holds


def test_close_numbers_agree_to_the_printed_digits():
    assert judged("x == 3.14", {"x": np.pi}, mode="close").right
    assert not judged("x == 3.15", {"x": np.pi}, mode="close").right
    assert not judged("x == y", {"x": np.pi, "y": 3.14}, mode="close").right
    assert judged("x ≈ y", {"x": np.pi, "y": 3.14}, mode="close").right


def test_matrices_are_multiplied_and_compared_entry_by_entry():
    a, b = matrix([[1, 2], [3, 4]]), matrix([[0, 1], [1, 0]])
    assert holds(Link(a * b, "==", matrix([[2, 1], [4, 3]])))
    assert not holds(Link(a, "<=", b))
    for symbol in ("<=", "<", ">=", ">", "=="):
        assert not holds(Link(matrix([[0, 2]]), symbol, matrix([[1, 1]])))
    assert not holds(Link(matrix([[1, 2]]), ">", matrix([[1, 1]])))
    assert not holds(Link(matrix([[0, 1]]), "<", matrix([[1, 1]])))
    assert holds(Link(2 * a - a, "==", a + 0 * b))
    assert not holds(Link(a, "==", matrix([[1, 2]])))
    assert not holds(Link(sp.zeros(1, 2), "==", sp.zeros(2, 1)))


def row(**columns):
    return CheckRow({"true": lambda: {"x": Fraction(2)}, "no": False}, **{**EMPTY, **columns})


EMPTY = dict.fromkeys(("domain", "mode", "also", "verdict", "root", "recomputed", "note", "otherwise"), "")
PRINTED = Statement("hung1984.II.x", "hung1984", "II", "1", "x", "equation", "{{1}}", "x == 2")
OTHER = Statement("hung1984.II.x", "hung1984", "II", "1", "x", "equation", "{{1}}", "x == 3")


def test_a_row_is_verified_or_has_its_verdict_with_its_texts_filled_in():
    judgement = row(domain="true()", verdict="misprint", recomputed="${{x}}={x}$, {found}", note="a", otherwise="b")
    right, other = judgement(PRINTED), judgement(OTHER)
    assert (right.verdict, right.recomputed, right.note) == (Verdict.VERIFIED, "${x}=2$, holds in all 1 instances", "a")
    assert (other.verdict, other.note, other.agrees) == (Verdict.MISPRINT, "b", False)
    assert row(domain="true()", verdict="wrong", recomputed="x", note="a")(OTHER).note == "a"


def test_another_condition_must_hold_as_well():
    assert row(domain="true()", also="no", recomputed="x")(PRINTED).verdict is Verdict.WRONG
    assert row(also="no", verdict="answered", recomputed="x", note="here")(PRINTED).verdict is Verdict.OPEN
    assert row(also="not no", verdict="answered", recomputed="x", note="here")(PRINTED).verdict is Verdict.ANSWERED


def test_a_row_without_a_domain_judges_nothing():
    given = row(verdict="given", note="defines {2 + 2}")
    assert given(OTHER).verdict is Verdict.GIVEN
    assert given(OTHER).note == "defines 4"
    assert not given.takes_statement


def test_a_definition_is_given_if_it_holds():
    definition = row(domain="true()", verdict="given", recomputed="x", note="defines x", otherwise="not so")
    assert definition(PRINTED).verdict is Verdict.GIVEN
    assert definition(OTHER).verdict is Verdict.MISPRINT


def test_two_rows_of_a_statement_are_refused(monkeypatch):
    rows = [{"statements": key, **EMPTY} for key in ("*.eq1", "hung1984.II.eq1")]
    monkeypatch.setattr("gpbnb.report.ledger.judge.rows_of", lambda name: iter(rows))
    with pytest.raises(ValueError, match=r"two rows of 'hung1984\.II\.eq1' in topic\.csv; needed one"):
        read_rows("some.topic", {})


@pytest.mark.parametrize("symbol", ["==", "<=", "<", ">=", ">"])
def test_what_has_no_known_sign_does_not_hold(symbol):
    x = sp.Symbol("x", real=True)
    assert not holds(Link(x, symbol, sp.Integer(1)))
    assert not holds(Link(x**2 - x, symbol, sp.Integer(0)))
    assert not holds(Link(sp.I, symbol, sp.Integer(0)))
