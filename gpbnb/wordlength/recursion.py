"""Find the precision for your own recursion, a function written with arrays of a format."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from fractions import Fraction
from inspect import signature
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gpbnb.arithmetic.array import FloatArray, WholeNumberError
from gpbnb.arithmetic.elementary import DomainError
from gpbnb.arithmetic.exits import kept_in, lifted
from gpbnb.arithmetic.fixed import FixedFormat
from gpbnb.arithmetic.formats import FloatFormat
from gpbnb.arithmetic.rounding import digit_unit, digits_text
from gpbnb.arithmetic.search import CHECKED, Outcome, largest_by_default
from gpbnb.arithmetic.traced import TracedFunction
from gpbnb.filters.model import real_numbers
from gpbnb.filters.named import whole_number
from gpbnb.filters.smoothing import FixedIntervalSmoother
from gpbnb.wordlength.requirement import Asked, Basis, Requirement, checked_tolerance, largest_ratio

Recursion = Callable[..., Any]
"""A function ``run(fmt, z)``, or ``run(fmt)`` without z, that returns the outputs of all steps in the format."""

SPARE_BITS = 37
"""Bits that the reference has beyond the highest precision; a second run that checks it has half as many again."""

_STOPS = (ZeroDivisionError, OverflowError, DomainError, WholeNumberError, np.linalg.LinAlgError)

SETTLED = 2.0**-20
"""Largest difference allowed between the two runs of the reference, as a share of the tolerance."""


def required_recursion_precision(run: Recursion, asked: Asked, tolerance: Any, z: Any = None) -> Requirement:
    """Find the smallest precision with which a recursion stays within a tolerance.

    Parameters
    ----------
    run : function of a format, and of `z` rounded into it. It returns an output for each step, as one array (steps,) or
        (steps, p), or as a list of arrays. All operations must be in the format; write constants as
        ``fmt.array("0.1")``. Pass data that the function takes from elsewhere through ``fmt.array``, too, before any
        operation: operations before that are not emulated. The function is traced once, and its operations then run in
        compiled code; see :class:`gpbnb.arithmetic.traced.TracedFunction` for what cannot be traced and runs as it is.
        A precision in which it divides by zero, overflows, leaves the domain of a function, as np.arcsin of a number
        rounded to more than 1, or takes a whole number that the format does not hold as an operand, does not suffice.
    asked : the question. Its basis can only be "emulation", where errors are differences from the same function in a
        reference with :data:`SPARE_BITS` beyond the highest precision to try, by default that of
        :func:`gpbnb.arithmetic.search.largest_by_default`. An answer that needs no more digits than compiled loops
        have, 53 bits or 18 decimal digits, is found without trying more.
    tolerance : largest error of each output, in its unit; one number, or (p,).
    z : inputs, one row for each step.

    Raises
    ------
    ValueError : an unknown basis; outputs for fewer or more steps; a reference that depends on its digits, for
        example because a comparison decides between very different results; a highest precision that is not a whole
        number above 1.
    TypeError : the function leaves the format: it converts numbers to floats, NumPy arrays, text or another format; see
        :mod:`gpbnb.arithmetic.exits`.

    Examples
    --------
    >>> from gpbnb.wordlength.requirement import Asked
    >>> def smoother(fmt, z):
    ...     old, new, x, estimates = fmt.array("0.9"), fmt.array("0.1"), fmt.array(0), []
    ...     for value in z:
    ...         x = old * x + new * value
    ...         estimates.append(x)
    ...     return estimates
    >>> print(required_recursion_precision(smoother, Asked(4, "emulation"), 0.01, z=[1, 2, 3, 4]))
    7 bits (binary32 is enough): 0.15 of the tolerance, observed in 4 steps
    """
    base, largest = asked.like.base, asked.largest
    largest = largest_by_default(base) if largest is None else whole_number("largest", largest, 2)
    strategy = recursion_strategy(run, asked.steps, tolerance, z, base, asked.basis, largest)
    asked = asked._replace(largest=largest)
    with asked.search(CHECKED[base]) as search:
        return asked.answer(search(strategy), untraced=strategy.untraced)


def survey_recursion(
    run: Recursion,
    z: Any,
    tolerance: Any,
    formats: Sequence[FloatFormat],
    basis: Basis = "emulation",
) -> tuple[tuple[int, float], ...]:
    """Return precision, and largest error / tolerance, for some formats of one base."""
    strategy = recursion_strategy(
        run, None, tolerance, z, formats[0].base, basis, max(fmt.precision for fmt in formats)
    )
    return tuple((fmt.precision, strategy.error(fmt).ratio) for fmt in formats)


@dataclass(frozen=True, eq=False)
class EmulatedFunction:
    """Errors of a function for given inputs, against `true`, its outputs in the reference, (steps, p)."""

    run: TracedFunction | FixedIntervalSmoother
    z: NDArray[Any] | None
    true: NDArray[Any]
    tolerances: NDArray[np.float64]

    @property
    def untraced(self) -> str:
        """Why the user's function cannot be traced; empty if it can be."""
        return self.run.refusal if isinstance(self.run, TracedFunction) else ""

    def error(self, fmt: FloatFormat | FixedFormat) -> Outcome:
        """Return the largest error over its tolerance, or infinity and the reason."""
        try:
            found = _outputs(self.run, fmt, self.z, len(self.true))
        except _STOPS as fault:
            return Outcome(math.inf, f"the function stops: {fault}")
        ratio = self.share(found - self.true)
        return Outcome(ratio, "" if ratio < math.inf else "an error of the function is beyond the range of float64")

    def share(self, errors: NDArray[Any]) -> float:
        """Return the largest ratio of an error, (steps, p), to its tolerance."""
        asked = np.isfinite(self.tolerances)
        return largest_ratio(_largest(errors)[asked], self.tolerances[asked])


def recursion_strategy(
    run: Recursion, steps: int | None, tolerance: Any, z: Any, base: int, basis: Basis, largest: int
) -> EmulatedFunction:
    """Check the question, and return the strategy that answers it, in floating point or in fixed point.

    The arguments are those of :func:`required_recursion_precision`; `largest` is the most digits of a format.

    Raises
    ------
    ValueError, TypeError : as for that function.
    """
    checked_tolerance(tolerance, max(np.size(tolerance), 1), "outputs", basis)
    if basis != "emulation":
        raise ValueError(f'got basis "{basis}" of a function; needed "emulation": bounds exist for models')
    inputs = None if z is None else real_numbers(z)
    if inputs is not None and steps is not None and (not inputs.ndim or len(inputs) != steps):
        raise ValueError(f"got inputs of shape {inputs.shape}; needed one row for each of the {steps} steps")
    digits = max(largest, largest_by_default(base)) + math.ceil(SPARE_BITS / math.log2(base))
    traced = run if isinstance(run, FixedIntervalSmoother) else TracedFunction(run)
    short, true = (_reference(traced, FloatFormat(base, each), inputs, steps) for each in (digits, digits * 3 // 2))
    found = EmulatedFunction(traced, inputs, true, checked_tolerance(tolerance, true.shape[1], "outputs", basis))
    off = found.share(short - true)
    if not off <= SETTLED:
        raise ValueError(
            f"got a function whose reference in {digits_text(digits, base)} is {off:.2g} times the tolerance from "
            f"that in {digits * 3 // 2}; needed one that settles; do comparisons, or the format itself, decide between "
            f"results far apart? If errors only grow, try largest={2 * digits}, which gives the reference more "
            f"{digit_unit(base)}"
        )
    return found


def _reference(
    run: TracedFunction | FixedIntervalSmoother, fmt: FloatFormat, z: NDArray[Any] | None, steps: int | None
) -> NDArray[Any]:
    try:
        return _outputs(run, fmt, z, steps)
    except _STOPS as fault:
        raise type(fault)(
            f"the function stops in its reference of {digits_text(fmt.precision, fmt.base)}: {fault}"
        ) from None


def _largest(errors: NDArray[Any]) -> NDArray[np.float64]:
    return np.array([_float(max(abs(each) for each in column)) for column in errors.T])


def _float(value: Fraction) -> float:
    try:
        return float(value)
    except OverflowError:
        return math.inf


def _outputs(
    run: TracedFunction | FixedIntervalSmoother,
    fmt: FloatFormat | FixedFormat,
    z: NDArray[Any] | None,
    steps: int | None,
) -> NDArray[Any]:
    """Return the outputs of the function, (steps, p), exact; it must compute them in the format."""
    with kept_in(fmt) as own:
        own.restart()
        given = (own,) if z is None else (own, own.array(z))
        try:
            signature(run).bind(*given)
        except TypeError as error:
            with_z = "f(fmt)" if z is None else "f(fmt, z)"
            raise TypeError(
                f"got a function that does not take {'a format fmt' if z is None else 'a format fmt and inputs z'}: "
                f"{error}; needed {with_z}{', or inputs z=, for a function f(fmt, z)' if z is None else ''}"
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
    if found.ndim == 1:
        found = found.reshape(-1, 1)
    if found.ndim != 2 or not found.size or steps not in (None, len(found)):
        raise ValueError(
            f"got outputs of shape {found.shape} from the function; needed ({steps or 'steps'},) or "
            f"({steps or 'steps'}, p), one output or more for each step"
        )
    with lifted():  # the search may itself be part of a function that is searched
        return np.asarray(found.to_fractions(), dtype=object)
