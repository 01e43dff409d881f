"""What a Kalman filter is given: a linear model, checked once."""

from __future__ import annotations

import math
from dataclasses import dataclass
from fractions import Fraction
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gpbnb.arithmetic.formats import FloatFormat
from gpbnb.arithmetic.rational import exact


@dataclass(frozen=True, eq=False)
class LinearModel:
    r"""A linear process and its measurements; hung1984, ch. II, before (98).

    .. math:: x_k = \Phi_{k-1} x_{k-1} + w_{k-1}, \qquad z_k = H_k x_k + v_k, \qquad
        w_k \sim N(0, Q_k),\ v_k \sim N(0, R_k)

    Each of the four matrices may be one for all steps, or a cycle of them with a leading axis: step k = 1, 2, … takes
    the member (k - 1) mod p, of each cycle with its own p. Entries are held exactly, as Fractions; numbers, strings
    and Decimals are read exactly too.

    Parameters
    ----------
    Phi : (n, n) or (p, n, n), transition.
    H : (m, n) or (p, m, n), measurement.
    Q : (n, n) or (p, n, n), covariance of the process noise, positive semidefinite.
    R : (m, m) or (p, m, m), covariance of the measurement noise, positive definite.
    x0 : (n,), the first estimate.
    P0 : (n, n), its covariance, positive semidefinite.
    name : what tables and figures call it.

    Raises
    ------
    ValueError : shapes that do not fit; NaN or infinity; a covariance that is not symmetric or not definite.
    """

    Phi: NDArray[Any]
    H: NDArray[Any]
    Q: NDArray[Any]
    R: NDArray[Any]
    x0: NDArray[Any]
    P0: NDArray[Any]
    name: str = "a linear model"

    def __post_init__(self) -> None:
        for letter in ("Phi", "H", "Q", "R", "x0", "P0"):
            try:
                entries = exact(getattr(self, letter))
            except (TypeError, ValueError) as error:
                raise type(error)(f"{letter}: {error}") from None
            if letter in ("Phi", "H", "Q", "R") and entries.ndim == 2:
                entries = entries[np.newaxis]
            entries.flags.writeable = False
            object.__setattr__(self, letter, entries)
        if self.x0.ndim != 1 or not self.x0.size:
            raise ValueError(f"got x0 of shape {self.x0.shape}; needed (n,) with n >= 1, one number a state")
        n = self.x0.size
        if self.H.ndim != 3 or 0 in self.H.shape or self.H.shape[2] != n:
            raise ValueError(
                f"got H of shape {self.H.shape[-2:]}; needed (m, {n}), a row a measurement and a column a state of x0"
            )
        m = self.H.shape[1]
        for letter, size in (("Phi", n), ("Q", n), ("R", m)):
            shape = getattr(self, letter).shape
            if len(shape) != 3 or shape[1:] != (size, size) or not shape[0]:
                raise ValueError(
                    f"got {letter} of shape {shape[-2:]}; needed ({size}, {size}), or a cycle (p, {size}, {size}): "
                    f"x0 has {n} states and H {m} measurements"
                )
        if self.P0.shape != (n, n):
            raise ValueError(f"got P0 of shape {self.P0.shape}; needed ({n}, {n}), as x0 has {n} states")
        for letter, matrices, strictly in (("Q", self.Q, False), ("R", self.R, True), ("P0", self.P0[None], False)):
            for matrix in matrices:
                _check_covariance(letter, matrix, strictly)

    @property
    def n(self) -> int:
        """How many states there are."""
        return int(self.x0.size)

    @property
    def m(self) -> int:
        """How many measurements a step brings."""
        return int(self.H.shape[1])

    @property
    def cycle(self) -> int:
        """After how many steps all four matrices begin again."""
        return math.lcm(*(len(each) for each in (self.Phi, self.H, self.Q, self.R)))

    def rounded(self, fmt: FloatFormat) -> LinearModel:
        """The model as a computer of this format stores it: each entry rounded.

        Raises
        ------
        ValueError : so few digits make a covariance indefinite.
        """
        stored = {letter: fmt.array(getattr(self, letter)).to_fractions() for letter in _LETTERS}
        return LinearModel(**stored, name=f"{self.name}, in {fmt}")

    def to_float(self) -> dict[str, NDArray[np.float64]]:
        """The nearest float64 of each entry, by letter."""
        return {letter: getattr(self, letter).astype(np.float64) for letter in _LETTERS}


_LETTERS = ("Phi", "H", "Q", "R", "x0", "P0")


def factor(covariance: NDArray[Any]) -> tuple[NDArray[Any], NDArray[Any]]:
    """Exact L and d of a symmetric matrix L diag(d) L', L lower with ones on its diagonal.

    Raises
    ------
    ValueError : the matrix is not positive semidefinite.
    """
    rest, n = covariance.copy(), len(covariance)
    lower = np.array([[Fraction(int(i == j)) for j in range(n)] for i in range(n)], dtype=object)
    d = np.array([Fraction(0)] * n, dtype=object)
    for j in range(n):
        d[j] = rest[j, j]
        if d[j] < 0 or (d[j] == 0 and np.any(rest[j + 1 :, j] != 0)):
            raise ValueError("not positive semidefinite")
        if d[j] > 0:
            lower[j + 1 :, j] = rest[j + 1 :, j] / d[j]
            rest[j + 1 :, j + 1 :] -= np.multiply.outer(lower[j + 1 :, j], rest[j, j + 1 :])
    return lower, d


def _check_covariance(letter: str, matrix: NDArray[Any], strictly: bool) -> None:
    if np.any(matrix != matrix.T):
        i, j = np.argwhere(matrix != matrix.T)[0]
        raise ValueError(
            f"got {letter} with {float(matrix[i, j])!r} at ({i}, {j}) and {float(matrix[j, i])!r} at ({j}, {i}); "
            f"needed a symmetric matrix; take ({letter} + {letter}.T) / 2 if you mean their mean"
        )
    needed = "definite" if strictly else "semidefinite"
    try:
        definite = bool(np.all(factor(matrix)[1] > 0)) or not strictly
    except ValueError:
        definite = False
    if not definite:
        values = np.linalg.eigvalsh(matrix.astype(np.float64))
        cure = ""
        if not strictly and abs(values[0]) < 2.0**-10 * abs(
            values[-1]
        ):  # such as G @ G.T in floats, or stored in few bits
            more = 2 * max(-values[0], 2.0**-52 * values[-1])
            cure = (
                "; it misses that by no more than roundings may: compute its entries as Fractions, or add a little to "
                f"its diagonal, {more:.0e} or more"
            )
        raise ValueError(
            f"got {letter} with a least eigenvalue near {values[0]:.3g}; needed a positive {needed} matrix: "
            f"no variance may be {'zero or ' if strictly else ''}negative, in any direction{cure}"
        )
