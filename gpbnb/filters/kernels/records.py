"""Compiled conversion of many records' estimates to float64, and their largest errors."""

from __future__ import annotations

from typing import Any

import numpy as np

from gpbnb.arithmetic.kernels.bits import fma
from gpbnb.arithmetic.kernels.compiling import compiled

_POWERS = np.array([10.0**k for k in range(23)])  # exact


@compiled
def pairs_as_floats(pairs: Any, out: Any) -> None:
    """Convert decimal numbers, (steps, n, records, 2), to the nearest float64; NaN where that takes more digits."""
    for k in range(out.shape[0]):
        for i in range(out.shape[1]):
            for j in range(out.shape[2]):
                m, e = pairs[k, i, j, 0], pairs[k, i, j, 1]
                if m == 0:
                    out[k, i, j] = 0.0
                elif abs(m) > 2**53 or abs(e) > 22:
                    out[k, i, j] = np.nan
                else:
                    out[k, i, j] = np.float64(m) / _POWERS[-e] if e < 0 else np.float64(m) * _POWERS[e]


@compiled
def pairs_as_double_doubles(m: Any, e: Any, out: Any) -> Any:
    """Convert decimal numbers to the nearest double-doubles, (k, 2); returns the index of a longer one, or k."""
    for k in range(len(m)):
        x = np.float64(m[k])
        if abs(m[k]) >= 2**53 or abs(e[k]) > 22:
            return k
        power = _POWERS[abs(e[k])]  # exact, and so is the remainder of a product or of a quotient
        if e[k] < 0:
            out[k, 0] = x / power
            out[k, 1] = fma(-out[k, 0], power, x) / power
        else:
            out[k, 0] = x * power
            out[k, 1] = fma(x, power, -out[k, 0])
    return len(m)


@compiled
def update_largest(computed: Any, true: Any, largest: Any) -> None:
    """Raise `largest` (states, records) to the largest difference in any step; NaN counts as infinite."""
    for step in range(computed.shape[0]):
        for i in range(largest.shape[0]):
            for j in range(largest.shape[1]):
                error = abs(computed[step, i, j] - true[step, i, j])
                if not error <= largest[i, j]:
                    largest[i, j] = error if error == error else np.inf
