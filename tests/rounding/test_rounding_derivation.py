"""gpbnb.report.rounding.derivation: every step holds, for general n, and means what the numbers do."""

from __future__ import annotations

import pytest
import steps
import sympy as sp

from gpbnb.report.rounding import derivation

NAMES = {
    "one_rounding": {
        "(8): bound (5) divided by the smallest $|x|$ of (6)": "b**(1 - t)/2",
        "(13): the same for chopping": "b**(1 - t)",
        "(14): chopping doubles the unit roundoff, in any base": "2",
        r"sharper than (8): an error of $b^{e-t}/2$ needs $|x| \ge b^{e-1} + b^{e-t}/2$": (
            "b**(1 - t)/(2 + b**(1 - t))"
        ),
    },
    "sums": {
        "four terms, as printed before (18)": (
            "(x_1 + x_2 + x_3 + x_4)*(epsilon_1 + epsilon_2 + epsilon_3) - x_3*epsilon_1 - x_4*(epsilon_1 + epsilon_2)"
        ),
        "weight of $x_1$: one more term, one more rounding": "n",
        r"weight of $x_j$, $j\ge2$: the same": "n + 2 - j",
        "weight of the new term $x_{n+1}$": "1",
        "(18), first inequality: the difference between the weight of $x_j$ and $n-1$": "j - 2",
        "(18), second inequality: the sum of the weights": "(n - 1)*(n - 2)/2",
    },
    "dots": {
        "three products, as printed before (26)": (
            "a_1*b_1*(epsilon_1 + epsilon_3 + epsilon_5) + a_2*b_2*(epsilon_2 + epsilon_3 + epsilon_5) + "
            "a_3*b_3*(epsilon_4 + epsilon_5)"
        ),
        r"(26), weight of $a_j b_j$, $j \ge 2$: the weight in a sum, plus one": "n + 2 - j",
        "no weight is above $n$, written with $j = k + 1$": "n + 1 - k",
    },
    "chains": {
        r"(32): the error $\beta s$, $s = d_1 + \dots + d_{i-1}$, becomes $\beta(s + d_i)$ to first order": (
            "beta*(s + d) + beta**2*s*d"
        ),
    },
}
"""What each step derives, beside its name; see `steps.check`."""


@pytest.mark.parametrize("name", NAMES)
def test_each_step_holds_and_is_named_for_what_it_derives(name):
    steps.check(getattr(derivation, name), NAMES[name])


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
