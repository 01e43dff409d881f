"""gpbnb.report.rolling.derivation: every step holds, and a wrong one would be found out."""

from __future__ import annotations

import pytest
import steps
import sympy as sp

from gpbnb.report.rolling import derivation

NAMES = {
    "filters": {
        "single pole: it lags by τ": "tau",
        "single pole: noise bandwidth": "1/(4*tau)",
        "moving average: it lags by half its length": "L/2",
        "moving average: noise bandwidth": "1/(2*L)",
        "single pole: lag and noise against its bandwidth": "(k*tau)**2 + N_0/(4*tau)",
        "moving average: the same function": "(k*L/2)**2 + N_0/(2*L)",
        "never smaller than at $B=B_0$, where $k^2 = 8N_0B_0^3$": "3*N_0*B_0/2",
        "the least mean square error": "3/4*(k*N_0)**(2/3)",
    },
}
"""What each step derives, beside its name; see `steps.check`."""


@pytest.mark.parametrize("name", NAMES)
def test_each_step_holds_and_is_named_for_what_it_derives(name):
    steps.check(getattr(derivation, name), NAMES[name])


def test_the_deroll_inverts_the_roll():
    phi = sp.Symbol("phi", real=True)
    roll = sp.Matrix([[sp.cos(phi), sp.sin(phi)], [-sp.sin(phi), sp.cos(phi)]])
    assert sp.simplify(derivation.deroll(phi) * roll) == sp.eye(2)
