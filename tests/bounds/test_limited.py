"""Bounds of systems that limit their values: against runs, against the linear bound, and where none exists."""

from __future__ import annotations

import numpy as np
import pytest

from gpbnb import FixedFormat, FloatFormat, LinearSystem
from gpbnb.bounds.limited import limited_errors

LEAKING = [
    {"Kd": "0.7", "leak": "0.99", "limits": (-1, 1)},
    {"Kd": "0.3", "leak": "0.9", "limits": ("-0.5", "0.7"), "back_calculation": "0.05"},
    {"leak": "0.95", "integral_limits": ("-0.3", "0.3"), "limits": (-1, 1)},
    {"Kd": "-0.4", "leak": "0.8", "integral_limits": ("-0.3", "0.2"), "limits": ("0.1", 1), "back_calculation": "0.1"},
]  # fmt: skip


@pytest.mark.parametrize("given", LEAKING, ids=str)
def test_no_run_is_beyond_its_bound(given):
    """Chopped errors have one sign, so that the bound is within a factor of 20 of some."""
    system, rng = LinearSystem.pid("0.8", "0.1", **given), np.random.default_rng(4)
    shares = []
    for fmt in (FloatFormat(2, 9), FloatFormat(2, 12, "chop"), FloatFormat(10, 4), FixedFormat(4, 9, "down")):
        bound = limited_errors(system, fmt, np.array([1.0]))[0]
        for swing in (1, 5, 40, 5000):  # the last is always positive
            e = np.clip(np.sign(np.sin(np.arange(600) / swing)) + rng.uniform(-0.2, 0.2, 600), -1, 1)[:, None]
            shares.append(np.abs((system.outputs(e, fmt) - system.outputs(e)).sum(axis=-1)).max() / bound)
    assert 1 / 20 < max(shares) <= 1
