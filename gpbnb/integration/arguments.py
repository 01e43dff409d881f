"""Arguments of the closed forms of digital integration, checked."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike, NDArray

Floats = NDArray[np.float64]


def positive_array(name: str, values: ArrayLike) -> Floats:
    """Positive, finite numbers as an array; ValueError otherwise."""
    array = np.asarray(values, dtype=np.float64)
    if not np.all((array > 0) & (array < np.inf)):
        bad = array[~((array > 0) & (array < np.inf))].flat[0]
        raise ValueError(f"got {name} = {bad}; needed a positive, finite number; check its unit and sign")
    return array


def positive_number(name: str, value: float) -> float:
    """One positive, finite number; ValueError otherwise."""
    array = positive_array(name, value)
    if array.ndim:
        raise ValueError(f"got {name} of shape {array.shape}; needed one number; call it once for each")
    return float(array)


def bandwidth_ratio(omega_bw: float, f_c: float) -> float:
    """The ratio μ of bandwidth in rad/s and iteration rate in Hz; ValueError where it leaves the range of float64."""
    mu = positive_number("omega_bw", omega_bw) / positive_number("f_c", f_c)
    if not 0 < mu < math.inf:
        raise ValueError(f"got omega_bw / f_c = {mu}; needed it within the range of float64; check the units")
    return mu


def cycle_counts(n: ArrayLike) -> Floats:
    """Numbers of cycles, at least 0 and finite; ValueError otherwise."""
    array = np.asarray(n, dtype=np.float64)
    if not np.all((array >= 0) & (array < np.inf)):
        raise ValueError(f"got n = {n!r}; needed cycles, at least 0 and finite")
    return array
