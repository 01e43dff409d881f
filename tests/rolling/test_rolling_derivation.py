"""gpbnb.rolling.derivation: every step holds, and a wrong one would be found out."""

from __future__ import annotations

import steps
import sympy as sp

from gpbnb.rolling import derivation

DERIVATIONS = steps.collected(
    derivation.one_dimension,
    derivation.two_dimensions,
    derivation.fits,
    derivation.filters,
    derivation.ramp_spectrum,
    derivation.roll_rate,
    derivation.response,
)


@steps.each(DERIVATIONS)
def test_each_step(step):
    steps.check(step)


def test_the_derivations_are_those_of_the_chapter():
    assert sum(steps.lengths(DERIVATIONS).values()) == 36


def test_the_matrices_are_inverse():
    phi = sp.Symbol("phi", real=True)
    assert sp.simplify(derivation.deroll(phi) * derivation.roll(phi)) == sp.eye(2)
    assert derivation.roll(phi) == sp.Matrix([[sp.cos(phi), sp.sin(phi)], [-sp.sin(phi), sp.cos(phi)]])
