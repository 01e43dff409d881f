"""gpbnb.report.ledger.formula: read, evaluate and typeset the machine-readable form of a statement."""

from __future__ import annotations

from fractions import Fraction

import pytest
import sympy as sp

from gpbnb.report.ledger.formula import Link, Number, Relation, Undefined, Words, read


def exact(value):
    return value


def latex(form):
    (part,) = read(form)
    return part.latex()


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


@pytest.mark.parametrize(
    ("form", "typeset"),
    [
        ("x_hat == x*(1+epsilon)", r"\hat x=x\left(1+\epsilon\right)"),
        ("abs(Q_tilde/Q) <= (n+m-1)*beta", r"\left|\frac{\tilde Q}{Q}\right|\le \left(n+m-1\right)\beta"),
        ("lamda_max < Deltaphi_2", r"\lambda_{\text{max}}<\Delta \phi_{2}"),
        ("x == .7654e3 + (-.56e-5)", r"x=.7654\times10^{3}+\left(-.56\times10^{-5}\right)"),
        ("x[i,j] == P[k-1].inv", r"x_{ij}=P_{k-1}^{-1}"),
        ("x[i,k-1] == y[10,2]", r"x_{i,k-1}=y_{10,2}"),
        ("phi_2[k] == x", r"\phi_{2,k}=x"),
        ("R_x_y == z", r"R_{x,y}=z"),
        ("x == 60*degree + y_total", r"x=60^{\circ}+y_{\text{total}}"),
        ("a - (b - c)", r"a-\left(b-c\right)"),
        ("s == Sum(x[j],(j,1,n))", r"s=\sum_{j=1}^{n}x_{j}"),
        (
            "norm(A) == Max(Sum(abs(a[i,j]),(i,1,m)),(j,1,n))",
            r"\left\|A\right\|=\max_{j}\sum_{i=1}^{m}\left|a_{ij}\right|",
        ),
        ("Largest(abs(x[j]/s),(j,1,n))", r"\left|\frac{x_{j}}{s}\right|_{\max}"),
        ("a ≈ b", r"a\approx b"),
        ("s == group(a + b) + c", r"s=\left(a+b\right)+c"),
        ("bracket(C) <= D", r"\left[C\right]\le D"),
        ("x == -2*w*P - (-a*b)", r"x=-2w\,P-\left(-a\,b\right)"),
        ("norm(A) == Max(Sum(abs(a[i,j])))", r"\left\|A\right\|=\max\sum\left|a_{ij}\right|"),
        ("x == pm(digits(d[1], d[2], ...))*b**e", r"x=\left(\pm.d_{1}d_{2}\cdots\right)b^{e}"),
        ("x == y*2*.5", r"x=y\times2\times.5"),
        ("fl(op(x, y))", r"fl\left(x*y\right)"),
        ("mark(2*x, a)*y", r"\underbrace{2x}_{\text{(a)}}y"),
        ("x == cases((u, v < 1), (w, v >= 1))", r"x=\begin{cases}u & \text{if }v<1\\ w & \text{if }v\ge 1\end{cases}"),
        ("M[1]*...*M[n]", r"M_{1}\cdots\,M_{n}"),
    ],
)
def test_a_relation_is_typeset(form, typeset):
    assert latex(form).replace(" ", "") == typeset.replace(" ", "")


def test_numbers_and_words_are_shown_as_printed():
    number, words = read("total: .1250e-3 mas; verb: $a$ grows | shrinks")
    assert number.markdown() == r"$.1250\times10^{-3}\ \text{mas}$"
    assert words.markdown() == "$a$ grows"
    (share,) = read("share: 12.50 %")
    assert share.markdown() == r"$12.50\ \text{\%}$"
