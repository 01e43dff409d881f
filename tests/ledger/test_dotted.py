"""gpbnb.report.ledger.dotted: which matrices a printed matrix with dots can stand for."""

from __future__ import annotations

from fractions import Fraction

import pytest
import sympy as sp

from gpbnb.report.ledger.dotted import DottedMatrix
from gpbnb.report.ledger.formula import Relation, Undefined

UPPER = "[[a[1,1], a[1,2], ..., a[1,n]], [0, a[2,2], ..., a[2,n]], [0, 0, ..., ...], [0, 0, 0, a[n,n]]]"


def triangular(n):
    return sp.Matrix(n, n, lambda i, j: 10 * (i + 1) + j + 1 if i <= j else 0)


def shows(display, matrix):
    """Whether the displayed matrix is a matrix A, whose entries it calls a."""
    n = matrix.rows
    names = {
        "n": n,
        "A": matrix,
        "a": lambda i, j: {(k + 1, m + 1): matrix[k, m] for k in range(n) for m in range(n)}[i, j],
    }
    (link,) = Relation(f"{display} == A").links(names, sp.Rational)
    assert isinstance(link.left, DottedMatrix)
    return link.left == link.right


@pytest.mark.parametrize("n", [3, 4, 5, 7])
def test_a_triangular_matrix_is_shown_for_each_number_of_rows(n):
    assert shows(UPPER, triangular(n))


def test_a_row_without_dots_is_one_row():
    assert not shows("[[a[1,1], ..., a[1,n]], [0, ..., a[n,n]]]", triangular(3))
    assert shows("[[a[1,1], ..., a[1,n]], [0, ..., a[n,n]]]", triangular(2))
    assert not shows(UPPER, triangular(2))


@pytest.mark.parametrize(
    ("printed", "altered"),
    [
        ("a[1,2]", "a[1,3]"),
        ("a[2,n]", "a[3,n]"),
        ("[0, 0, ..., ...]", "[0, 1, ..., ...]"),
        ("[0, 0, 0, a[n,n]]", "[0, 0, 1, a[n,n]]"),
        (", [0, 0, ..., ...]", ""),
    ],
)
def test_one_wrong_cell_is_not_shown(printed, altered):
    assert printed in UPPER
    assert not shows(UPPER.replace(printed, altered), triangular(5))


def test_rows_above_and_below_dots_keep_their_columns():
    """The column between the dots has the diagonal entry of the third row, so it is the third column."""
    rows = (
        "[a[1,1], ..., a[1,{}], ..., a[1,n]]",
        "[..., ..., ..., ..., ...]",
        "[0, ..., a[3,3], ..., a[3,n]]",
        "[..., ..., ..., ..., ...]",
        "[0, ..., 0, ..., a[n,n]]",
    )
    display = f"[{', '.join(rows)}]"
    assert shows(display.format(3), triangular(6))
    assert not shows(display.format(4), triangular(6))


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


def test_dots_are_not_numbers():
    display = DottedMatrix([[1, ...], [..., 1]])
    assert (display * Fraction(1, 2)).cells == [[Fraction(1, 2), ...], [..., Fraction(1, 2)]]
    assert display != 1
    with pytest.raises(Undefined):
        Relation("[[1, ...], [..., 1]]*A").value({"A": sp.eye(2)})
    with pytest.raises(Undefined):
        Relation("[[1, ...], [..., 1]] + 1").value()


def test_rows_of_a_display_have_the_same_length():
    with pytest.raises(Undefined, match="rows of the same length"):
        Relation("[[1, ..., 2], [0, 1]]").value()
