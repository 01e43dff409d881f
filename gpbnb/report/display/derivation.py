"""Derivation steps that check themselves, and first-order error algebra."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache

import sympy as sp
from sympy.core.function import AppliedUndef

_ORDER = sp.Symbol("h")
_NO_NUMBERS = (AppliedUndef, sp.Integral, sp.Limit, sp.MatrixExpr, sp.Sum)


def errors(count: int, letter: str = "epsilon") -> tuple[sp.Symbol, ...]:
    """Return symbols for relative rounding errors, ε_1 … ε_count."""
    return tuple(sp.symbols(f"{letter}_1:{count + 1}"))


def first_order(expression: sp.Expr, eps: Sequence[sp.Symbol]) -> sp.Expr:
    """Return the part of `expression` that is linear in the rounding errors `eps`."""
    scaled = expression.subs({e: _ORDER * e for e in eps}, simultaneous=True)
    return sp.expand(sp.diff(scaled, _ORDER).subs(_ORDER, 0))


def unevaluated(expression: sp.Expr) -> sp.Expr:
    """Keep a factor unevaluated, so that a step shows its origin."""
    return sp.UnevaluatedExpr(expression)


def together(*terms: sp.Expr) -> sp.Expr:
    """Return a sum whose terms stay separate, so that a step shows their origin."""
    return sp.Add(*terms, evaluate=False)


def over(numerator: sp.Expr, denominator: sp.Expr) -> sp.Expr:
    """Return a quotient without simplifying it."""
    return sp.Mul(numerator, sp.Pow(denominator, -1, evaluate=False), evaluate=False)


@dataclass(frozen=True)
class Step:
    """One step of a derivation, ``left = right`` or ``left = right + rest >= right``.

    Parameters
    ----------
    name : a few words on what the step shows; ``$...$`` is typeset.
    left, right : sympy expressions. Unevaluated parts (UnevaluatedExpr, Sum, Limit) are displayed
        unevaluated and evaluated for the check.
    rest : an expression that SymPy recognizes as nonnegative under the assumptions on its symbols.
    """

    name: str
    left: sp.Expr
    right: sp.Expr
    rest: sp.Expr = sp.S.Zero

    @property
    def holds(self) -> bool:
        """Whether SymPy finds both sides equal and `rest` nonnegative."""
        return _vanishes(self.left - self.right - self.rest) and (self.rest == 0 or self.rest.is_nonnegative is True)

    def __str__(self) -> str:
        return f"{self.name}: {self.left} = {self.right}" + (f" + [{self.rest} >= 0]" if self.rest != 0 else "")

    def latex(self) -> str:
        """The formula of the step."""
        left, right = _latex(self.left), _latex(self.right)
        if self.rest == 0:
            return rf"{left} \;=\; {right}"
        return rf"{left} \;=\; {right} + \underbrace{{{_latex(self.rest)}}}_{{\ge\,0}}"


@dataclass(frozen=True)
class Derivation:
    """Steps in order. A notebook displays them as a collapsed list, and raises an error if a step does not hold."""

    steps: tuple[Step, ...]

    @property
    def holds(self) -> bool:
        """Whether every step holds."""
        return all(step.holds for step in self.steps)

    def __repr__(self) -> str:
        return "\n".join(f"{_mark(step)} {step}" for step in self.steps)

    def _repr_markdown_(self) -> str:
        """Return a collapsed list of the steps."""
        failed = [step.name for step in self.steps if not step.holds]
        if failed:
            raise ValueError(f"SymPy does not confirm {len(failed)} of {len(self.steps)} steps: {'; '.join(failed)}")
        count = "the step" if len(self.steps) == 1 else f"all {len(self.steps)} steps"
        steps = "\n".join(f"- {step.name}\n\n  $$\n  {step.latex()}\n  $$" for step in self.steps)
        return f'<details class="derivation"><summary>SymPy confirms {count}</summary>\n\n{steps}\n\n</details>'


@cache  # a chapter, its checks and its tests evaluate the same steps repeatedly
def _vanishes(difference: sp.Expr) -> bool:
    expanded = sp.Add(*map(_evaluated, sp.Add.make_args(difference))).expand()
    return not _differs_from_zero(expanded) and (_cancels(expanded) or bool(expanded.simplify() == 0))


def _cancels(expression: sp.Expr) -> bool:
    """Whether the numerator is zero as a polynomial, with exponentials in place of sines; a proof that takes little."""
    numerator = sp.fraction(sp.together(expression))[0].expand()
    return bool(numerator == 0 or numerator.rewrite(sp.exp).expand() == 0)


@cache
def _evaluated(term: sp.Expr) -> sp.Expr:
    return term.doit()


def _differs_from_zero(expression: sp.Expr) -> bool:
    """Whether small integers in place of the symbols give a number other than zero; a test much faster than SymPy's."""
    if expression.has(*_NO_NUMBERS):
        return False
    symbols = sorted(expression.free_symbols, key=str)
    number = expression.subs({symbol: k for k, symbol in enumerate(symbols, 2)}).evalf()
    return bool(number.is_comparable and abs(number) > 1e-6)


def _latex(expression: sp.Expr) -> str:
    # Rising powers read better for 1 - kβ, falling powers for n - 1. The shorter text is the better one.
    return min((str(sp.latex(expression, order=order)) for order in ("lex", "rev-lex")), key=len)


def _mark(step: Step) -> str:
    return "✓" if step.holds else "✗"
