"""A filter in as many bits as necessary, for models whose reference double-double cannot compute.

The innovation form subtracts most of a large variance when a sensor is precise. It then loses as many digits as
:math:`HPH^T` is larger than R.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, NamedTuple, cast

import numpy as np
from numpy.typing import NDArray

from gpbnb.arithmetic.array import FloatArray
from gpbnb.arithmetic.formats import FloatFormat
from gpbnb.arithmetic.rational import exact
from gpbnb.filters.checkpoints import Checkpoints
from gpbnb.filters.forms import Form
from gpbnb.filters.model import LinearModel
from gpbnb.filters.recording import block_algebra
from gpbnb.filters.repeating import RepeatedStep
from gpbnb.filters.steps import LinearStep, StepTaken

FEW_BITS = 40
"""Bits of the first run, which compiled loops compute."""

BITS = 256
"""Bits of the second run; each further run has twice as many."""

MOST_BITS = 4096
"""Bits of the last run."""

MOST_STEPS = 100_000
"""Largest number of steps; a thousand take roughly a second."""

AGREEMENT = 104
"""Bits in which two runs agree, relative to the largest value of each entry over all steps, unless the first is short.

If the first run has 40 bits, 20 are enough, because the second run has 216 bits more. Its error is then below 2**-104
even if errors were as large as the square roots of roundings.
"""

SINGULAR = "the innovation covariance may be singular"
"""Why a reference is not determined, unless a run says more."""


class PreciseSteps(NamedTuple):
    """Estimates (steps, n), gains (steps, n, m) and covariances (steps, n, n) after every step."""

    x: FloatArray
    K: FloatArray
    P: FloatArray

    def checkpoints(self, steps: Sequence[int] | NDArray[np.int64]) -> Checkpoints:
        """Return the exact values after some steps, which count from 1."""
        rows = [int(step) - 1 for step in steps]
        return Checkpoints(tuple(row + 1 for row in rows), *(each[rows].to_fractions() for each in self))


def precise_steps(model: LinearModel, z: Any) -> PreciseSteps:
    """Return all steps with measurements z, (steps, m), in bits that agree with a run in fewer bits."""
    measured = exact(z)
    return agreed(model.name, len(measured), lambda bits: _steps(model, measured, bits))


def agreed(name: str, count: int, steps: Callable[[int], PreciseSteps | str]) -> PreciseSteps:
    """Return steps of a named model in bits that agree with a run in fewer bits.

    A function returns all of them in a number of bits, or says why they cannot be computed in these.
    """
    if count > MOST_STEPS:
        raise ArithmeticError(
            f"{name}: its reference needs more than double-double, and {count:,} steps; needed at most "
            f"{MOST_STEPS:,}: R is very small beside H P H', or P0 very large; scale or correct the model"
        )
    bits, agreement = BITS, FEW_BITS // 2
    try:
        found = steps(FEW_BITS)
    except ValueError:  # a covariance is not definite in so few bits, or any run raises the same error
        found = SINGULAR
    while bits <= MOST_BITS:
        before, found = found, steps(bits)
        if not isinstance(before, str) and not isinstance(found, str) and _agree(before, found, agreement):
            return found
        bits, agreement = 2 * bits, AGREEMENT
    why = found if isinstance(found, str) else SINGULAR
    raise ArithmeticError(
        f"{name}: its reference is not determined in {MOST_BITS} bits; {why}: scale or correct the model"
    )


def _agree(some: PreciseSteps, others: PreciseSteps, bits: int) -> bool:
    """Whether two runs agree in some bits, relative to the largest value of each entry."""
    for each in zip(some, others, strict=True):
        pairs = [one.to_pairs() for one in each]
        least = min(int(e.min()) for _, e in pairs)
        one, other = (m * 2 ** (e - least) for m, e in pairs)
        if np.any(np.abs(one - other).max(axis=0) * 2**bits > np.abs(other).max(axis=0)):
            return False
    return True


def _steps(model: LinearModel, z: NDArray[Any], bits: int) -> PreciseSteps | str:
    """Return all steps in some bits, or why there are none: an innovation covariance is singular in them."""
    fmt = FloatFormat(2, bits)
    given = {letter: each[np.newaxis] if each.ndim == 1 else each for letter, each in model.arrays(fmt).items()}
    x, P = given.pop("x0")[0], given.pop("P0")

    def take(formats: Sequence[Any], states: tuple[Any, ...], matrices: Sequence[Any]) -> StepTaken:
        measured, *rest = matrices
        step = LinearStep(Form.INNOVATION, block_algebra([*formats] * 4), dict(zip(given, rest, strict=True)))
        return step.taken(states, measured)

    step = RepeatedStep(take, [fmt], (x, P), list(given.values()))
    try:
        return joined([(each.states[0], each.gain[0], each.states[1]) for each in step.take(fmt.array(z))])
    except ZeroDivisionError:
        return SINGULAR


def joined(parts: Sequence[tuple[FloatArray, FloatArray, FloatArray]]) -> PreciseSteps:
    """Return estimates, gains and covariances of some steps after others."""
    x, K, P = (cast(Any, np.concatenate)(each) for each in zip(*parts, strict=True))
    return PreciseSteps(x, K, P)
