"""Simulate measurements of a model, block by block and identically on every machine."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gpbnb.arithmetic.definiteness import factor
from gpbnb.arithmetic.lanes import repeatable
from gpbnb.arithmetic.named import BINARY64
from gpbnb.filters.model import LinearModel

#: Steps for which one seeded generator draws the noise, so that a run can resume at any block.
BLOCK = 4096

#: Bits by which the resolution is finer than the noise.
FINE_BITS = 30


MOST_SIMULATED = 10**8
"""Largest number of steps to simulate. A small model takes about a second for a million steps."""

SINE_PERIOD = 100
"""Steps in a period of a simulated sine."""


@dataclass(frozen=True, eq=False)
class Simulation:
    """Measurements of a simulated truth, block by block and identical in every run.

    Parameters
    ----------
    model : model of the truth and of its measurement.
    start : (n,), the truth at step 0.
    seed : seed of the noise; ``default_rng([seed, b])`` draws block b.
    resolution : measurements are rounded to multiples of this unit, as in an analogue-to-digital converter; one number,
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
        roots = (
            np.array([covariance_root(each) for each in covariances]) for covariances in (self.model.Q, self.model.R)
        )
        return given["Phi"], next(roots), given["H"], next(roots)

    def block(
        self, number: int, truth: NDArray[np.float64], steps: int = BLOCK
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return the measurements of block `number`, (steps, m), at most 4096 steps, and the truth after them, (n,).

        They start from the truth before the first step, and are multiples of the resolution.
        """
        rng = np.random.default_rng([self.seed, number])
        w = rng.standard_normal((BLOCK, self.model.n))
        v = rng.standard_normal((BLOCK, self.model.m))
        x, z = np.array(truth, dtype=np.float64), np.empty((min(steps, BLOCK), self.model.m))
        measured(self._given, number * BLOCK, w, v, x, z)
        unit = np.asarray(self.resolution, dtype=np.float64)
        return np.rint(z / unit) * unit, x

    def measurements(self, steps: int) -> NDArray[np.float64]:
        """Return the first measurements, (steps, m)."""
        truth, blocks = np.array(self.start, dtype=np.float64), [np.empty((0, self.model.m))]
        for number in range(-(-steps // BLOCK)):
            z, truth = self.block(number, truth, steps - number * BLOCK)
            blocks.append(z)
        return np.concatenate(blocks)


def measured(
    matrices: tuple[NDArray[np.float64], ...],
    first: int,
    w: NDArray[np.float64],
    v: NDArray[np.float64],
    x: NDArray[np.float64],
    z: NDArray[np.float64],
) -> None:
    """Propagate the true state x by Phi plus a root of Q times w, and measure it by H plus a root of R times v.

    Matrices are Phi, the root of Q, H and the root of R, each with an axis of members that take turns; `first` steps
    were taken before. x (n,) and z (steps, m) are overwritten; entries beyond the range of float64 become infinite.
    """
    n, (steps, m) = len(x), z.shape
    shapes = ((n,), (n,), (m,), *(each.shape[1:] for each in matrices))
    drawn = (np.ones(count, np.bool_) for count in (n, n, m))
    nonzero = (*drawn, *((each != 0).any(axis=0) for each in matrices))
    step = repeatable(_measured, shapes, tuple(each.tobytes() for each in nonzero))
    loop = step.loop(BINARY64)
    cycles = zip(step.given[3:], matrices, strict=True)
    loop.feed([(int(at.flat[0]), each.reshape(len(each), -1)) for at, each in cycles])
    loop.keep(step.found[1])
    loop.states = x
    kept, _, _ = loop.take(first, steps, [(1 + n, w[:steps]), (1 + 2 * n, v[:steps])])
    z[: len(kept)], z[len(kept) :], x[:] = kept, math.inf, loop.states if len(kept) == steps else math.inf


def _measured(x: Any, w: Any, v: Any, Phi: Any, of_Q: Any, H: Any, of_R: Any) -> tuple[Any, Any]:
    after = np.concatenate([Phi, of_Q], axis=1) @ np.concatenate([x, w])
    return after, np.concatenate([H, of_R], axis=1) @ np.concatenate([after, v])


def fine_resolution(model: LinearModel) -> tuple[float, ...]:
    r"""Return a resolution far below the noise, in the units of each measurement, (m,).

    It is :math:`2^{\lfloor\log_2\sqrt{R_{ii}}\rfloor - 30}` for the least variance of a cycle. If units change by
    powers of two, so does the resolution; no answer depends on the choice.
    """
    least = [min(float(R[i, i]) for R in model.R) for i in range(model.m)]
    return tuple(2.0 ** ((math.frexp(variance)[1] - 1) // 2 - FINE_BITS) for variance in least)


def covariance_root(covariance: NDArray[Any]) -> NDArray[np.float64]:
    """Return a square root, computed by plain float64 operations that give the same result everywhere."""
    lower, d = factor(covariance)
    return lower.astype(np.float64) * np.sqrt(d.astype(np.float64))


def simulated_measurements(model: LinearModel, steps: int, seed: int = 0) -> NDArray[np.float64]:
    """Simulate measurements (steps, m) of a process that starts at the first estimate and has the known inputs.

    They are rounded to :func:`fine_resolution`. The response to inputs and offsets is added to
    measurements that are simulated without them.
    """
    if steps > MOST_SIMULATED:
        raise ValueError(
            f"got {steps:,} steps to simulate; needed at most {MOST_SIMULATED:,}: more take hours; try fewer, and see "
            "how the answer grows with their number"
        )
    model.check_steps(steps)
    start, resolution = tuple(map(float, model.x0)), fine_resolution(model)
    z = Simulation(model.without_inputs(), start, seed, resolution).measurements(steps)
    if not model.has_inputs:
        return z
    given, response, unit = model.to_float(), np.zeros(model.n), np.asarray(resolution)
    for k in range(steps):
        Phi, H = given["Phi"][k % len(given["Phi"])], given["H"][k % len(given["H"])]
        state, measurement = (part.astype(np.float64) for part in model.known(k))
        response = _times(Phi, response) + state
        z[k] += _times(H, response) + measurement
    return np.asarray(np.rint(z / unit) * unit)


def _times(a: NDArray[np.float64], x: NDArray[np.float64]) -> NDArray[Any]:
    """Multiply with sums from left to right, which are the same on every machine."""
    total = np.zeros(len(a))
    for column, value in zip(a.T, x, strict=True):
        total = total + column * value
    return total


def simulated_inputs(kind: str, level: Any, steps: int, m: int, seed: int = 0) -> NDArray[np.float64]:
    """Simulate inputs (steps, m) of a linear system.

    They are multiples of the smallest power of two that is at least the level over 2**16, like the readings of a 16-bit
    converter.

    Parameters
    ----------
    kind : "step", constant from the first step on; "sine", with a period of :data:`SINE_PERIOD` steps; or "noise",
        white and normal.
    level : height of the step or sine, or standard deviation of the noise; one number, or (m,).
    """
    if kind not in ("step", "sine", "noise"):
        raise ValueError(f'got inputs {kind!r}; needed "step", "sine" or "noise"')
    if steps > MOST_SIMULATED:
        raise ValueError(f"got {steps:,} steps to simulate; needed at most {MOST_SIMULATED:,}")
    given = np.asarray(level, dtype=np.float64)
    if given.shape not in ((), (m,)) or not (np.isfinite(given) & (given > 0)).all():
        raise ValueError(f"got level {level}; needed a finite number above 0, or one for each of the {m} inputs")
    shapes = {
        "step": lambda: np.ones((steps, m)),
        "sine": lambda: np.tile(np.sin(2 * np.pi * np.arange(1, steps + 1) / SINE_PERIOD)[:, np.newaxis], m),
        "noise": lambda: np.random.default_rng(seed).standard_normal((steps, m)),
    }
    unit = 2.0 ** np.ceil(np.log2(given) - 16)
    return np.asarray(np.rint(shapes[kind]() * given / unit) * unit)
