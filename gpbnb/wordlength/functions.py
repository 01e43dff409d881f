"""How well a format does for a function of your own, which is compared with itself in many more digits."""

from __future__ import annotations

import math
from fractions import Fraction
from inspect import signature
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from gpbnb.arithmetic.array import FloatArray, WholeNumberError
from gpbnb.arithmetic.elementary import DomainError
from gpbnb.arithmetic.exits import kept_in, lifted
from gpbnb.arithmetic.fixed import FixedFormat
from gpbnb.arithmetic.formats import FloatFormat
from gpbnb.arithmetic.named import arithmetic
from gpbnb.arithmetic.rounding import digit_unit, digits_text
from gpbnb.arithmetic.search import Outcome, largest_by_default
from gpbnb.arithmetic.traced import TracedFunction
from gpbnb.filters.model import real_numbers
from gpbnb.filters.nonlinear_system import NonlinearSystem
from gpbnb.filters.smoothing import FixedIntervalSmoother
from gpbnb.wordlength.asked import Asked, tolerances_of

SPARE_BITS = 37
"""Bits that the reference has beyond the highest precision; a second run that checks it has half as many again."""

SETTLED = 2.0**-20
"""Largest difference allowed between two references of a function, as a share of the tolerance."""

Prepared = TracedFunction | NonlinearSystem | FixedIntervalSmoother
"""What records its operations itself."""

STOPS = (ZeroDivisionError, OverflowError, DomainError, WholeNumberError, np.linalg.LinAlgError)
"""Errors that end a function in a format."""


class Referenced(NamedTuple):
    """A function, its inputs, `true`, its outputs in the reference, (steps, p), and their tolerances, (p,)."""

    run: Prepared
    z: NDArray[Any] | None
    true: NDArray[Any]
    tolerances: NDArray[np.float64]

    @property
    def untraced(self) -> str:
        """Why the user's function cannot be traced; empty if it can be."""
        return "" if isinstance(self.run, FixedIntervalSmoother) else self.run.refusal

    def errors(self, fmt: Any) -> NDArray[np.float64] | Outcome:
        """Return the largest error of each output, or why the function stops."""
        try:
            return _largest(exact_outputs(outputs_of(self.run, fmt, self.z, None)) - self.true)
        except STOPS as fault:
            return Outcome(math.inf, f"the function stops: {fault}", isinstance(fault, OverflowError))


def referenced(asked: Asked, base: int, most: int) -> Referenced:
    """Compute the reference of a function in more digits than `most`, and again in half as many again."""
    run, inputs, steps = asked.model, None if asked.z is None else real_numbers(asked.z), asked.steps
    if isinstance(run, FixedIntervalSmoother):
        if inputs is not None or steps != len(run.z):
            raise ValueError(f"got z for a smoother, which has its record; needed its number of steps, {len(run.z)}")
    elif inputs is None and isinstance(run, NonlinearSystem):
        raise ValueError(f"got a number of steps for {run.name}; needed its inputs, of shape (steps, {run.m})")
    made = run if isinstance(run, Prepared) else TracedFunction(run)
    digits = max(most, largest_by_default(base)) + math.ceil(SPARE_BITS / math.log2(base))
    short, true = (_reference(made, FloatFormat(base, each), inputs, steps) for each in (digits, digits * 3 // 2))
    tolerances = tolerances_of(asked.tolerance, true.shape[1], "outputs")
    off = float((_largest(short - true) / tolerances).max())
    if not off <= SETTLED:
        raise ValueError(
            f"got a function whose reference in {digits_text(digits, base)} is {off:.2g} times the tolerance from "
            f"that in {digits * 3 // 2}; needed one that settles; do comparisons, or the format itself, decide between "
            f"results far apart? If errors only grow, try highest={2 * digits}, which gives the reference more "
            f"{digit_unit(base)}"
        )
    return Referenced(made, inputs, true, tolerances)


def _largest(errors: NDArray[Any]) -> NDArray[np.float64]:
    """Return the largest size in each column of exact numbers."""
    return np.array([_float(max(abs(each) for each in column)) for column in errors.T])


def _reference(
    run: Prepared,
    fmt: FloatFormat,
    z: NDArray[Any] | None,
    steps: int | None,
) -> NDArray[Any]:
    try:
        return exact_outputs(outputs_of(run, fmt, z, steps))
    except STOPS as fault:
        raise type(fault)(
            f"the function stops in its reference of {digits_text(fmt.precision, fmt.base)}: {fault}"
        ) from None
    except AttributeError as fault:
        if not isinstance(fault.obj, FloatFormat):
            raise
        raise TypeError(
            f"got a function that asks for fmt.{fault.name}; needed one of any format, with fmt.array(...) and without "
            f"a second format, since its reference runs in {arithmetic(fmt)} of floating point"
        ) from None


def _float(value: Fraction) -> float:
    try:
        return float(value)
    except OverflowError:
        return math.inf


def exact_outputs(found: FloatArray) -> NDArray[Any]:
    """Return outputs as Fractions."""
    with lifted():  # the search may itself be part of a function that is searched
        return np.asarray(found.to_fractions(), dtype=object)


def outputs_of(
    run: Prepared,
    fmt: FloatFormat | FixedFormat,
    z: NDArray[Any] | None,
    steps: int | None,
) -> FloatArray:
    """Return the outputs of the function, (steps, p); it must compute them in the format."""
    with kept_in(fmt) as own:
        own.restart()
        given = (own,) if z is None else (own, own.array(z))
        try:
            signature(run).bind(*given)
        except TypeError as error:
            with_z = "f(fmt)" if z is None else "f(fmt, z)"
            raise TypeError(
                f"got a function that does not take {'a format fmt' if z is None else 'a format fmt and inputs z'}: "
                f"{error}; needed {with_z}{', or inputs in place of the number of steps' if z is None else ''}"
            ) from None
        except ValueError:  # a function of C without a signature
            pass
        found = run(*given)
    if isinstance(found, (list, tuple)) and found and all(isinstance(each, FloatArray) for each in found):
        found = np.stack(found)
    if not isinstance(found, FloatArray) or found.format != fmt:
        kind = f"a FloatArray in {found.format}" if isinstance(found, FloatArray) else f"a {type(found).__name__}"
        raise TypeError(
            f"got {kind} from the function; needed arrays of the format that it was given, {fmt}; round constants with "
            "fmt.array(...), and do not convert to floats on the way"
        )
    if found.ndim == 0:  # one result of all steps
        return found.reshape(1, 1)
    if found.ndim == 1:
        found = found.reshape(-1, 1)
    if found.ndim != 2 or not found.size or (z is None and steps not in (None, len(found))):
        raise ValueError(
            f"got outputs of shape {found.shape} from the function; needed ({steps or 'steps'},) or "
            f"({steps or 'steps'}, p), one output or more for each step"
        )
    return found
