"""gpbnb.report.ledger.formula and dotted: what no stored verdict or page evaluates."""

from __future__ import annotations

from fractions import Fraction

import pytest
import sympy as sp

from gpbnb.report.ledger.dotted import DottedMatrix
from gpbnb.report.ledger.formula import Relation, Undefined


def test_sums_and_products_may_end_at_a_symbol():
    n = sp.Symbol("n")
    assert sp.expand(Relation("Sum(j,(j,1,n))").value() - n * (n + 1) / 2) == 0
    assert sp.simplify(Relation("Prod(2*j,(j,1,n))").value() - 2**n * sp.factorial(n)) == 0


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


# -- matrices with dots -------------------------------------------------------------------------------


def triangular(n):
    return sp.Matrix(n, n, lambda i, j: 10 * (i + 1) + j + 1 if i <= j else 0)


def test_comparisons_hold_entry_by_entry():
    larger = triangular(4) + sp.ones(4, 4)
    display = DottedMatrix([[11, ..., 14], [..., ..., ...], [0, ..., 44]])
    assert display <= triangular(4)
    assert display <= larger
    assert display >= triangular(4)
    assert not display >= larger
    assert not display <= triangular(4) - sp.ones(4, 4)


def test_a_column_can_have_dots():
    (link,) = Relation("b == [[n], [n - 1], [...], [1]]*epsilon").links(
        {"b": sp.Matrix([5, 4, 3, 2, 1]) / 10, "n": 5, "epsilon": sp.Rational(1, 10)}, sp.Rational
    )
    assert link.right == link.left
    assert -link.right == -link.left
    assert 3 * link.right == 3 * link.left
    assert link.right * 3 != link.left


def test_rows_of_a_display_have_the_same_length():
    with pytest.raises(Undefined, match="rows of the same length"):
        Relation("[[1, ..., 2], [0, 1]]").value()
