"""Formats with any rounding and an unlimited range: zero as a term, and the seed."""

from __future__ import annotations

import pytest

from gpbnb.arithmetic.formats import FloatFormat
from gpbnb.arithmetic.kernels.exact import ZERO, kernel
from gpbnb.arithmetic.rounding import Rounding, Rules


@pytest.mark.parametrize("rounding", Rounding, ids=str)
@pytest.mark.parametrize("m", [19, -19])
def test_zero_added_to_a_number_of_any_size_changes_nothing(rounding: Rounding, m: int) -> None:
    form = kernel(Rules(2, 5, rounding))
    for e in (-1000, 0, 1000):
        assert form.add(m, e, *ZERO) == (m, e)
        assert form.add(*ZERO, m, e) == (m, e)
        assert form.fused(16, 0, *ZERO, m, e) == (m, e)
        assert form.fused(m, e, 16, -4, *ZERO) == (m, e)
    assert form.add(*ZERO, *ZERO) == ZERO


def test_rules_without_a_seed_are_those_of_a_format_without_one() -> None:
    fmt = FloatFormat(2, 5, Rounding.STOCHASTIC)
    assert fmt.kernel is kernel(Rules(2, 5, Rounding.STOCHASTIC))
    assert fmt.kernel is not FloatFormat(2, 5, Rounding.STOCHASTIC, seed=1).kernel
