"""What each operation adds to a guarantee, against exact steps into which an error is put by hand."""

from __future__ import annotations

from fractions import Fraction

import numpy as np
import pytest

from gpbnb.arithmetic.formats import FloatFormat
from gpbnb.bounds.contributions import contributions
from gpbnb.bounds.guarantee import guarantee, limits
from gpbnb.bounds.probable import separate_roundings
from gpbnb.filters.forms import Form
from gpbnb.report.examples import cyclic, tracker
from gpbnb.report.guarantees import published
from tests.plain_program import steps_in_python
from tests.small_filter import named_operations

TRACKER = tracker(), limits(state=[1000, 30], innovation=8)


def cases():
    yield "tracker", *TRACKER, FloatFormat(2, 24), Form.INNOVATION
    yield "Hung's form", *TRACKER, FloatFormat(2, 24), Form.HUNG
    yield (
        "a period",
        cyclic(2, 1, cycle=3, decay=0.6),
        limits(state=100, innovation=10),
        FloatFormat(2, 24),
        Form.UD,
    )
    yield (
        "Nile",
        published.nile_local_level(),
        limits(state=1500, innovation=1200),
        FloatFormat(2, 24),
        Form.INNOVATION,
    )


@pytest.fixture(scope="module", params=cases(), ids=lambda case: case[0])
def found(request):
    _, model, within, fmt, form = request.param
    return guarantee(model, fmt, within, form=form)


def followed(found, operation, steps, first=-1):
    """Put an error of one into an operation of a step, the last of a period, and follow it, exactly for three steps."""
    given, program = found.schedule, found.schedule.program
    seen = -1

    def disturbed(value):
        nonlocal seen
        seen += 1
        return value + (seen == operation)

    x, period = [Fraction(0)] * program.n, given.steps - given.first
    for step in range(steps):
        row = given.coefficients[given.first + (first + step) % period]
        exact = [Fraction(float(high)) + Fraction(float(low)) for high, low in row]
        exact = exact if step < 3 else list(map(float, exact))
        x = [*(x if step < 3 else map(float, x)), *[0] * program.m]
        x = steps_in_python(named_operations(program), program.outputs, disturbed, exact, x)
        yield [float(each) for each in x]


def test_each_share_is_the_error_followed_through_exact_steps(found):
    given = contributions(found)
    period = found.schedule.steps - found.schedule.first
    for operation, error in enumerate(given.errors):
        path = np.array(list(followed(found, operation, 400 if period == 1 else 1)))
        assert given.effects[:, operation] == pytest.approx(path[0], rel=1e-12, abs=1e-15)
        if period == 1:
            assert given.sums[:, operation] == pytest.approx(error * np.abs(path).sum(axis=0), rel=1e-6, abs=1e-30)
            continue
        of_steps, total = separate_roundings(found)[2], np.zeros(found.schedule.program.n)
        for back in range(36):  # each error decays by 0.6 a step or more
            *_, end = followed(found, operation, back + 1, -1 - back)
            total += of_steps[(-1 - back) % period, operation] * np.abs(end)
        assert given.sums[:, operation] == pytest.approx(total, rel=1e-6, abs=1e-30)


def test_a_filter_that_never_settles_is_refused():
    ended = guarantee(published.elaenia_gold(), FloatFormat(2, 24), limits(state=2000, innovation=100))
    with pytest.raises(ValueError, match=r"got a guarantee for .* steps: .*; needed one that holds for ever"):
        contributions(ended)
