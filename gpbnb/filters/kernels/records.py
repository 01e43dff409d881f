"""Compiled conversion of many records' estimates to float64, and their largest errors."""

from __future__ import annotations

from typing import Any

import numpy as np

from gpbnb.arithmetic.kernels.compiling import compiled

_POWERS = np.array([10.0**k for k in range(23)])  # exact


@compiled
def pairs_as_floats(pairs: Any, out: Any) -> None:
    """Convert decimal numbers, (steps, n, records, 2), to float64 with at most two roundings."""
    for k in range(out.shape[0]):
        for i in range(out.shape[1]):
            for j in range(out.shape[2]):
                m, e = np.float64(pairs[k, i, j, 0]), pairs[k, i, j, 1]
                if -22 <= e <= 0:
                    out[k, i, j] = m / _POWERS[-e]
                else:
                    out[k, i, j] = m * _POWERS[e] if 0 < e <= 22 else m * 10.0**e


@compiled
def update_largest(computed: Any, true: Any, largest: Any) -> None:
    """Raise `largest` (states, records) to the largest difference in any step; NaN counts as infinite."""
    for step in range(computed.shape[0]):
        for i in range(largest.shape[0]):
            for j in range(largest.shape[1]):
                error = abs(computed[step, i, j] - true[step, i, j])
                if not error <= largest[i, j]:
                    largest[i, j] = error if error == error else np.inf
