"""The arguments of benchmarks.formats, and its comparison of short formats with gfloat."""

from __future__ import annotations

import numpy as np
import pytest

from benchmarks import formats
from benchmarks.formats import arguments


def test_arguments_lie_at_and_beside_each_boundary():
    found = arguments(np.array([-1.0, 0.0, 2.0]))
    assert len(found) == 3 + 5 * 2 + 8 * 2
    assert {-1.0, 0.0, 2.0, -0.5, 1.0, 3.0, -1.5} <= {*found.tolist()}
    assert sorted(each for each in found.tolist() if 0.9 < each < 1.1) == [1 - 2.0**-29, 1, 1 + 2.0**-29]
    assert found.max() > 1e9
    assert found.min() < -5e8


def test_gfloat_agrees():
    pytest.importorskip("gfloat")
    rows, faults = formats.measure()
    assert faults == []
    assert len(rows) == len(formats.FORMATS)
