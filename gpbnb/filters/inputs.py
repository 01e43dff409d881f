"""Simulate measurements of a model with known inputs and offsets."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from gpbnb.filters.model import LinearModel
from gpbnb.filters.simulation import Simulation, fine_resolution

MOST_SIMULATED = 10**8
"""Largest number of steps to simulate. A small model takes about a second for a million steps."""


def simulated_measurements(model: LinearModel, steps: int, seed: int = 0) -> NDArray[np.float64]:
    """Simulate measurements (steps, m) of a truth that starts at the first estimate and gets the known inputs.

    They are rounded to :func:`gpbnb.filters.simulation.fine_resolution`. The response to inputs and offsets is added to
    measurements that are simulated without them.

    Raises
    ------
    ValueError : more steps than :data:`MOST_SIMULATED`, or than the model describes.
    """
    if steps > MOST_SIMULATED:
        raise ValueError(
            f"got {steps:,} steps to simulate; needed at most {MOST_SIMULATED:,}: more take hours; try fewer, and see "
            "how the answer grows with gpbnb.report.wordlengths.study.required_precision_by_steps"
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
