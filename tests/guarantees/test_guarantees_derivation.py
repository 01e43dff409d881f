"""guarantees.derivation: every step holds, would not if it were wrong, and is named for what it derives."""

from __future__ import annotations

import pytest
import steps

from gpbnb.report.guarantees import derivation

DERIVATIONS = steps.Derivations(
    derivation.recursion,
    derivation.telescope,
    derivation.induction,
    derivation.ellipsoid,
)

NAMES = {
    "recursion": {
        "computed minus exact estimate after a step": (
            "hatF*e + (hatF - (1 - hatK*H)*Phi)*p + (hatK - K)*(z - H*Phi*p) + w"
        ),
        r"the exact estimate, written with the computed loop: $\hat F p + \hat K z$ minus the difference": (
            "hatF*p + hatK*z - (hatF - (1 - hatK*H)*Phi)*p - (hatK - K)*(z - H*Phi*p)"
        ),
    },
    "telescope": {
        "$c_0$ times the error after two steps": ("c_0*w + c_1*v + (c_0*F - c_1)*(G*e + v) + (c_1*G - c_2)*e + c_2*e"),
    },
    "induction": {
        r"the bound b with $b = \sum_{l<L}F^lw + F^Lb$ is the infinite sum, wherever it is cut": "w/(1 - F)",
    },
    "ellipsoid": {
        "squared half-width of the new ellipsoid, less that of the sum of both sets": ("(tau*u - t*v)**2/(t*tau)"),
    },
}
"""What each step derives, beside its name; see `steps.check_names`."""


@pytest.mark.parametrize("name", DERIVATIONS)
def test_each_step_holds_and_is_named_for_what_it_derives(name):
    steps.check_each(DERIVATIONS[name], NAMES[name])
