"""gpbnb.report.gravity_probe_b.answers: the digits that a year asks for."""

from __future__ import annotations

import numpy as np
import pytest

from gpbnb.report.gravity_probe_b import answers, year


def test_what_counts_is_the_year_and_not_its_end_alone():
    """Nine decimal digits end within the tolerance, and were beyond it before."""
    (nine,) = (run for run in year.load() if (run.case.base, run.case.precision) == (10, 9))
    assert max(np.abs(nine.drift[-1]).max(), np.abs(nine.rate[-1]).max()) < 1 < answers.largest(nine)
    assert answers.largest(nine) == np.abs(np.hstack([nine.drift, nine.rate])).max()


@pytest.mark.parametrize("size", [5.0, -5.0])
@pytest.mark.parametrize("part", ["drift", "rate"])
@pytest.mark.parametrize("place", [(0, 0), (-1, -1)])
def test_the_largest_error_may_be_of_any_step_state_and_sign(part, place, size):
    run = year.load()[0]
    zeros = {name: np.zeros_like(getattr(run, name)) for name in ("drift", "rate")}
    zeros[part][place] = size
    zeros[part][-1, 0] = size / 2 if place == (0, 0) else zeros[part][-1, 0]
    assert answers.largest(run._replace(**zeros)) == 5.0


def test_the_tolerance_itself_is_met_and_what_is_just_below_is_not():
    errors = answers.errors()
    for bits in (20, 32, 53):
        assert answers.fewest_bits(errors[bits]) == bits
        assert all(errors[fewer] > errors[bits] for fewer in errors if fewer < bits)
    with pytest.raises(ValueError, match=f"needed at least the least error, {errors[53]:.2g}"):
        answers.fewest_bits(0.999 * errors[53])
