"""gpbnb.report.inversion.derivation: every step holds, for every n, and means what the matrices do."""

from __future__ import annotations

import pytest
import steps
import sympy as sp

from gpbnb.report.display.derivation import first_order
from gpbnb.report.inversion import derivation, theory

DERIVATIONS = steps.Derivations(
    derivation.first_approach,
    derivation.first_approach_norms,
    derivation.one_step,
    derivation.reductions,
    derivation.perturbed_system,
    derivation.two_systems,
    derivation.transfer_cost,
    derivation.inverse_norms,
    derivation.back_substitution,
    derivation.back_substitution_weights,
)
EPS = derivation.EPSILON

NAMES = {
    "first_approach": {
        r"(35), from $r = A\hat h - u$ and $u = Ah$": "hath - h",
        r"(38): the same for all columns; the $\hat h_j$ are the columns of $A^{-1}+E$": "E",
        r"(42), from $r = (A+\Delta)\hat h - u$": "hath - h",
        r"before (43), from $R = (A+\Delta)(A^{-1}+E) - I$: exact with the computed inverse $A^{-1}+E$": "E",
        r"what $\approx$ drops, of second order": "A**-1*Delta*E",
    },
    "first_approach_norms": {
        "(44): (43) divided by $a$": "rho + a*d",
        r"(43) to every order: $e = a\rho + a d\,(a + e)$ has this solution": "(a*rho + a**2*d)/(1 - a*d)",
        r"from the computed inverse alone: $e = (x + e)\,\rho$, since $E = A^{-1}R$ and $a \le x + e$": (
            "x*rho/(1 - rho)"
        ),
    },
    "one_step": {
        r"(47) with one $\epsilon$ for all, as printed": "a0*(1 + epsilon) - (a0 - a1)*(1 + 3*epsilon)",
        "the same with a separate error for each rounding": (
            "a1*(epsilon_1 + epsilon_2 + epsilon_3) - a0*(epsilon_1 + epsilon_2)"
        ),
        "where $3a(1) = 2a(0)$, (47) is zero and the error is not": ("a1*(2*epsilon_3 - epsilon_1 - epsilon_2)/2"),
        r"its bound $|a(1)| + 2|p|$ is at most that of (61): let $|p| = |a(0)| + |a(1)| - w$, $w\ge0$": ("u + 2*p"),
        r"to every order, $a(0)$ written with the computed $\hat a(1)$: its error": (
            "hata*epsilon_3/(1 + epsilon_3) - p*((1 + epsilon_1)*(1 + epsilon_2) - 1)"
        ),
    },
    "reductions": {
        r"one step; in brackets its $\tilde a_{ij}(k)$": "l_ikhata_kjk1",
        r"$s(r) = a(0) - \hat a(r) + \tilde s(r)$ with $\tilde s(r) = \tilde a(1)+\dots+\tilde a(r)$, from "
        "$r$ to $r+1$": "hata(0) - hata(r + 1) + tildes(r) + tildea(r + 1)",
        r"entry $(i,j)$ of $L\hat A_T$: the last product, of $r = \min(i,j)-1$, is $\hat a_{ij}(r)$ itself": (
            "hata(0) + tildes(r)"
        ),
    },
    "perturbed_system": {
        "(68), exact with $A^{-1}$ and the computed solution": "Deltax",
        r"(68), exact with $\hat A^{-1} = (A+\Delta)^{-1}$ and the true solution, cleared of the inverse": (
            "(A + Delta)*Deltax"
        ),
        r"(68) as printed, with $\hat A^{-1}$ and the computed solution, lacks $\hat A^{-1}\Delta\,\Delta x$, "
        "of second order": "(A + Delta)*Deltax - Delta*Deltax",
    },
    "two_systems": {
        "(91) corrected: the matrix whose exact solution was computed": "A + tildeA + L*DeltaA",
        "(92) corrected: its right-hand side": "b + tildeb + L*Deltab",
        "term missing from (91)": "(L - 1)*DeltaA",
        "the same as a change of the triangular matrix $L^{-1}A$": "L**-1*tildeA + DeltaA",
        "either way, (94) is the same": "A**-1*(tildeb + L*Deltab - (tildeA + L*DeltaA)*hatx)",
    },
    "transfer_cost": {
        r"each absolute value in (59) bounds two products, $u = |\hat a(k-1)|$, $v = |\hat a(k)|$": ("2*(u + v - w)"),
        "the largest weight of (87), where $j = 2 + m$": "n + 1 - m",
        r"so including $L$ increases the bound by at most this factor": "(n + 3)/2",
    },
    "inverse_norms": {
        "(97): (96) divided by $x$": "c",
        r"(96) to every order: $e = (x + e)\,c$, since $\|A^{-1}\| \le x + e$, has this solution": ("x*c/(1 - c)"),
        "term missing from (96), relative to (96)": "c/(1 - c)",
    },
    "back_substitution": {
        "(72)-(74): the last row": "b_3*(1 + epsilon)",
        r"(75): error of $\hat x_2$, to first order": "epsilon*(2*(a_22*x_2 + a_23*x_3) - 4*a_23*x_3)/a_22",
        r"(77) with nothing dropped: $a_{22}\hat x_2$; to first order the powers are $1+2\epsilon$, "
        r"$1+3\epsilon$": "b_2*(1 + epsilon)**2 - a_23*hatx_3*(1 + epsilon)**3",
        r"error of $\hat x_1$, before (78), to first order": (
            "epsilon/a_11*(3*(a_11*x_1 + a_12*x_2 + a_13*x_3) - 4*a_12*x_2 - 2*a_12/a_22*(a_22*x_2 + a_23*x_3) + "
            "4*a_12*a_23/a_22*x_3 - 4*a_13*x_3)"
        ),
        r"(79) with nothing dropped: $a_{11}\hat x_1$; the powers are the weights $3$, $4$ and $3$": (
            "b_1*(1 + epsilon)**3 - a_12*hatx_2*(1 + epsilon)**4 - a_13*hatx_3*(1 + epsilon)**3"
        ),
    },
    "back_substitution_weights": {
        "(86): $n-k$ subtractions and the division": "n - k + 1",
        "(85): product, subtraction, $n-j$ more, and the division": "n - j + 3",
        "one more row and column, the last: each weight grows by one": "n - j + 4",
        "(89) of 1982 prints $2n-j$, which is too large by this difference; it is zero only for $n=3$": "n - 3",
    },
}
"""What each step derives, beside its name; see `steps.check_names`."""


@pytest.mark.parametrize("name", DERIVATIONS)
def test_each_step_holds_and_is_named_for_what_it_derives(name):
    steps.check_each(DERIVATIONS[name], NAMES[name])


def test_only_42_and_43_change_the_matrix():
    changed = [step.left.has(derivation.DELTA) for step in DERIVATIONS["first_approach"].steps]
    assert changed == [False, False, True, True, True]


def test_matrices_do_not_commute():
    assert derivation.H_HAT * derivation.X_HAT != derivation.X_HAT * derivation.H_HAT


def test_the_derivations_are_those_of_the_chapter():
    assert sum(steps.lengths(DERIVATIONS).values()) == 39


# -- what the printed lines say, and what they leave out ------------------------------------------


def test_47_is_the_error_only_where_all_roundings_agree():
    found = derivation.entry()
    one = dict.fromkeys(found.errors, EPS)
    assert sp.expand(derivation.entry_error().subs(one) - derivation.printed_entry_error()) == 0
    two = dict(zip(found.errors, (EPS, EPS, -EPS), strict=True))
    assert sp.expand(derivation.entry_error().subs(two) - derivation.printed_entry_error()) != 0


def test_where_47_is_zero_the_error_can_be_four_units_of_half_the_entry():
    """a(0) = 3, a(1) = 2: the error is 2 ε₃ - ε₁ - ε₂, at most 4β; (61) allows 12β."""
    old, new, _, errors, _ = derivation.entry()
    e1, e2, e3 = errors
    at = {old: 3, new: 2}
    assert derivation.printed_entry_error().subs(at) == 0
    assert derivation.entry_error().subs({**at, e1: -1, e2: -1, e3: 1}) == 4
    assert (3 * new + 2 * old).subs(at) == 12


@pytest.mark.parametrize("n", range(1, 5))
def test_the_errors_of_all_steps_are_a_change_of_the_given_matrix(n):
    found = derivation.stages(n)
    difference = found.lower * found.upper - found.given - found.change
    assert difference.applyfunc(sp.simplify) == sp.zeros(n, n)
    # And not of another: neither without L nor with the errors counted in the triangle.
    if n > 1:
        assert (found.upper - found.given - found.change).applyfunc(sp.simplify) != sp.zeros(n, n)
        assert found.change[0, :] == sp.zeros(1, n)
        assert found.change[:, 0] == sp.zeros(n, 1)
        assert found.lower.is_lower
        assert found.upper.is_upper
        assert all(found.lower[i, i] == 1 for i in range(n))


def test_l_carries_the_back_substitution_of_rows_above_into_rows_below():
    """For 3 × 3, (91) lacks 4 l_21 a_12 β in entry (2, 2), and so on."""
    lower = derivation.stages(3).lower
    a12, a13, a23 = sp.symbols("a12 a13 a23")
    change = sp.Matrix([[0, 4 * a12, 3 * a13], [0, 0, 3 * a23], [0, 0, 0]])
    missing = ((lower - sp.eye(3)) * change).applyfunc(sp.expand)
    assert missing[0, :] == sp.zeros(1, 3)
    assert missing[1, 1] == sp.expand(4 * a12 * lower[1, 0])
    assert sp.expand(missing[2, 2] - 3 * a13 * lower[2, 0] - 3 * a23 * lower[2, 1]) == 0


@pytest.mark.parametrize("terms", range(5))
def test_a_row_of_back_substitution_has_the_weights_of_theory(terms):
    right, products = derivation.back_row_weights(terms)
    n = terms + 1
    assert right == theory.right_side_weights(n)[0]
    assert list(products) == list(theory.back_substitution_weights(n)[0, 1:])


@pytest.mark.parametrize("terms", range(4))
def test_a_row_is_exact_in_products_of_its_errors(terms):
    """Each coefficient is a product of factors 1 + ε, so that γ of its weight bounds it, to every order."""
    value, right, products, errors = derivation.back_row(terms)
    for e in errors:
        coefficient = sp.Poly(sp.expand(value), e)
        assert coefficient.degree() == 1
    none = dict.fromkeys(errors, 0)
    assert sp.expand(value.subs(none) - right + sum(products)) == 0


def test_printed_lines_leave_nothing_of_first_order():
    """Both sides of (76) to (79); with the true x_3 in place of the computed one, as 1984 prints it, (77) fails."""
    a, (x1, x2, x3), b, (y1, y2, y3) = derivation.triangle()
    a12, a13, a22, a23 = a[0, 1], a[0, 2], a[1, 1], a[1, 2]
    inside = 3 * EPS * b[0] - 2 * EPS * b[1] * a12 / a22 - 4 * EPS * a12 * y2
    for equation, left, right in (
        (76, x2, y2 - (2 * EPS * b[1] - 4 * EPS * a23 * y3 / (1 + EPS)) / a22),
        (77, a22 * y2 + a23 * (1 + 3 * EPS) * y3, b[1] * (1 + 2 * EPS)),
        (78, x1, y1 - (inside + 4 * EPS / (1 + EPS) * (a12 * a23 / a22 - a13) * y3) / a[0, 0]),
        (79, a[0, 0] * y1 + a12 * (1 + 4 * EPS) * y2 + a13 * (1 + 3 * EPS) * y3, b[0] * (1 + 3 * EPS)),
    ):
        assert sp.simplify(derivation.linear(left - right)) == 0, equation
    without_hat = a22 * y2 + a23 * (1 + 3 * EPS) * x3 - b[1] * (1 + 2 * EPS)
    assert sp.simplify(derivation.linear(without_hat) + a23 * x3 * EPS) == 0


def test_the_triangle_solves_itself_without_errors():
    _, x, _, computed = derivation.triangle()
    assert [sp.simplify(y.subs(EPS, 0) - true) for y, true in zip(computed, x, strict=True)] == [0, 0, 0]


def test_the_rows_of_the_triangle_are_those_of_every_n():
    """With all errors equal, a row of n is second_row and first_row."""
    a, _, _, _ = derivation.triangle()
    for terms, row in ((1, derivation.second_row), (2, derivation.first_row)):
        value, right, _, errors = derivation.back_row(terms)
        hats = sp.symbols(rf"\hat{{x}}_1:{terms + 1}")
        names = sp.symbols(f"a_1:{terms + 1}")
        entries = (a[1, 2],) if terms == 1 else (a[0, 1], a[0, 2])
        same = value.subs(dict.fromkeys(errors, EPS)).subs(dict(zip(names, entries, strict=True)))
        assert sp.expand(same - row(a, right, *hats)) == 0


@pytest.mark.parametrize("n", range(2, 8))
def test_1982_has_the_weights_of_three(n):
    same = (theory.printed_weights_1982(n) == theory.back_substitution_weights(n)).all()
    assert same == (n == 3)


def test_strict_forms_are_the_first_order_forms_when_small():
    """x c/(1 - c) to first order in c, and a(ρ + a d)/(1 - a d) in ρ and d."""
    x, c = sp.symbols("x c", positive=True)
    step = DERIVATIONS["inverse_norms"].steps[1]
    assert first_order(step.right, (c,)) == x * c
    a, rho, d = sp.symbols("a rho d", positive=True)
    step = DERIVATIONS["first_approach_norms"].steps[1]
    assert sp.expand(first_order(step.right, (rho, d)) - a * rho - a**2 * d) == 0
