"""Simulate measurements of a model, block by block and identically on every machine."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gpbnb.filters.covariance import factor
from gpbnb.filters.kernels.simulation import measured
from gpbnb.filters.model import LinearModel

#: Steps for which one seeded generator draws the noise, so that a run can resume at any block.
BLOCK = 4096

#: Bits by which the resolution is finer than the noise.
FINE_BITS = 30


@dataclass(frozen=True, eq=False)
class Simulation:
    """Measurements of a simulated truth, block by block and identical in every run.

    Parameters
    ----------
    model : model of the truth and of its measurement.
    start : (n,), the truth at step 0.
    seed : seed of the noise; ``default_rng([seed, b])`` draws block b.
    resolution : unit to whose multiples measurements are rounded, as in an analogue-to-digital converter; one number,
        or (m,).
    """

    model: LinearModel
    start: tuple[float, ...]
    seed: int
    resolution: float | tuple[float, ...]

    def __post_init__(self) -> None:
        self.model.refuse_inputs("a simulation")
        if len(self.start) != self.model.n:
            raise ValueError(f"got a start of {len(self.start)} numbers; needed {self.model.n}, one per state")
        given = np.asarray(self.resolution, dtype=np.float64)
        if given.shape not in ((), (self.model.m,)) or not ((given > 0) & (given < math.inf)).all():
            raise ValueError(
                f"got resolution {self.resolution}; needed a number above 0, or {self.model.m}, one per measurement"
            )

    @cached_property
    def _given(self) -> tuple[NDArray[np.float64], ...]:
        given = self.model.to_float()
        roots = (np.array([_root(each) for each in covariances]) for covariances in (self.model.Q, self.model.R))
        return given["Phi"], given["H"], *roots

    def block(
        self, number: int, truth: NDArray[np.float64], steps: int = BLOCK
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return measurements of at most 4096 steps after `number` blocks, given the truth there.

        Returns
        -------
        z : (steps, m), multiples of the resolution.
        truth : (n,), after these steps.
        """
        rng = np.random.default_rng([self.seed, number])
        w = rng.standard_normal((BLOCK, self.model.n))
        v = rng.standard_normal((BLOCK, self.model.m))
        x, z = np.array(truth, dtype=np.float64), np.empty((min(steps, BLOCK), self.model.m))
        measured(*self._given, number * BLOCK, w, v, x, z)
        unit = np.asarray(self.resolution, dtype=np.float64)
        return np.rint(z / unit) * unit, x

    def measurements(self, steps: int) -> NDArray[np.float64]:
        """Return the first measurements, (steps, m)."""
        truth, blocks = np.array(self.start, dtype=np.float64), [np.empty((0, self.model.m))]
        for number in range(-(-steps // BLOCK)):
            z, truth = self.block(number, truth, steps - number * BLOCK)
            blocks.append(z)
        return np.concatenate(blocks)


def fine_resolution(model: LinearModel) -> tuple[float, ...]:
    r"""Return a resolution far below the noise, in the units of each measurement, (m,).

    It is :math:`2^{\lfloor\log_2\sqrt{R_{ii}}\rfloor - 30}` for the least variance of a cycle. A change of units by
    powers of two changes it by the same powers, so it changes no answer.
    """
    least = [min(float(R[i, i]) for R in model.R) for i in range(model.m)]
    return tuple(2.0 ** ((math.frexp(variance)[1] - 1) // 2 - FINE_BITS) for variance in least)


def _root(covariance: NDArray[Any]) -> NDArray[np.float64]:
    """Return a square root, computed by plain float64 operations that give the same result everywhere."""
    lower, d = factor(covariance)
    return lower.astype(np.float64) * np.sqrt(d.astype(np.float64))
