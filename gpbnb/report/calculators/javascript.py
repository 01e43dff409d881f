"""Print SymPy expressions as JavaScript, after rewriting them where float64 would lose digits."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from fractions import Fraction
from typing import Any

import sympy as sp
from sympy.printing.codeprinter import PrintMethodNotImplementedError
from sympy.printing.jscode import JavascriptCodePrinter

MOST_DIGITS = 2000
"""Largest whole number that the search of a :class:`Definition` tries; beyond it, the result is NaN."""


@dataclass(frozen=True)
class Definition:
    """A name, and its computation from earlier names.

    Parameters
    ----------
    name : an identifier of JavaScript.
    expression : expression of symbols that are inputs or defined before; with `smallest`, a condition.
    smallest : if given, the name stands for the smallest whole number from 1 on that satisfies the condition when
        substituted for this symbol.
    shown : the formula for display, if the expression is a rewritten one that keeps more digits.
    """

    name: str
    expression: Any
    smallest: sp.Symbol | None = None
    shown: Any = None


def symbol(name: str) -> sp.Symbol:
    """Return the symbol of an input or a definition, which are never negative."""
    return sp.Symbol(name, nonnegative=True)


class _Printer(JavascriptCodePrinter):  # type: ignore[misc]
    """Printer for expressions that SymPy's own printer does not support or prints with too many digits."""

    def _print_Rational(self, expr: sp.Rational) -> str:
        if max(abs(expr.p), expr.q) < 2**53:  # both exact, so that the quotient is the nearest float64
            return f"{expr.p}/{expr.q}"
        return repr(float(expr))

    def _print_Integer(self, expr: sp.Integer) -> str:
        return str(expr.p) if abs(expr.p) < 2**53 else repr(float(expr))

    def _print_Float(self, expr: sp.Float) -> str:
        return repr(float(expr))

    def _print_NaN(self, expr: sp.Expr) -> str:
        return "NaN"

    def _print_expm1(self, expr: sp.Expr) -> str:
        return f"Math.expm1({self._print(expr.args[0])})"


def print_expression(expression: Any) -> str:
    """Return one expression of JavaScript, on one line.

    Raises
    ------
    ValueError : part of the expression has no counterpart in JavaScript.
    """
    try:
        source = str(_Printer().doprint(sp.sympify(expression).doit()))
    except PrintMethodNotImplementedError:
        raise ValueError(
            f"got {expression}; needed an expression of arithmetic, powers, sqrt, exp, expm1, log, sin, cos, floor, "
            "Min, Max and Piecewise; rewrite it with these"
        ) from None
    return " ".join(source.split())


def print_function(inputs: Sequence[str], definitions: Iterable[Definition]) -> str:
    """Return a JavaScript function from an object with the inputs to an object with inputs and definitions.

    Raises
    ------
    ValueError : a name is used before it is defined, or defined twice; or an expression cannot be printed.
    """
    known = list(inputs)
    lines = []
    for each in definitions:
        free = {s.name for s in each.expression.free_symbols} - ({each.smallest.name} if each.smallest else set())
        if each.name in known or not free <= set(known):
            raise ValueError(
                f"got {each.name} of {', '.join(sorted(free)) or 'nothing'} after {', '.join(known)}; "
                "needed a new name whose expression uses only earlier names; reorder or rename"
            )
        if each.smallest is None:
            lines.append(f"const {each.name} = {print_expression(each.expression)};")
        else:
            condition = print_expression(each.expression.subs(each.smallest, symbol(each.name)))
            lines.append(f"let {each.name} = 1;")
            lines.append(f"while ({each.name} <= {MOST_DIGITS} && !({condition})) {each.name}++;")
            lines.append(f"if ({each.name} > {MOST_DIGITS}) {each.name} = NaN;")
        known.append(each.name)
    body = "\n  ".join((f"const {{{', '.join(inputs)}}} = given;", *lines, f"return {{{', '.join(known)}}};"))
    return f"(given) => {{\n  {body}\n}}"


# -- forms that keep their digits ------------------------------------------------------------------

_CYCLES = {sp.exp: (1, 1, 1, 1), sp.sin: (0, 1, 0, -1), sp.cos: (1, 0, -1, 0)}


def taylor(expression: sp.Expr, x: sp.Symbol, terms: int) -> list[Fraction]:
    """Return the exact coefficients of x, x³, x⁵, … of an odd function, which may be a quotient that is 0/0 at 0.

    Raises
    ------
    ValueError : the function is not odd, is infinite at 0, or contains anything but powers, exp, sin and cos of
        rational multiples of x.
    """
    order = 2 * terms + 8
    above, below = (_coefficients(part, x, order) for part in sp.fraction(sp.together(expression)))
    low = next(i for i, value in enumerate(below) if value)
    if any(above[:low]):
        raise ValueError(f"got {expression}, infinite at {x} = 0; needed a function that has a value there")
    above, below = above[low:], below[low:]
    quotient: list[Fraction] = []
    for k in range(2 * terms):
        quotient.append((above[k] - sum(quotient[j] * below[k - j] for j in range(k))) / below[0])
    if any(quotient[::2]):
        raise ValueError(f"got {expression}; needed an odd function of {x}; divide by {x} if it is even")
    return quotient[1::2]


def _coefficients(expression: sp.Expr, x: sp.Symbol, order: int) -> list[Fraction]:
    result = [Fraction(0)] * order
    for term in sp.Add.make_args(sp.expand(expression)):
        factor, power, rate, cycle = Fraction(1), 0, Fraction(0), (1, 0, 0, 0)
        for part in sp.Mul.make_args(term):
            base, exponent = part.as_base_exp()
            inner = part.args[0] / x if part.func in _CYCLES else None
            if part.is_Rational:
                factor *= Fraction(part.p, part.q)
            elif base == x and exponent.is_Integer and exponent > 0:
                power += int(exponent)
            elif inner is not None and inner.is_Rational and not rate:
                rate, cycle = Fraction(inner.p, inner.q), _CYCLES[part.func]
            else:
                raise ValueError(
                    f"got {part} in {expression}; needed powers of {x} and exp, sin or cos of a "
                    f"rational multiple of {x}"
                )
        size = factor
        for k in range(order - power):
            result[k + power] += size * cycle[k % 4]
            size *= rate / (k + 1)
    return result


def fraction_coefficients(series: Sequence[Fraction]) -> list[Fraction]:
    r"""Return the exact continued fraction of a power series in z, :math:`\cfrac{a_0}{1+\cfrac{a_1z}{1+\dots}}`.

    Raises
    ------
    ValueError : the fraction ends.
    """
    rest = list(series)
    result: list[Fraction] = []
    while rest:
        first = rest[0]
        if not first:
            raise ValueError(
                f"got a series whose continued fraction ends after {len(result)} terms; needed one that does not end"
            )
        result.append(first)
        # The series of g in first / (1 + z g).
        inverse = [Fraction(1)]
        for k in range(1, len(rest)):
            inverse.append(-sum(inverse[j] * rest[k - j] for j in range(k)) / first)
        rest = inverse[1:]
    return result


def stable(expression: sp.Expr, x: sp.Symbol, up_to: int) -> sp.Expr:
    """Replace an odd function that cancels near 0 by its continued fraction up to a point; keep it unchanged beyond.

    The fraction is truncated where its relative difference from the function is below 1e-18 at `up_to`.

    Raises
    ------
    ValueError : :func:`taylor` or :func:`fraction_coefficients` fails, or the fraction converges too slowly.
    """
    first, *others = fraction_coefficients(taylor(expression, x, 30))
    exact = Fraction(str(expression.subs(x, up_to).evalf(40)))
    for terms in range(1, len(others)):
        tail = Fraction(1)
        for a in reversed(others[:terms]):
            tail = 1 + a * up_to**2 / tail
        if abs(first * up_to / tail / exact - 1) < Fraction(1, 10**18):
            return sp.Piecewise((_fraction(first, others[:terms], x), x <= up_to), (expression, True))
    raise ValueError(
        f"got {expression} up to {up_to}, where its continued fraction converges too slowly; needed a smaller up_to"
    )


def _fraction(first: Fraction, others: Sequence[Fraction], x: sp.Expr) -> sp.Expr:
    tail: sp.Expr = sp.S.One
    for a in reversed(others):
        tail = 1 + sp.Rational(a.numerator, a.denominator) * x**2 / tail
    return sp.Rational(first.numerator, first.denominator) * x / tail
