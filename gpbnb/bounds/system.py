r"""Bounds of the errors of a linear system's outputs, for ever or over a number of steps.

The error of an output is the difference from the system with the given coefficients. A system with an eigenvalue of
size 1 or more, such as a clock, an integrator or a running sum, keeps its errors, and no bound on them holds for ever.
Over N steps, the sums over earlier steps have N terms, and the same bounds hold with these terms alone.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from gpbnb.arithmetic.bounds import all_above
from gpbnb.arithmetic.fixed import FixedFormat
from gpbnb.arithmetic.formats import FloatFormat
from gpbnb.arithmetic.named import arithmetic
from gpbnb.bounds.certificate import Proof, first_proved, of_operations
from gpbnb.bounds.guess import Guess, constant_guess
from gpbnb.bounds.limited import limited_errors
from gpbnb.bounds.units import largest_errors
from gpbnb.filters.system import LinearSystem


def _largest(system: LinearSystem, largest: Any) -> NDArray[np.float64]:
    if any(system.x0):
        raise ValueError(f"got a first state {system.x0.tolist()}; needed x0 = 0 for a bound")
    return np.broadcast_to(all_above(largest), (system.m,))


def guessed_errors(
    system: LinearSystem, fmt: FloatFormat | FixedFormat, largest: Any, steps: int | None = None
) -> NDArray[np.float64]:
    """Return what :func:`output_errors` is going to prove, without a proof."""
    inputs = _largest(system, largest)
    if not system.as_filter().program.is_linear:
        return limited_errors(system, fmt, inputs, steps)
    return _guess(system, fmt, inputs, steps).bound[system.n :]


def _guess(
    system: LinearSystem, fmt: FloatFormat | FixedFormat, inputs: NDArray[np.float64], steps: int | None
) -> Guess:
    if steps is None and (cause := system.unstable(fmt)):
        raise ValueError(cause)
    if not np.isfinite(largest_errors(fmt, inputs)).all():
        raise ValueError(f"got inputs of up to {inputs}; needed inputs within the range of {arithmetic(fmt)}")
    found = constant_guess(system.as_filter(), fmt, inputs, steps, as_given=True)
    if found.why:
        raise ValueError(found.why)
    if not np.isfinite(found.state).all():
        over, cure = ("", "scale the inputs") if steps is None else (f" over {steps} steps", "take fewer steps")
        raise OverflowError(f"got a system whose largest gain{over} is beyond the range of float64; {cure}")
    if not np.isfinite(found.bound).all():
        why = "in this precision, an error causes rounding errors as large as itself"
        if fmt.limits is not None:
            why = f"a number may exceed the largest of {arithmetic(fmt)}"
        raise ValueError(f"no bound was found: {why}")
    return found


def output_errors(
    system: LinearSystem, fmt: FloatFormat | FixedFormat, largest: Any, steps: int | None = None
) -> NDArray[np.float64]:
    """Bound the error of each output, (p,), due to rounding and to storing coefficients and inputs.

    The bound of a linear system is proved by :mod:`gpbnb.bounds.check`.

    Parameters
    ----------
    system : a system that starts from rest.
    largest : limits on the size of the inputs before they are stored; one number, or (m,).
    steps : number of steps for which the bound holds; by default all time.

    Examples
    --------
    A clock that adds a tenth in each step, for 200 steps in 17 bits:

    >>> from gpbnb import FloatFormat, LinearSystem
    >>> clock = LinearSystem.sum(running=True)
    >>> bool(output_errors(clock, FloatFormat(2, 17), 0.1, steps=200)[0] < 0.05)
    True
    """
    inputs = _largest(system, largest)
    if not system.as_filter().program.is_linear:
        return limited_errors(system, fmt, inputs, steps)
    return output_proof(system, fmt, inputs, steps).bound[system.n :]


def output_proof(system: LinearSystem, fmt: FloatFormat | FixedFormat, largest: Any, steps: int | None = None) -> Proof:
    """Return the bounds of states and outputs of a linear system with their certificate; see :func:`output_errors`."""
    inputs, made = _largest(system, largest), system.as_filter()
    found = _guess(system, fmt, inputs, steps)
    proof = first_proved(found, lambda guess: of_operations(made, fmt, inputs, guess, steps, "as given"))
    if proof.why:
        raise ValueError(proof.why)
    return proof
