"""What is asked of the steps of every derivation."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Mapping
from dataclasses import replace
from functools import cache

import sympy as sp
from sympy.core.function import AppliedUndef

from gpbnb.report.display.derivation import Derivation, Step

UNEVALUATED = (sp.Integral, sp.Sum, sp.Limit, sp.Derivative)
AMOUNT = sp.Symbol("amount", positive=True)


class Derivations(Mapping[str, Derivation]):
    """Derivations by the names of their functions, each made when it is first asked for."""

    def __init__(self, *functions: Callable[[], Derivation]) -> None:
        self.functions = {function.__name__: cache(function) for function in functions}

    def __getitem__(self, name: str) -> Derivation:
        return self.functions[name]()

    def __iter__(self) -> Iterator[str]:
        return iter(self.functions)

    def __len__(self) -> int:
        return len(self.functions)


def lengths(derivations: Derivations) -> dict[str, int]:
    """The numbers of steps."""
    return {name: len(found.steps) for name, found in derivations.items()}


def wrong_ones(step: Step) -> Iterator[Step]:
    """The step with another right side, and with a rest that may be negative, under which it must not hold."""
    yield replace(step, right=step.right + AMOUNT)
    yield replace(step, right=step.right + AMOUNT, rest=step.rest - AMOUNT)


def check(step: Step, alike: bool = False) -> None:
    """The step holds, would not hold if it were wrong, and is typeset; its sides look alike where it is said, alone."""
    assert step.holds
    assert step.name
    assert step.name.count("$") % 2 == 0
    for wrong in wrong_ones(step):
        assert not wrong.holds
    # An unevaluated expression stands on the left, its value on the right.
    assert step.left.has(*UNEVALUATED) or not step.right.has(*UNEVALUATED)
    latex = step.latex()
    left, right = latex.split(r"\;=\;")
    assert (left.strip() == right.strip()) == alike
    assert not re.search(r"[-+]\s*[-+]|\bnan\b|None|\?|\$", latex)
    for opening, closing in (("{", "}"), (r"\left", r"\right")):
        assert latex.count(opening) == latex.count(closing)


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


def check_names(derivation: Derivation, names: dict[str, str]) -> None:
    """The steps have these names, in this order, and each derives the right side written beside its name."""
    assert [step.name for step in derivation.steps] == list(names)
    for step, right in zip(derivation.steps, names.values(), strict=True):
        assert equal(step.right, written(right, step)), step.name


def check_each(derivation: Derivation, names: dict[str, str], alike: tuple[str, ...] = ()) -> None:
    """Each step passes :func:`check` and :func:`check_names`; the sides of those that begin with `alike` look alike."""
    for step in derivation.steps:
        check(step, step.name.startswith(alike))
    check_names(derivation, names)
