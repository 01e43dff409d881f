"""Compare compiled terms with exact fractions, with larger allowances than those for roundings of float64."""

from __future__ import annotations

from fractions import Fraction as F
from typing import Any, NamedTuple

import numpy as np
import pytest

UNIT, UP = F(1, 64), 1 + F(1, 32)
"""In the place of 2**-53 and of 1 + 2**-40."""


class Distance(NamedTuple):
    """What a contraction bound says of a covariance: its weights and the distance in them."""

    L: Any
    zeta: float


def plain(function):
    """The function as Python runs it."""
    return getattr(function, "py_func", function)


def same(found, expected, rel=1e-13):
    """Compare arrays, or numbers, entry by entry."""
    found, expected = np.asarray(found, dtype=np.float64), np.asarray(expected, dtype=object)
    assert found.shape == expected.shape
    for at in np.ndindex(found.shape):
        assert found[at] == pytest.approx(float(expected[at]), rel=rel, abs=0), at


def fractions(values):
    return np.vectorize(F, otypes=[object])(np.asarray(values))
