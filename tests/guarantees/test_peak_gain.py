"""Peak gains against exact fractions and SciPy's impulse responses, and a guarantee of a filter with a pole near 1."""

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
from gpbnb.report.guarantees.comparison import peak_gain
from gpbnb.wordlength.required import judge


def cascade(order: int, frequency: float, rate: float, kind: str = "lowpass") -> tuple[Any, LinearSystem]:
    sections = signal.butter(order, frequency, kind, fs=rate, output="sos")
    return sections, LinearSystem.from_sections(sections)


def test_a_peak_gain_counts_the_growth_before_a_power_contracts() -> None:
    """The norm of A is 8 and that of A squared is 17/4, and B grows to 8 before it decays."""
    A = [[F(1, 2), F(15, 2)], [F(0), F(1, 4)]]
    B, C, D = [[F(0)], [F(1)]], [[F(0), F(0)], [F(1), F(0)]], [[F(7, 8)], [F(-1, 4)]]
    response, exactly = np.array(B), F(1, 4)
    for _ in range(400):
        exactly, response = exactly + abs(response[0, 0]), np.array(A) @ response
    assert peak_gain(A, B, C, D)[:, 0] == pytest.approx([7 / 8, float(exactly)], rel=1e-14)


@pytest.mark.parametrize(
    ("order", "frequency", "rate", "kind"),
    [
        (2, 60, 48_000, "lowpass"),
        (3, 30, 96_000, "highpass"),
        (8, 100, 48_000, "lowpass"),
    ],
)
def test_peak_gains_of_slow_filters_are_those_of_scipy(order: int, frequency: float, rate: float, kind: str) -> None:
    """The worst input has the signs of the response, and reaches the sum of its sizes."""
    sections, system = cascade(order, frequency, rate, kind)
    slowest = max(abs(root) for row in sections for root in np.roots(row[3:]))
    steps = int(30 / (1 - slowest))  # what is left decays from there
    reached = np.abs(signal.sosfilt(sections, np.eye(1, steps)[0])).sum()
    # float64 in both, with sums over thousands of steps
    assert peak_gain(system.A, system.B, system.C, system.D)[0, 0] == pytest.approx(reached, rel=1e-8)


def test_a_low_frequency_has_a_guarantee_that_the_checker_proves() -> None:
    _, system = cascade(2, 20, 48_000)
    fmt = FloatFormat(2, 36)
    found = judge(system, fmt, np.ones((100, 1)), 1e-3, basis="guarantee", within=limits(measurement=1))
    assert found.met
    assert str(found).endswith("guaranteed for ever")
    made = filter_schedule(system.as_filter(), fmt)
    proof = from_schedule(made, limits(measurement=1.0), 1).certificate()
    assert "after any number of steps" in prove(json.loads(proof))
