"""What is asked of the steps of every derivation."""

from __future__ import annotations

import re
from collections.abc import Callable

import sympy as sp
from sympy.core.function import AppliedUndef

from gpbnb.report.display.derivation import Step

AMOUNT = sp.Symbol("amount", positive=True)

Derivation = Callable[[], tuple[Step, ...]]


def _plain(name: str) -> str:
    return re.sub(r"\W", "", name.replace("'", "T"))


def written(text: str, step: Step) -> sp.Expr:
    r"""An expression in the symbols of a step: `\hat{a}_{ij}` is hata_ij, `a(0)` is a0, and `H'` is HT."""
    parts = [side.atoms(sp.Symbol, AppliedUndef) for side in (step.left, step.right)]
    known = {_plain(part.name): part.func if part.args else part for part in set().union(*parts)}
    known.pop("", None)  # the side that a limit comes from
    return sp.sympify(text, locals=known)


def equal(found: sp.Expr, wanted: sp.Expr) -> bool:
    """Whether two expressions are one."""
    difference = (found - wanted).doit().expand()
    return difference == 0 or any(form(difference) == 0 for form in (sp.cancel, sp.simplify))


def check(derivation: Derivation, names: dict[str, str]) -> None:
    """The steps have these names and derive the right sides beside them; a step that is altered does not hold."""
    steps = derivation()
    assert [step.name for step in steps] == list(names)
    for step, right in zip(steps, names.values(), strict=True):
        assert step.holds
        assert not step._replace(right=step.right + AMOUNT).holds
        assert not step._replace(right=step.right + AMOUNT, rest=step.rest - AMOUNT).holds
        assert equal(step.right, written(right, step)), step.name
