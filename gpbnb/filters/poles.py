"""Poles and frequency response of a digital filter, as given and with its coefficients stored in a format."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from gpbnb.arithmetic.fixed import FixedFormat
from gpbnb.arithmetic.formats import FloatFormat
from gpbnb.arithmetic.named import arithmetic
from gpbnb.arithmetic.rational import eigenvalues
from gpbnb.filters.system import LinearSystem
from gpbnb.filters.word_formats import WordFormats

_FLOOR = 60.0
"""Decibels below the peak of a response down to which its changes count."""


class StoredResponse(NamedTuple):
    """What storing its coefficients in a format does to a stable filter."""

    format: str  # in words
    pole: float  # size of the pole nearest to the unit circle, as given
    stored_pole: float  # the same, as stored
    change: float  # largest of the frequency response in dB, where it is at most 60 dB below its peak
    frequency: float  # where that change is, in cycles per sample

    def __str__(self) -> str:
        before, after = f"{self.pole:.9g}", f"{self.stored_pole:.9g}"
        moved = f"move the largest pole from size {before} to {after}, and the response"
        if before == after:
            moved = f"keep the largest pole at size {before}, to nine digits, and move the response"
        return (
            f"coefficients stored in {self.format} {moved} by up to {self.change:.2g} dB, at {self.frequency:.4g} of "
            f"the sampling rate, down to {_FLOOR:.0f} dB below its peak"
        )


def stored_response(system: LinearSystem, fmt: FloatFormat | FixedFormat | WordFormats) -> StoredResponse:
    """Compare poles and frequency response of a stable filter with those of its coefficients as a format stores them.

    The responses are computed in float64, on a grid that is fine near each pole.

    Raises
    ------
    ValueError : the filter is not stable, as given or as stored.
    OverflowError : a coefficient beyond the range of its format.

    Examples
    --------
    >>> from gpbnb import BINARY16, LinearSystem
    >>> found = stored_response(LinearSystem.from_coefficients(["0.01"], [1, "-0.99"]), BINARY16)
    >>> found.pole, round(found.stored_pole, 4), round(found.change, 2), found.frequency
    (0.99, 0.9902, 0.21, 0.0)
    """
    words = str(fmt) if isinstance(fmt, WordFormats) else arithmetic(fmt)
    if cause := system.unstable(fmt):
        raise ValueError(cause)
    stored = system.stored(fmt)
    poles, moved = eigenvalues(system.A), eigenvalues(stored[0])
    at = _frequencies(np.concatenate([poles, moved]))
    near = (system.A, system.B, system.C, system.D)
    given, other = (np.abs(_response(each, at)) for each in (_numbers(near), _numbers(stored)))
    heard = given >= given.max(axis=0) * 10 ** (-_FLOOR / 20)
    with np.errstate(divide="ignore", invalid="ignore"):
        change = np.where(heard & (given > 0), np.abs(20 * np.log10(other / given)), 0.0).max(axis=(1, 2))
    k = int(change.argmax())
    return StoredResponse(words, float(np.abs(poles).max()), float(np.abs(moved).max()), float(change[k]), float(at[k]))


def _numbers(given: tuple[Any, ...]) -> list[NDArray[np.float64]]:
    return [np.asarray(each, dtype=np.float64) for each in given]


def _frequencies(poles: NDArray[np.complex128]) -> NDArray[np.float64]:
    """Return frequencies from 0 to 1/2, with 33 within four times the distance of each pole from the unit circle."""
    beside = np.linspace(-4, 4, 33)[:, None] * np.maximum(1 - np.abs(poles), 1e-9) + np.abs(np.angle(poles))
    everywhere = [np.linspace(0, 0.5, 1001), np.logspace(-7, math.log10(0.5), 500)]
    found = np.concatenate([*everywhere, beside.ravel() / math.tau])
    return np.unique(found[(found >= 0) & (found <= 0.5)])


def _response(given: list[NDArray[np.float64]], frequencies: NDArray[np.float64]) -> NDArray[np.complex128]:
    """Return the response at frequencies in cycles per sample, (k, p, m)."""
    A, B, C, D = given
    z = np.exp(1j * math.tau * frequencies)[:, None, None]
    return np.asarray(C @ np.linalg.solve(z * np.eye(len(A)) - A, np.broadcast_to(B, (len(z), *B.shape))) + D)
