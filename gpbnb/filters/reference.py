"""A filter in as many bits as necessary, for models whose reference double-double cannot compute.

The innovation form subtracts most of a large variance when a sensor is precise. It then loses as many digits as
:math:`HPH^T` is larger than R.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from fractions import Fraction
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gpbnb.arithmetic.formats import FloatFormat
from gpbnb.arithmetic.rational import exact
from gpbnb.filters.forms import Form
from gpbnb.filters.model import LinearModel
from gpbnb.filters.recording import block_algebra
from gpbnb.filters.repeating import RepeatedStep, StepTaken
from gpbnb.filters.steps import LinearStep

BITS = 256
"""Bits of the first run; each further run has twice as many."""

MOST_BITS = 4096
"""Bits of the last run."""

MOST_STEPS = 100_000
"""Largest number of steps; a thousand take roughly a second."""

AGREEMENT = 2.0**-104
"""Largest difference of two runs, relative to the largest value of each entry over all steps."""

SINGULAR = "the innovation covariance may be singular"
"""Why a reference is not determined, unless a run says more."""

Step = tuple[NDArray[Any], NDArray[Any], NDArray[Any]]


def precise_steps(model: LinearModel, z: Any) -> list[Step]:
    """Return estimate (n,), gain (n, m) and covariance (n, n) after every step, in bits that agree with twice as many.

    Parameters
    ----------
    model : also with known inputs and offsets.
    z : (steps, m), measurements.

    Returns
    -------
    steps : exact values of high-precision results, as Fractions.
    """
    measured = exact(z)
    return agreed(model.name, len(measured), lambda bits: _steps(model, measured, bits))


def agreed(name: str, count: int, steps: Callable[[int], list[Step] | str]) -> list[Step]:
    """Return steps in bits that agree with twice as many.

    Parameters
    ----------
    name : name of the model.
    count : number of steps.
    steps : function that returns all steps in a number of bits, or why they cannot be computed in them.
    """
    if count > MOST_STEPS:
        raise ArithmeticError(
            f"{name}: its reference needs more than double-double, and {count:,} steps; needed at most "
            f"{MOST_STEPS:,}: R is very small beside H P H', or P0 very large; scale or correct the model"
        )
    bits = BITS
    found: list[Step] | str = SINGULAR
    while bits <= MOST_BITS:
        before, found = found, steps(bits)
        if not isinstance(before, str) and not isinstance(found, str) and _agree(before, found):
            return found
        bits *= 2
    why = found if isinstance(found, str) else SINGULAR
    raise ArithmeticError(
        f"{name}: its reference is not determined in {MOST_BITS} bits; {why}: scale or correct the model"
    )


def _agree(some: list[Step], others: list[Step]) -> bool:
    """Whether two runs agree, relative to the largest value of each entry."""
    for k in range(3):
        one, other = (np.array([step[k] for step in steps]) for steps in (some, others))
        if np.any(np.max(np.abs(one - other), axis=0) > np.max(np.abs(other), axis=0) * Fraction(AGREEMENT)):
            return False
    return True


def _steps(model: LinearModel, z: NDArray[Any], bits: int) -> list[Step] | str:
    """Return all steps in some bits, or why there are none: an innovation covariance is singular in them."""
    fmt = FloatFormat(2, bits)
    given = {letter: each[np.newaxis] if each.ndim == 1 else each for letter, each in model.arrays(fmt).items()}
    x, P = given.pop("x0")[0], given.pop("P0")

    def take(formats: Sequence[Any], states: tuple[Any, ...], matrices: Sequence[Any]) -> StepTaken:
        (x, P, carried), (measured, *rest) = states, matrices
        step = LinearStep(Form.INNOVATION, block_algebra([*formats] * 4), dict(zip(given, rest, strict=True)))
        found = step.taken(x, P, carried, measured)
        return StepTaken((found.x, found.P, found.carried), found.K, found.definite)

    step, done = RepeatedStep(take, [fmt], (x, P, x * 0)), list[Step]()
    members = [list(each) for each in given.values()]
    try:
        for k, measured in enumerate(fmt.array(z)):
            step.take([measured, *(each[k % len(each)] for each in members)])
            done.append(tuple(each.to_fractions() for each in (step.states[0], step.gain, step.states[1])))
    except ZeroDivisionError:
        return SINGULAR
    return done
