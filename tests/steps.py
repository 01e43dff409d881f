"""What is asked of the steps of every derivation."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator
from dataclasses import replace

import pytest
import sympy as sp
from sympy.core.function import AppliedUndef

from gpbnb.display.derivation import Derivation, Step

AMOUNT = sp.Symbol("amount", positive=True)


def collected(*functions: Callable[[], Derivation]) -> dict[str, Derivation]:
    """Derivations by their names."""
    return {function.__name__: function() for function in functions}


def each(derivations: dict[str, Derivation]) -> pytest.MarkDecorator:
    """A test for each `step` of some derivations."""
    steps = [
        pytest.param(step, id=f"{name}-{i}")
        for name, found in derivations.items()
        for i, step in enumerate(found.steps)
    ]
    return pytest.mark.parametrize("step", steps)


def lengths(derivations: dict[str, Derivation]) -> dict[str, int]:
    """The numbers of steps."""
    return {name: len(found.steps) for name, found in derivations.items()}


def wrong_ones(step: Step) -> Iterator[Step]:
    """The step with other right sides and rests, under which it must not hold."""
    yield replace(step, right=step.right + AMOUNT)
    yield replace(step, right=2 * step.right if step.right != 0 else sp.S.One)
    yield replace(step, rest=step.rest + 1)
    yield replace(step, right=step.right + AMOUNT, rest=step.rest - AMOUNT)


def check(step: Step, alike: bool = False) -> None:
    """The step holds, would not hold if it were wrong, and is typeset; its sides look alike where it is said, alone."""
    assert step.holds
    assert step.name
    assert step.name.count("$") % 2 == 0
    for wrong in wrong_ones(step):
        assert not wrong.holds
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
