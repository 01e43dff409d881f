"""An answer in words."""

from __future__ import annotations

import numpy as np
import pytest

from gpbnb import (
    LinearModel,
    LinearSystem,
    limits,
    required_precision,
)

WALK = LinearModel([["0.9"]], [[1]], [["0.01"]], [[1]], [0], [[1]])


@pytest.mark.parametrize(("z", "leaves"), [([0.5] * 9, ""), ([0.5, 7, 0.5], "step 2: innovation 0 is 6.")])
def test_a_guarantee_says_that_the_given_run_leaves_its_limits(z, leaves):
    found = required_precision(WALK, z, 0.05, basis="guarantee", within=limits(state=9, innovation=5))
    assert found.met
    assert ("leaves the limits" in str(found)) is bool(leaves)
    assert leaves in str(found)
    system = LinearSystem([["0.9"]], [["0.1"]])
    proved = required_precision(system, np.array(z), 0.05, basis="guarantee", within=limits(measurement=5))
    assert ("input 0 reaches 7, above 5" in str(proved)) is bool(leaves)
