"""Slow filters come near their bounds where the computed estimate stands still while the exact one moves on.

A constant measurement corrects the estimate by less than the rounding of its last sum takes away, in every step for
hundreds of steps. These are the filters whose old errors the checker merges.
"""

from __future__ import annotations

import json
from fractions import Fraction
from itertools import cycle
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from gpbnb import FilterGuarantee, FloatFormat, Form, LinearModel, Rounding, limits
from gpbnb.bounds.certificate import _APART
from gpbnb.bounds.guarantee import guarantee
from gpbnb.filters.forms import WITH_PROGRAM
from gpbnb.filters.program import ADD, MULTIPLY
from gpbnb.report.guarantees.filters import errors

REACHED = {Form.HUNG: 0.3, Form.HUNG_SECOND_GAIN: 0.3}
"""Least error / bound, 0.75 for other forms: Hung's have a product more, whose rounding an estimate fixes."""
STEADY = 2.0**-7
COURSES = 20
WITHIN = limits(state=1.7, innovation=1.2 * 2.0**-9 / STEADY)


def slow(x: Any = 0) -> LinearModel:
    """A filter of a constant whose gain is small from the first step on."""
    return LinearModel([[1]], [[1]], [[STEADY**2]], [[1]], [x], [[STEADY]], name="a slow filter")


def following(found: FilterGuarantee, x: NDArray[np.float64], z: NDArray[np.float64]) -> NDArray[np.float64]:
    """The computed estimates after one step with the settled gain."""
    program, fmt = found.schedule.program, found.schedule.fmt
    c = [fmt.array(float(each)) for each in found.schedule.coefficients[-1, :, 0]]
    values = [fmt.array(x), fmt.array(z)]
    for code, a, b in program.operations.tolist():
        values.append(
            c[a] * values[b] if code == MULTIPLY else values[a] + values[b] if code == ADD else values[a] - values[b]
        )
    return np.asarray(values[program.outputs[0]].to_float())


@pytest.mark.long  # attacks over hundreds of steps
@pytest.mark.parametrize(
    ("form", "rounding"), [*zip(WITH_PROGRAM, cycle([Rounding.NEAREST, Rounding.EVEN, Rounding.HALF_UP]))], ids=str
)
def test_an_estimate_that_stands_still_nearly_reaches_the_bound(form: Form, rounding: Rounding) -> None:
    fmt = FloatFormat(2, 10, rounding)
    found = guarantee(slow(), fmt, WITHIN, form)
    assert json.loads(found.certificate())["keep"] == _APART
    X, V, K = 1.7, float(WITHIN.innovation[0]), float(found.schedule.exact[-1, 0, 0, 0])
    x = np.arange(1, X, float(fmt.unit_roundoff) * 2)[:, None] * [[1, -1]]
    x, z = np.broadcast_arrays(x.reshape(-1, 1), fmt.array(x.reshape(-1, 1) + np.linspace(-1, 1, 51) * V).to_float())
    still = (following(found, x, z) == x) & (np.abs(z) <= X) & (np.abs(z - x) < V)  # the exact estimate tends to z
    i = np.unravel_index(np.where(still, np.abs(x - z), 0).argmax(), x.shape)
    model = slow(Fraction(float(x[i])))
    drawn: Any = SimpleNamespace(model=model, fmt=fmt, form=form, stored=model.rounded(fmt), within=WITHIN)
    steps = int(8 / K)
    off, _ = errors(drawn, np.full((steps, 1), z[i]))
    assert len(off) == steps
    assert REACHED.get(form, 0.75) * found.bound[0] < np.abs(off).max() <= found.bound[0]


@pytest.mark.long  # attacks over thousands of steps
@pytest.mark.parametrize("form", [Form.HUNG, Form.INNOVATION])
def test_a_slow_tracker_comes_near_its_bound(form: Form) -> None:
    """Its position moves by less than its last place in a step, or by a little more; the best of some courses."""
    fmt, q, rng = FloatFormat(2, 14), 2.0**-22, np.random.default_rng(55)
    w, unit, steps = (4 * q) ** 0.25, 2.0**-13, 2_000
    P, Q = [[w, w * w / 2], [w * w / 2, w**3 / 2]], [[q / 4, q / 2], [q / 2, q]]
    within = limits(state=[1.7, 2 * unit], innovation=2 * unit / w)
    made = lambda x: LinearModel([[1, 1], [0, 1]], [[1, 0]], Q, [[1]], x, P, name="a slow tracker")  # noqa: E731
    found = guarantee(made([0, 0]), fmt, within, form)
    assert json.loads(found.certificate())["keep"] == _APART
    reached = []
    for _ in range(COURSES):
        x = rng.uniform(0.9, 1.6), rng.uniform(-2, 2) * unit * rng.integers(2)
        model = made([fmt.round(each) for each in x])
        z = x[0] + x[1] * np.arange(1, steps + 1) + rng.uniform(-0.98, 0.98) * within.innovation[0]
        drawn: Any = SimpleNamespace(model=model, fmt=fmt, form=form, stored=model.rounded(fmt), within=within)
        off, _ = errors(drawn, z.reshape(-1, 1))
        reached.append(float((np.abs(off).max(axis=0, initial=0) / found.bound).max()))
    assert 0.3 < max(reached) <= 1
