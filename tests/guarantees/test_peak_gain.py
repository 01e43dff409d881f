"""Peak gains against exact fractions, and guarantees of filters with poles near 1 against plain loops.

The loops are written from the textbook equations of a second-order section, on Python's integers and fractions.
"""

from __future__ import annotations

import json
from fractions import Fraction as F
from typing import Any

import numpy as np
import pytest
from scipy import signal

from gpbnb import FloatFormat, LinearSystem, limits
from gpbnb.bounds.check import prove
from gpbnb.bounds.gains import filter_schedule
from gpbnb.bounds.guarantee import from_schedule
from gpbnb.report.guarantees.peak_gain import peak_gain
from gpbnb.wordlength.required import judge

ONE = 2**300
"""A unit of fixed point, whose rounding errors are far below those that are measured."""


def cascade(order: int, frequency: float, rate: float, kind: str = "lowpass") -> tuple[Any, LinearSystem]:
    sections = signal.butter(order, frequency, kind, fs=rate, output="sos")
    return sections, LinearSystem.from_sections(sections)


def test_states_that_never_meet_have_no_gain() -> None:
    A, B, C = [["1/2", "0"], ["0", "1/4"]], [["3", "0"], ["0", "1"]], [["1", "0"], ["0", "5"]]
    found = peak_gain(A, B, C)
    assert found.low[0, 1] == found.high[0, 1] == found.low[1, 0] == found.high[1, 0] == 0
    for i, exactly in enumerate((F(6), F(20, 3))):
        assert F(found.low[i, i]) <= exactly <= F(found.high[i, i]) <= F(found.low[i, i]) * (1 + F(1, 2**39))


def test_a_peak_gain_counts_the_growth_before_a_power_contracts() -> None:
    """The norm of A is 8 and that of A squared is 17/4, and B grows to 8 before it decays."""
    A = [[F(1, 2), F(15, 2)], [F(0), F(1, 4)]]
    B, C, D = [[F(0)], [F(1)]], [[F(0), F(0)], [F(1), F(0)]], [[F(7, 8)], [F(-1, 4)]]
    response, exactly = np.array(B), F(1, 4)
    for _ in range(400):
        exactly, response = exactly + abs(response[0, 0]), np.array(A) @ response
    found = peak_gain(A, B, C, D)
    assert F(7, 8) <= F(found.high[0, 0]) < F(7, 8) * (1 + F(1, 2**48))
    assert F(found.low[1, 0]) <= exactly <= F(found.high[1, 0]) < exactly * (1 + F(1, 2**39))
    assert found.low[1, 0] >= float(exactly) * (1 - 2.0**-48)


# -- filters with poles near 1 ----------------------------------------------------------------------------------------


def impulse_response(sections: Any, steps: int, scale: int = ONE) -> list[int]:
    """The response to a unit impulse, in units of 1 / ONE, by the equations of direct form II transposed."""
    values = [ONE, *[0] * (steps - 1)]
    for row in sections:
        b0, b1, b2, _, a1, a2 = (int(F(float(c)) * ONE) for c in row)
        s1 = s2 = 0
        for k, u in enumerate(values):
            y = (b0 * u >> 300) + s1
            s1, s2 = (b1 * u - a1 * y >> 300) + s2, b2 * u - a2 * y >> 300
            values[k] = y
    return values


@pytest.mark.parametrize(
    ("order", "frequency", "rate", "kind"),
    [
        (2, 60, 48_000, "lowpass"),
        (3, 30, 96_000, "highpass"),
        (8, 100, 48_000, "lowpass"),
    ],
)
def test_peak_gains_of_slow_filters_are_those_of_a_plain_loop(
    order: int, frequency: float, rate: float, kind: str
) -> None:
    """The worst input has the signs of the response, and reaches the sum of its sizes."""
    sections, system = cascade(order, frequency, rate, kind)
    slowest = max(abs(root) for row in sections for root in np.roots(row[3:]))
    steps = int(12 / (1 - slowest))  # what is left decays from there, and is below a thousandth
    reached = float(F(sum(map(abs, impulse_response(sections, steps))), ONE))
    enclosed = peak_gain(system.A, system.B, system.C, system.D)
    assert reached <= enclosed.low[0, 0] <= enclosed.high[0, 0] <= reached * 1.001
    assert enclosed.high[0, 0] <= enclosed.low[0, 0] * (1 + 2.0**-39)


def test_a_low_frequency_has_a_guarantee_that_the_checker_proves() -> None:
    _, system = cascade(2, 20, 48_000)
    fmt = FloatFormat(2, 36)
    found = judge(system, fmt, np.ones((100, 1)), 1e-3, basis="guarantee", within=limits(measurement=1))
    assert found.met
    assert str(found).endswith("guaranteed for ever")
    made = filter_schedule(system.as_filter(), fmt)
    proof = from_schedule(made, limits(measurement=1.0), 1).certificate()
    assert "after any number of steps" in prove(json.loads(proof))
