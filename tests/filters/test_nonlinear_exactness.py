"""A few runs of the comparison of nonlinear filters and systems with plain loops, and whether it can find a fault."""

from __future__ import annotations

from fractions import Fraction

import numpy as np
import pytest

from benchmarks import nonlinear
from gpbnb.filters.nonlinear_run import NonlinearRun

SEED = range(2026, 2027)


@pytest.mark.parametrize(
    ("fmt", "kind"),
    [
        ("8 digits of base 2, even", "UD, iterated"),
        ("24 digits of base 2, even", "innovation, iterated"),
        ("12 digits of base 10, down", "Joseph"),
        ("6 digits of base 16, chop", "UD"),
        ("Q9.30, nearest", "innovation"),
        ("Q5.10, chop", "unscented"),
    ],
)
def test_one_filter_of_each_kind(fmt, kind):
    count = nonlinear.compare(fmt, kind, SEED)
    assert count.compared > 0
    assert not count.different


@pytest.mark.parametrize("fmt", [*nonlinear.FORMATS, *nonlinear.LIMITED])
def test_systems_in_each_format(fmt):
    (count,) = nonlinear.run(SEED, range(4), (fmt,), ())
    assert count.compared == 4 * nonlinear.SYSTEM_STEPS * 8
    assert not count.different


def test_a_wrong_digit_and_a_step_too_many_are_found(monkeypatch):
    fmt, r = nonlinear.FORMATS["24 digits of base 2, even"]
    found, expected = nonlinear.stepped(0, fmt, lambda x: r(x) + Fraction(1, 10**9))
    assert found != expected
    steps = NonlinearRun._steps_taken
    monkeypatch.setattr(NonlinearRun, "_steps_taken", lambda self, z: steps(self, np.roll(np.asarray(z), 1, 0)))
    assert nonlinear.compare("24 digits of base 2, even", "innovation", SEED).different == len(nonlinear.MOTIONS)
