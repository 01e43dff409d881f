"""Handle measurements that are missing in some steps."""

from __future__ import annotations

from dataclasses import replace
from fractions import Fraction
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gpbnb.arithmetic.array import FloatArray
from gpbnb.arithmetic.fixed import FixedFormat
from gpbnb.arithmetic.formats import FloatFormat
from gpbnb.arithmetic.rational import exact
from gpbnb.filters.blocks import BlockFormats
from gpbnb.filters.model import LinearModel


def real_numbers(values: Any) -> NDArray[Any]:
    """Return measurements as an array of float64 or whole numbers, or of Fractions if those cannot hold them exactly.

    Raises
    ------
    ValueError, TypeError : an entry is masked, or is not a real number; rows have different lengths; a longdouble that
        float64 does not hold, beside one that is NaN or infinite.
    """
    if np.ma.is_masked(values):
        raise ValueError("got measurements of which some are masked; needed a number for each")
    try:
        given = np.asarray(values)
    except ValueError:
        raise ValueError("got measurements in rows of different lengths; needed (steps, m) numbers") from None
    if given.dtype.kind in "iu":
        return given
    if given.dtype.kind == "f":
        with np.errstate(over="ignore", under="ignore"):
            nearest = given.astype(np.float64, copy=False)
        if np.array_equal(nearest, given, equal_nan=True):
            return nearest
    try:
        return exact(given if given.dtype.kind == "f" else values)
    except TypeError as error:
        raise TypeError(f"measurements: {error}") from None
    except ValueError as error:
        raise ValueError(f"measurements: {error}") from None


def stored_measurements(z: Any, fmt: FloatFormat | FixedFormat | BlockFormats) -> FloatArray:
    """Round measurements into a format.

    Raises
    ------
    OverflowError : a measurement beyond the range of the format.
    """
    try:
        return fmt.array(z)
    except OverflowError as error:
        raise OverflowError(f"measurements: {error}") from None


def without_missing(model: LinearModel, z: Any) -> tuple[LinearModel, Any]:
    """Return a model for the measurements of each step, and the measurements with zeros in place of missing ones.

    A missing measurement gets a row of zeros in H, and its noise is uncorrelated with the others. Its column of the
    gain is then exactly zero in every form and format, so estimate and covariance are those of a step without it.

    Parameters
    ----------
    z : (steps, m), with NaN for missing measurements, or a masked array.

    Returns
    -------
    model, z : unchanged if nothing is missing.
    """
    if isinstance(z, np.ma.MaskedArray):
        missing = np.array(np.ma.getmaskarray(z))
        given = np.array(np.ma.getdata(z))
        given[missing] = 0
        given = real_numbers(given)
    else:
        given = real_numbers(z)
        missing = np.zeros(given.shape, dtype=bool)
    if given.dtype.kind == "f":
        missing |= np.isnan(given)
    if given.ndim != 2 or given.shape[1] != model.m or not missing.any():
        return model, given
    H, R = [], []
    for k, gone in enumerate(missing):
        h, r = model.H[k % len(model.H)], model.R[k % len(model.R)]
        if gone.any():
            h, r = h.copy(), r.copy()
            h[gone] = Fraction(0)
            apart = (gone[:, None] | gone[None, :]) & ~np.eye(model.m, dtype=bool)
            r[apart] = Fraction(0)
        H.append(h)
        R.append(r)
    filled = given.copy()
    filled[missing] = 0
    return replace(model, H=np.array(H, dtype=object), R=np.array(R, dtype=object)), filled
