"""gpbnb.report.display.derivation: steps that check themselves."""

from __future__ import annotations

import pytest
import sympy as sp

from gpbnb.report.display.derivation import Step, errors, first_order, hold

X, Y = sp.symbols("x y")
N = sp.Symbol("n", integer=True, positive=True)
B = sp.Symbol("beta", positive=True)

HOLD = [
    Step("expansion", (X + Y) ** 2, X**2 + 2 * X * Y + Y**2),
    Step("a product", (1 - B) * (1 + B), 1 - B**2),
    Step("a sum", sp.Sum(N, (N, 1, 4)), sp.Integer(10)),
    Step("a limit", sp.Limit(sp.sin(X) / X, X, 0), sp.Integer(1)),
    Step("an integral", sp.Integral(X, (X, 0, 1)), sp.Rational(1, 2)),
    Step("a rest", (1 + B) ** 2, 1 + 2 * B, B**2),
    Step("a rest of zero or more", N, sp.Integer(1), N - 1),
]
FAIL = [
    Step("a wrong equality", (X + Y) ** 2, X**2 + Y**2),
    Step("a wrong sign", (1 - B) * (1 + B), 1 + B**2),
    Step("a wrong coefficient", sp.Sum(N, (N, 1, 4)), sp.Integer(11)),
    Step("a negative rest", 1 + B, 1 + 2 * B, -B),
    Step("a rest of either sign", X + Y, Y, X),
    Step("a rest that does not make up the difference", (1 + B) ** 2, 1 + 2 * B, B),
    Step("a negative rest that makes it up", N, N + 1, sp.Integer(-1)),
    Step("no rest where one is needed", (1 + B) ** 2, 1 + 2 * B),
]


@pytest.mark.parametrize("step", HOLD, ids=lambda step: step.name)
def test_right_steps_hold(step):
    assert step.holds


@pytest.mark.parametrize("step", FAIL, ids=lambda step: step.name)
def test_wrong_steps_are_found_out(step):
    assert not step.holds
    assert hold(HOLD)
    assert not hold([*HOLD, step])


def test_first_order_is_the_part_linear_in_the_errors():
    e1, e2 = errors(2)
    assert first_order(X * (1 + e1) * (1 + e2) + Y * e1 * e2, (e1, e2)) == sp.expand(X * (e1 + e2))
    assert first_order(X / (1 + e1), (e1,)) == -X * e1
    assert first_order(X * (1 + e1) * (1 + e2), (e2,)) == sp.expand(X * e2 * (1 + e1))
    assert first_order(X + Y, (e1, e2)) == 0
