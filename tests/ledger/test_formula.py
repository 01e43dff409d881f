"""gpbnb.report.ledger.formula: read and evaluate the machine-readable form of a statement; the pages typeset each."""

from __future__ import annotations

from fractions import Fraction

import pytest
import sympy as sp

from gpbnb.report.ledger.formula import Link, Number, Relation, Undefined, Words, read


def exact(value):
    return value


def links(form, **names):
    return Relation(form).links(names, exact)


# -- reading --------------------------------------------------------------------------------------


def test_a_form_has_relations_numbers_and_words():
    parts = read("x == 2*y; total: 1.250 mas; ratio: -3/4; verb: grows | shrinks | stays")
    assert parts == (
        Relation("x == 2*y"),
        Number("total", "1.250", "mas"),
        Number("ratio", "-3/4"),
        Words("verb", "grows", ("shrinks", "stays")),
    )
    assert [part.text for part in parts] == [
        "x == 2*y",
        "total: 1.250 mas",
        "ratio: -3/4",
        "verb: grows | shrinks | stays",
    ]
    assert parts[1].value == Fraction("1.25")
    assert parts[2].value == Fraction(-3, 4)
    assert read(" ") == ()


# -- evaluation -----------------------------------------------------------------------------------


def test_a_chain_has_a_link_for_each_comparison():
    assert links("a <= b + 1 < 2*c", a=1, b=2, c=5) == (Link(1, "<=", 3), Link(3, "<", 10))
    assert links("a + b", a=1, b=2) == ()


def test_a_missing_name_is_a_symbol():
    (link,) = Relation("a[i,j](k) == f(x[2]) + 1/2").links({"a": lambda i, j, k: i + j + k})
    assert link.left == sp.Symbol("i") + sp.Symbol("j") + sp.Symbol("k")
    assert link.right == sp.Function("f")(sp.Symbol("x[2]")) + sp.Rational(1, 2)


def test_numbers_keep_their_printed_digits():
    (link,) = links("x == .7654e3 + 0.1", x=0)
    assert link.right == Fraction("765.5")
    assert isinstance(link.right, Fraction)


def test_sums_and_products_may_end_at_a_symbol():
    n = sp.Symbol("n")
    assert sp.expand(Relation("Sum(j,(j,1,n))").value() - n * (n + 1) / 2) == 0
    assert sp.simplify(Relation("Prod(2*j,(j,1,n))").value() - 2**n * sp.factorial(n)) == 0


def test_the_sides_of_a_chain():
    assert [side.text for side in Relation("a == .50e1 ≈ c + d").sides] == ["a", ".50e1", "c + d"]
    assert [side.text for side in Relation("a + b").sides] == ["a + b"]


@pytest.mark.parametrize("form", ["a[4]", "a[1]/0", "b[1]", "norm(a[1])", "-c", "cases((1, a[1] < 0), (2, a[1] < 1))"])
def test_what_does_not_exist_or_fit_has_no_value(form):
    names = {"a": {1: Fraction(3)}, "b": [].__getitem__, "c": sp.Matrix([1]), "norm": len}
    if form == "-c":
        names["c"] = None
    with pytest.raises(Undefined):
        Relation(form).value(names, exact)


@pytest.mark.parametrize(
    ("form", "value"),
    [
        ("1 + 2 + ... + n", 15),
        ("n*x[1] + (n-1)*x[2] + ... + 1*x[n]", 5 * 10 + 4 * 20 + 3 * 30 + 2 * 40 + 50),
        ("[x[1], ..., x[n]]", [10, 20, 30, 40, 50]),
        ("[0, n + 1, ..., 4, 3]", [0, 6, 5, 4, 3]),
        ("[2, ..., 2 + 1]", [2, 3]),
    ],
)
def test_dots_stand_for_the_members_between_their_neighbours(form, value):
    assert Relation(form).value({"n": Fraction(5), "x": lambda i: 10 * i}, Fraction) == value


@pytest.mark.parametrize(
    "form",
    ["a + ... + b", "[x[1], ..., y[5]]", "[1*2, ..., 3*5]", "[..., 2]", "1 - 2 + ... + 5", "[1 + 2, ..., 1 - 2]"],
)
def test_dots_without_a_pattern_have_no_value(form):
    with pytest.raises(Undefined):
        Relation(form).value({"x": lambda i: i, "y": lambda i: i}, Fraction)


# -- typesetting ----------------------------------------------------------------------------------


def test_numbers_and_words_are_shown_as_printed():
    number, words = read("total: .1250e-3 mas; verb: $a$ grows | shrinks")
    assert number.markdown() == r"$.1250\times10^{-3}\ \text{mas}$"
    assert words.markdown() == "$a$ grows"
    (share,) = read("share: 12.50 %")
    assert share.markdown() == r"$12.50\ \text{\%}$"
