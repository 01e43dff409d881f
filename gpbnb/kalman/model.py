"""What a Kalman filter is given: a linear model, checked once."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gpbnb.arithmetic.formats import FloatFormat
from gpbnb.arithmetic.rational import exact
from gpbnb.kalman.covariance import Repair, check_covariance, in_floats, repaired


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
    repair : whether to undo roundings in Q, R and P0, as :mod:`gpbnb.kalman.covariance` states. By default only in
        those that are given in floats; covariances of strings, whole numbers and Fractions are taken at their word.

    Attributes
    ----------
    repairs : what was changed; empty if nothing was.

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
    repair: bool | None = None
    repairs: tuple[Repair, ...] = field(default=(), init=False)

    def __post_init__(self) -> None:
        repairable = {
            letter: in_floats(getattr(self, letter)) if self.repair is None else self.repair
            for letter in ("Q", "R", "P0")
        }
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
            raise ValueError(f"got x0 of shape {self.x0.shape}; needed (n,) with n >= 1, one number per state")
        n = self.x0.size
        if self.H.ndim != 3 or 0 in self.H.shape or self.H.shape[2] != n:
            raise ValueError(
                f"got H of shape {self.H.shape[-2:]}; needed (m, {n}), one row per measurement and "
                "one column per state of x0"
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
        repairs: list[Repair] = []
        for letter, strictly in (("Q", False), ("R", True), ("P0", False)):
            matrices = getattr(self, letter)
            if repairable[letter]:
                object.__setattr__(self, letter, _repaired_cycle(letter, matrices, strictly, repairs))
                continue
            for matrix in matrices.reshape(-1, *matrices.shape[-2:]):
                check_covariance(letter, matrix, strictly)
        object.__setattr__(self, "repairs", tuple(repairs))

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


def _repaired_cycle(letter: str, matrices: NDArray[Any], strictly: bool, repairs: list[Repair]) -> NDArray[Any]:
    """The covariances of a cycle, or the only one, each repaired where it needs to be; `repairs` gets the changes."""
    result = []
    for member, matrix in enumerate(matrices.reshape(-1, *matrices.shape[-2:])):
        sound, changed = repaired(letter, member, matrix, strictly)
        result.append(sound)
        if changed is not None:
            repairs.append(changed)
    whole = np.array(result, dtype=object).reshape(matrices.shape)
    whole.flags.writeable = False
    return whole
