"""The generator: what it prints, what it refuses, and forms that keep their digits."""

from __future__ import annotations

from fractions import Fraction

import mpmath
import pytest
import sympy as sp
from mpmath import mp

from gpbnb.report.calculators import derivation
from gpbnb.report.calculators.javascript import (
    Definition,
    fraction_coefficients,
    print_expression,
    print_function,
    stable,
    symbol,
    taylor,
)
from gpbnb.report.integration import derivation as integration

X, Y = symbol("x"), symbol("y")


@pytest.mark.parametrize(
    ("expression", "printed"),
    [
        (X / 3, "(1/3)*x"),
        (X**2, "Math.pow(x, 2)"),
        (sp.sqrt(X), "Math.sqrt(x)"),
        (1 / (1 + X), "1/(x + 1)"),
        (sp.Min(X, Y), "Math.min(x, y)"),
        (sp.floor(sp.log(X)), "Math.floor(Math.log(x))"),
        (sp.Piecewise((X, X < 1), (sp.nan, True)), "((x < 1) ? ( x ) : ( NaN ))"),
        (sp.Piecewise((X, sp.Eq(X, 0)), (Y, True)), "((x == 0) ? ( x ) : ( y ))"),
        (2 * sp.pi * X, "2*Math.PI*x"),
        (sp.Integer(2) ** 60 * X, "1.152921504606847e+18*x"),
        (sp.Rational(1, 3**40) * X, f"({1 / 3**40!r})*x"),
        (sp.Rational(-(3**40), 7), repr(-(3**40) / 7)),
        (sp.Rational(-5, 7), "-5/7"),
        (sp.Float("0.1") * X, "0.1*x"),
        (sp.UnevaluatedExpr(X) + 1, "x + 1"),
        (sp.codegen.cfunctions.expm1(-X), "Math.expm1(-x)"),
        (X <= Y, "x <= y"),
    ],
)
def test_prints(expression, printed):
    assert print_expression(expression) == printed


@pytest.mark.parametrize("expression", [sp.zeta(X), sp.Integral(sp.sin(X) / X, (X, 0, Y)), sp.besselj(1, X)])
def test_refuses_what_javascript_lacks(expression):
    with pytest.raises(ValueError, match="needed an expression of arithmetic"):
        print_expression(expression)


def test_prints_a_function():
    digits = symbol("digits")
    definitions = (Definition("z", X + Y), Definition("t", symbol("z") <= digits, digits))
    assert print_function(["x", "y"], definitions).splitlines() == [
        "(given) => {",
        "  const {x, y} = given;",
        "  const z = x + y;",
        "  let t = 1;",
        "  while (t <= 2000 && !(z <= t)) t++;",
        "  if (t > 2000) t = NaN;",
        "  return {x, y, z, t};",
        "}",
    ]


@pytest.mark.parametrize("definitions", [(Definition("z", X + symbol("w")),), (Definition("x", Y),)])
def test_refuses_names_out_of_order(definitions):
    with pytest.raises(ValueError, match="needed a new name whose expression uses only earlier names"):
        print_function(["x", "y"], definitions)


def test_the_fraction_of_the_walk_is_lamberts():
    """L(μ/2) = (μ/6) / (1 + (μ²/60) / (1 + (μ²/140) / …)): 1/(4(2k+1)(2k+3)) from k = 1 on, all positive."""
    found = fraction_coefficients(taylor(integration.walk(), integration.MU, 15))
    assert found == [Fraction(1, 6)] + [Fraction(1, 4 * (2 * k + 1) * (2 * k + 3)) for k in range(1, 15)]


def test_taylor_of_functions_whose_series_are_known():
    x = sp.Symbol("x")
    assert taylor(sp.sin(2 * x), x, 3) == [2, Fraction(-4, 3), Fraction(4, 15)]
    assert taylor((sp.exp(x) - sp.exp(-x)) / (sp.exp(x) + sp.exp(-x)), x, 3) == [1, Fraction(-1, 3), Fraction(2, 15)]
    assert taylor(x * sp.cos(x) / 3, x, 2) == [Fraction(1, 3), Fraction(-1, 6)]
    assert fraction_coefficients(taylor(sp.sin(x) / sp.cos(x), x, 3)) == [1, Fraction(-1, 3), Fraction(-1, 15)]


@pytest.mark.parametrize(
    ("function", "message"),
    [
        (lambda x: sp.cos(x), "needed an odd function"),
        (lambda x: sp.cos(x) / x, "infinite at x = 0"),
        (lambda x: sp.log(1 + x), "needed powers of x"),
        (lambda x: sp.sin(sp.pi * x), "needed powers of x"),
        (lambda x: sp.sin(x) * sp.exp(x), "needed powers of x"),
    ],
)
def test_taylor_refuses_what_it_cannot_do(function, message):
    x = sp.Symbol("x")
    with pytest.raises(ValueError, match=message):
        taylor(function(x), x, 4)


def test_fractions_that_end_or_converge_slowly_are_refused():
    x = sp.Symbol("x")
    with pytest.raises(ValueError, match="ends after 2 terms"):
        fraction_coefficients([Fraction((-1) ** k) for k in range(5)])
    with pytest.raises(ValueError, match="up to 400, where its continued fraction converges too slowly"):
        stable(integration.walk().subs(integration.MU, x), x, 400)


@pytest.mark.parametrize(
    ("function", "x", "up_to"), [(integration.walk, integration.MU, 4), (derivation.across, symbol("phase"), 2)]
)
def test_the_stable_form_is_the_function(function, x, up_to):
    expression = function()
    form = stable(expression, x, up_to)
    (near, condition), (far, _) = form.args
    assert condition == (x <= up_to)
    assert far == expression
    with mp.workdps(120):
        there, here = (sp.lambdify(x, each, "mpmath") for each in (expression, near))
        for share in (1e-12, 1e-4, 0.1, 0.5, 0.9, 1.0):
            at = mpmath.mpf(share * up_to)
            assert abs(here(at) / there(at) - 1) < mpmath.mpf(10) ** -18


def test_the_fraction_is_not_longer_than_needed():
    """One level less is not good to 1e-18 at the end."""
    near = stable(integration.walk(), integration.MU, 4).args[0][0]
    levels = sum(1 for part in sp.preorder_traversal(near) if part.is_Add)
    coefficients = fraction_coefficients(taylor(integration.walk(), integration.MU, 15))
    tail = Fraction(1)
    for a in reversed(coefficients[1:levels]):
        tail = 1 + a * 16 / tail
    with mp.workdps(40):
        short = mpmath.mpf((coefficients[0] * 4 / tail).numerator) / (coefficients[0] * 4 / tail).denominator
        exact = mpmath.coth(2) - mpmath.mpf(1) / 2
        assert abs(short / exact - 1) > 1e-18
