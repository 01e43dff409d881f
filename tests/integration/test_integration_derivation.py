"""gpbnb.report.integration.derivation: it means what the numbers of the theory do."""

from __future__ import annotations

import numpy as np
import pytest
import sympy as sp

from gpbnb.report.integration import derivation, theory
from gpbnb.report.integration.derivation import MU, T


def test_the_integral_equation_as_printed_lacks_the_identity():
    assert derivation.transition_residual(identity=True) == sp.zeros(2)
    assert derivation.transition_residual(identity=False) == sp.eye(2)


def test_the_walk_is_that_of_the_theory():
    assert float(derivation.walk().subs(MU, sp.Rational(6, 5))) == pytest.approx(float(theory.walk_factor(1.2)))


def test_slips():
    slips = derivation.misprints()
    mu, period = sp.Rational(3, 10), sp.Rational(1, 50)
    found = {place: float(rate.subs({MU: mu, T: period})) for place, rate in slips.items()}
    right = float(theory.walk_factor(0.3))
    assert found["(25)"] == pytest.approx(right)
    # Without P22 the rate lacks 2/μ, and with the full last term of P32 twice half of φ21.
    assert found["(12)"] == pytest.approx(right - 2 / 0.3)
    assert found["(18)"] == pytest.approx(right - (1 - np.exp(-0.3)) / 0.3)
    coth = 1 / np.tanh(0.15)
    assert found["(34)"] == pytest.approx(coth * 50 - 2 / 0.3)
    assert found["(37)"] == pytest.approx(0.3 / 6 - 0.3**2 / 6)
    # With T = 1 the slip of (34) does not show.
    assert float(slips["(34)"].subs({MU: mu, T: 1})) == pytest.approx(right)


def test_the_right_numerator_gives_no_even_term():
    assert derivation.printed_37(sp.Rational(1, 12)) == MU / 6
    assert sp.expand(derivation.printed_37(sp.Rational(1, 6)) - MU / 6 + MU**2 / 6) == 0


def test_the_slip_of_18_is_the_half():
    with_half, without = derivation.printed_18(half=True), derivation.printed_18(half=False)
    assert with_half[0] == without[0]
    assert with_half[2] == without[2]
    assert sp.expand(without[1] - with_half[1] - derivation.PHI21 * derivation.P11 * T / 2) == 0
