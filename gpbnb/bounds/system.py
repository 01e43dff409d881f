r"""Bounds of the errors of a linear system's outputs, for ever or over a number of steps.

The error of an output is the difference from the system with the given coefficients. A system with an eigenvalue of
size 1 or more, such as a clock, an integrator or a running sum, keeps its errors, and no bound on them holds for ever.
Over N steps, the sums over earlier steps have N terms, and the same bounds hold with these terms alone.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gpbnb.arithmetic.bounds import all_above
from gpbnb.arithmetic.fixed import FixedFormat
from gpbnb.arithmetic.formats import FloatFormat
from gpbnb.arithmetic.named import arithmetic
from gpbnb.bounds.guarantee import Guarantee, from_schedule, limits
from gpbnb.bounds.limited import limited_errors
from gpbnb.bounds.linear import filter_schedule, transfer_gains
from gpbnb.bounds.storing import stored_sizes, storing_errors
from gpbnb.filters.system import LinearSystem

BUDGET = 2e7
"""Approximate number of multiplications for a bound over a number of steps, a fraction of a second."""


def rounding_bound(found: Guarantee) -> NDArray[np.float64]:
    """Return the error of each state and output that rounding alone can cause, (n + p,)."""
    return found.bound


def output_errors(
    system: LinearSystem,
    fmt: FloatFormat | FixedFormat,
    largest: Any,
    steps: int | None = None,
    rounding: Callable[[Guarantee], NDArray[np.float64]] = rounding_bound,
) -> NDArray[np.float64]:
    """Bound the error of each output, (p,), due to rounding and to storing coefficients and inputs.

    Outputs differ by at most the peak gain of the difference of the given and the stored system times the largest
    input, and the peak gain of the stored system times the largest error of storing an input, underflow included.

    Parameters
    ----------
    system : a system that starts from rest.
    largest : limits on the size of the inputs before they are stored; one number, or (m,).
    steps : number of steps for which the bound holds; by default all time.
    rounding : the error that rounding alone causes, from the guarantee of the stored system.

    Raises
    ------
    ValueError : no bound follows; the message says why. Or a first state other than zero.
    OverflowError : a number may be beyond the range of float64.

    Examples
    --------
    A clock that adds a tenth in each step, for 200 steps in 17 bits:

    >>> from gpbnb import FloatFormat, LinearSystem
    >>> clock = LinearSystem.sum(running=True)
    >>> bool(output_errors(clock, FloatFormat(2, 17), 0.1, steps=200)[0] < 0.05)
    True
    """
    if any(system.x0):
        raise ValueError(f"got a first state {system.x0.tolist()}; needed x0 = 0 for a bound")
    largest = np.broadcast_to(all_above(largest), (system.m,))
    if not system.as_filter().program.is_linear:
        return limited_errors(system, fmt, largest, steps)
    if steps is None and (cause := system.unstable(fmt)):
        raise ValueError(cause)
    given, n = system.as_filter(), system.n
    gains = transfer_gains(system, system.stored(fmt), steps)
    storing, sizes = storing_errors(fmt, largest), stored_sizes(fmt, largest)
    if not np.isfinite(storing).all():
        raise ValueError(f"got inputs of up to {largest}; needed inputs within the range of {arithmetic(fmt)}")
    state = np.concatenate([gains.states, gains.inputs]) @ sizes * (1 + 2.0**-40)
    if not np.isfinite(state).all():
        raise OverflowError("a state or an output may be beyond the range of float64; scale the numbers")
    within = limits(n + system.p, system.m, state=state, innovation=sizes, measurement=sizes)
    found = from_schedule(filter_schedule(given, fmt), within, 1 if steps is None else steps, BUDGET)
    if not found.for_ever and (steps is None or found.steps != steps):
        raise ValueError(found.why)
    # sums of m products in float64, with an error below 2**-40
    errors = rounding(found)[n:] + gains.difference @ largest + gains.inputs @ storing
    return np.asarray(errors * (1 + 2.0**-40))
