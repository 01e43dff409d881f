"""gpbnb.report.kalman.report_bounds: the counts of the report and its closing example."""

from __future__ import annotations

import pytest
import sympy as sp

from gpbnb.arithmetic.rational import exact
from gpbnb.report.kalman import derivation, report_bounds

# -- counts ---------------------------------------------------------------------------------------


def test_each_line_corrects_one_more_fault():
    faults = ("once", "free_signs", "carried")
    assert list(report_bounds.CORRECTIONS.values()) == [dict.fromkeys(faults[:k], True) for k in range(4)]


@pytest.mark.parametrize("faults", report_bounds.CORRECTIONS.values())
@pytest.mark.parametrize(("k", "n", "m"), [(1, 1, 1), (3, 2, 1), (4, 3, 5), (17, 10, 2), (3_153_600, 10, 2)])
def test_coefficients_are_those_derived(faults, k, n, m):
    c, d = derivation.ONCE if faults.get("once") else derivation.TWICE
    g = report_bounds.covariance_count(derivation.N, derivation.M) if faults.get("carried") else sp.S.Zero
    first = derivation.count_start(c, g)
    second = derivation.second_coefficient(c, d, g, 1 if faults.get("free_signs") else -1)
    values = {derivation.K: k, derivation.N: n, derivation.M: m}
    assert report_bounds.coefficients(k, n, m, **faults) == (first.subs(values), second.subs(values))


def test_the_printed_cases():
    n, m = 4, 3
    assert report_bounds.coefficients(3, n, m) == (3 * (7 * n + 3 * m + 6), 30 * n + 9 * m + 21)
    assert report_bounds.coefficients(4, n, m).second == 4 * (3 * n + 1) + 6 * (7 * n + 3 * m + 6)
    assert (
        report_bounds.prediction_count(n),
        report_bounds.covariance_count(n, m),
        report_bounds.gain_count(n, m),
    ) == (9, 17, 25)
    assert (report_bounds.transition_count(n, m), report_bounds.input_count(n, m)) == (38, 29)


def test_the_least_b():
    F = [exact([["1/2", 0], ["1/2", 2]]), exact([[0, 0], [0, 1]])]
    u = [exact([3, -5]), exact([0, 1])]
    assert report_bounds.printed_input_bound(F, u) == 5 * 2
    assert report_bounds.printed_input_bound([f / 4 for f in F], u) == 5
    with pytest.raises(ValueError, match="got 2 transitions and 1 inputs"):
        report_bounds.printed_input_bound(F, u[:1])
    with pytest.raises(ValueError, match="at least one"):
        report_bounds.printed_input_bound([], [])


# -- the closing example --------------------------------------------------------------------------


def test_the_closing_example():
    first, second = report_bounds.coefficients(*report_bounds.EXAMPLE)
    assert (first, second) == (258_595_200, 407_752_879_824_000)
    assert (report_bounds.precision_for_coefficient(first), report_bounds.precision_for_coefficient(second)) == (10, 16)
    assert report_bounds.precision_for_coefficient(second, base=2) == 49  # IEEE double has 53
