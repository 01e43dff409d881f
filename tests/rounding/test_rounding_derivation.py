"""gpbnb.report.rounding.derivation: its errors are those that the documents print, or not."""

from __future__ import annotations

import sympy as sp

from gpbnb.report.rounding import derivation


def test_the_four_term_sum_is_computed_as_printed():
    error, (x1, x2, x3, x4), (e1, e2, e3) = derivation.sum_error(4)
    assert sp.expand(error - (x1 + x2) * (e1 + e2 + e3) - x3 * (e2 + e3) - x4 * e3) == 0


def test_1982_has_no_form_of_the_sum_error():
    """s (ε1 + ε2 + ε3) alone, behind (18) of 1982, is not the error."""
    error, x, eps = derivation.sum_error(4)
    left_out = sp.expand(error - sum(x) * sum(eps))
    assert left_out == sp.expand(-x[2] * eps[0] - x[3] * (eps[0] + eps[1]))


def test_the_three_term_inner_product_is_as_printed_in_1984_and_not_in_1982():
    error, (p1, p2, p3), (e1, e2, e3, e4, e5) = derivation.dot_error(3)
    printed = p1 * (e1 + e3 + e5) + p2 * (e2 + e3 + e5) + p3 * (e4 + e5)
    assert sp.expand(error - printed) == 0
    assert sp.expand(error - printed - p2) != 0


def test_the_error_of_a_product_is_no_multiple_of_the_product():
    leftover = derivation.chain_shortcut()
    assert leftover != 0
    (shared,) = (s for s in leftover.free_symbols if "'" in s.name)
    e1, e2, e3 = sp.symbols("epsilon_1:4")
    # Zero for every a and b only if both products carry the same error.
    assert sp.expand(leftover.subs(shared, e1 + e3).subs(e2, e1)) == 0
    assert sp.expand(leftover.subs(shared, e1 + e3)) != 0
