"""gpbnb.rolling.derivation: every step holds, and a wrong one would be found out."""

from __future__ import annotations

import re
from dataclasses import replace

import pytest
import sympy as sp

from gpbnb.rolling import derivation

DERIVATIONS = {
    function.__name__: function()
    for function in (
        derivation.one_dimension,
        derivation.two_dimensions,
        derivation.fits,
        derivation.filters,
        derivation.ramp_spectrum,
        derivation.roll_rate,
        derivation.response,
    )
}
each_step = pytest.mark.parametrize(
    ("name", "i"), [(name, i) for name, steps in DERIVATIONS.items() for i in range(len(steps.steps))]
)


@each_step
def test_the_step_holds_and_a_wrong_one_would_not(name, i):
    step = DERIVATIONS[name].steps[i]
    assert step.holds
    assert step.name
    for wrong in (
        replace(step, right=step.right + sp.Symbol("wrong", positive=True)),
        replace(step, rest=step.rest + 1),
    ):
        assert not wrong.holds


@each_step
def test_the_step_is_typeset_and_shows_something(name, i):
    latex = DERIVATIONS[name].steps[i].latex()
    left, right = latex.split(r"\;=\;")
    assert left.strip() != right.strip()
    assert not re.search(r"[-+]\s*-|--|\bnan\b|None|\?", latex)
    assert latex.count("{") == latex.count("}")
    assert "$" not in latex


def test_the_derivations_are_those_of_the_chapter():
    assert sum(len(steps.steps) for steps in DERIVATIONS.values()) == 36


def test_the_matrices_are_inverse():
    phi = sp.Symbol("phi", real=True)
    assert sp.simplify(derivation.deroll(phi) * derivation.roll(phi)) == sp.eye(2)
    assert derivation.roll(phi) == sp.Matrix([[sp.cos(phi), sp.sin(phi)], [-sp.sin(phi), sp.cos(phi)]])
