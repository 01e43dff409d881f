"""The numbers of an emulated run, compared with fractions rounded step by step."""

from __future__ import annotations

from fractions import Fraction

import pytest

from gpbnb import FixedFormat, FloatFormat, LinearModel, LinearSystem, WordFormats, emulate

U = [Fraction(k**3 % 17, 7) for k in range(40)]


@pytest.mark.parametrize("rounding", ["even", "up", "down", "odd"])
@pytest.mark.parametrize("base", [2, 10])
def test_a_run_has_the_digits_of_its_format(base, rounding):
    """In base 10, a double-double is only near a number of the format, which a directed rounding would leave."""
    fmt = FloatFormat(base, 12, rounding)
    a, b, x, found = fmt.round("-2/3"), fmt.round("0.3"), Fraction(0), []
    for u in U:
        found.append(x := fmt.round(fmt.round(a * x) + fmt.round(b * fmt.round(u))))
    run = emulate(LinearSystem([["-2/3"]], [["0.3"]]), [[u] for u in U], fmt)
    assert run.x.to_fractions().ravel().tolist() == found
    x, P = Fraction(0), Fraction(1)
    estimates = []
    for u in U:
        P = fmt.round(P + fmt.round("0.3"))
        K = fmt.round(P * fmt.round(1 / fmt.round(P + 1)))
        x = fmt.round(x + fmt.round(K * fmt.round(fmt.round(u) - x)))
        P = fmt.round(fmt.round(1 - K) * P)
        estimates.append(x)
    run = emulate(LinearModel([[1]], [[1]], [["0.3"]], [[1]], [0], [[1]]), U, fmt)
    assert run.x.to_fractions().ravel().tolist() == estimates


@pytest.mark.parametrize("fmt", ["Q1.10", FloatFormat(2, 9, emin=-9, emax=0), WordFormats(FixedFormat(1, 10))], ids=str)
def test_a_number_beyond_the_format_is_refused_not_run_for_no_steps(fmt):
    with pytest.raises(OverflowError, match="D1_1"):
        emulate(LinearSystem([[0]], [[1]], [[0]], [[200]]), U, fmt)
    with pytest.raises(OverflowError, match="x0"):
        emulate(LinearSystem([[0]], [[1]], x0=[200]), U, fmt)
    later = emulate(LinearSystem([[1]], [["1/4"]]), [0.5, 1, 1.5] * 9, fmt)  # an overflow of a result ends the run
    assert 0 < later.steps < 27
    assert f"at step {later.steps + 1}" in later.reason
