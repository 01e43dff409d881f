"""What happens to numbers when a format stores them: by how much they move, and how large they become.

Errors are those of :func:`gpbnb.bounds.envelope.units`, which holds for every rounding, with underflow.
"""

from __future__ import annotations

import contextlib
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from gpbnb.arithmetic.bounds import above
from gpbnb.arithmetic.fixed import FixedFormat
from gpbnb.arithmetic.formats import FloatFormat
from gpbnb.arithmetic.rounding import Rounding
from gpbnb.bounds.envelope import largest_error, units


def storing_errors(fmt: FloatFormat | FixedFormat, sizes: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the largest error of storing a number of at most each size in a format; infinite beyond its range."""
    table = units(fmt)
    different, places = np.unique(sizes, return_inverse=True)
    return np.array([largest_error(table, float(size)) for size in different])[places].reshape(np.shape(sizes))


def stored_sizes(fmt: FloatFormat | FixedFormat, sizes: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the largest size of a number that was within each size before a format stored it.

    Rounding keeps the order of numbers, so this size is the stored limit, if it is larger. With stochastic rounding, it
    is the next number of the format. A limit beyond the range stays as it is.
    """
    upwards = replace(fmt, rounding=Rounding.UP) if fmt.rounding is Rounding.STOCHASTIC else fmt
    found = []
    different, places = np.unique(sizes, return_inverse=True)
    for size in different:
        largest = float(size)
        if np.isfinite(size):
            with contextlib.suppress(OverflowError):
                largest = max(largest, *(above(abs(upwards.round(sign * float(size)))) for sign in (1, -1)))
        found.append(largest)
    return np.array(found)[places].reshape(np.shape(sizes))
