"""Checks of arguments for the closed forms of digital integration."""

from __future__ import annotations

import math
from numbers import Number

import numpy as np
from numpy.typing import ArrayLike, NDArray

Floats = NDArray[np.float64]


def _numbers(name: str, values: ArrayLike) -> Floats:
    """Return numbers as float64; text and truth values are no numbers."""
    try:
        given = np.asarray(values)
        if given.dtype.kind in "iuf" or (
            given.dtype.kind == "O" and all(isinstance(each, Number) for each in given.ravel().tolist())
        ):
            return given.astype(np.float64)
    except (TypeError, ValueError, OverflowError):
        pass
    raise ValueError(f"got {name} = {values!r}; needed a number, or an array of numbers")


def positive_array(name: str, values: ArrayLike) -> Floats:
    """Return positive, finite numbers as an array; raise ValueError otherwise."""
    array = _numbers(name, values)
    allowed = (array > 0) & np.isfinite(array)
    if not np.all(allowed):
        bad = array[~allowed].ravel()[0]
        raise ValueError(f"got {name} = {bad}; needed a positive, finite number; check its unit and sign")
    return array


def positive_number(name: str, value: float) -> float:
    """Return one positive, finite number; raise ValueError otherwise."""
    array = positive_array(name, value)
    if array.ndim:
        raise ValueError(f"got {name} of shape {array.shape}; needed one number; call it once for each")
    return float(array)


def bandwidth_ratio(omega_bw: float, f_c: float) -> float:
    """Return μ, bandwidth in rad/s over iteration rate in Hz; raise ValueError if it leaves the range of float64."""
    mu = positive_number("omega_bw", omega_bw) / positive_number("f_c", f_c)
    if not 0 < mu < math.inf:
        raise ValueError(f"got omega_bw / f_c = {mu}; needed a ratio within the range of float64; check the units")
    return mu


def cycle_counts(n: ArrayLike) -> Floats:
    """Return numbers of cycles, at least 0 and finite; raise ValueError otherwise."""
    array = _numbers("n", n)
    if not np.all((array >= 0) & (array < np.inf)):
        raise ValueError(f"got n = {n!r}; needed cycles, at least 0 and finite")
    return array
