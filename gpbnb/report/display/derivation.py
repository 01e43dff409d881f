"""Derivation steps that check themselves, and first-order error algebra."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from functools import cache
from typing import NamedTuple

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


class Step(NamedTuple):
    """One step of a derivation, ``left = right`` or ``left = right + rest >= right``.

    Sums, integrals and limits may be unevaluated. SymPy must recognize `rest` as nonnegative.
    """

    name: str
    left: sp.Expr
    right: sp.Expr
    rest: sp.Expr = sp.S.Zero

    @property
    def holds(self) -> bool:
        """Whether SymPy finds both sides equal and `rest` nonnegative."""
        return _vanishes(self.left - self.right - self.rest) and (self.rest == 0 or self.rest.is_nonnegative is True)


def hold(steps: Iterable[Step]) -> bool:
    """Whether SymPy confirms every step of a derivation."""
    return all(step.holds for step in steps)


@cache  # checks and tests evaluate the same steps repeatedly
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
