"""Find the precision for your own recursion, a function written with arrays of a format."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from fractions import Fraction
from typing import Any

import numpy as np
from numpy.typing import NDArray
from tqdm import tqdm  # type: ignore[import-untyped]

from gpbnb.arithmetic.array import FloatArray, NegativeRootError
from gpbnb.arithmetic.exits import kept_in, lifted
from gpbnb.arithmetic.formats import FloatFormat
from gpbnb.arithmetic.search import CHECKED, Search, largest_by_default
from gpbnb.filters.missing import real_numbers
from gpbnb.filters.named import whole_number
from gpbnb.wordlength.requirement import ANY_BINARY, Basis, Requirement, checked_tolerance, largest_ratio

Recursion = Callable[..., Any]
"""A function ``run(fmt, z)``, or ``run(fmt)`` without z, that returns the outputs of all steps in the format."""

SPARE_BITS = 37
"""Bits that the reference has beyond the highest precision; a second run that checks it has half as many again."""

_STOPS = (ZeroDivisionError, OverflowError, NegativeRootError, np.linalg.LinAlgError)

SETTLED = 2.0**-20
"""Largest difference allowed between the two runs of the reference, as a share of the tolerance."""


def required_recursion_precision(
    run: Recursion,
    steps: int,
    tolerance: Any,
    z: Any = None,
    like: FloatFormat = ANY_BINARY,
    basis: Basis = "emulation",
    progress: bool = False,
    largest: int | None = None,
) -> Requirement:
    """Find the smallest precision with which a recursion stays within a tolerance.

    Parameters
    ----------
    run : function of a format, and of `z` rounded into it. It returns an output for each step, as one array (steps,) or
        (steps, p), or as a list of arrays. All operations must be in the format; write constants as
        ``fmt.array("0.1")``. Data that the function takes from elsewhere must go through ``fmt.array``, too, before the
        first operation: nothing can be said about operations before.
    tolerance : largest error of each output, in its unit; one number, or (p,).
    z : inputs, one row for each step.
    like : a format of any precision, with base, rounding and range of those to try.
    basis : only "emulation", where errors are differences from the same function in a reference with :data:`SPARE_BITS`
        beyond `largest`.
    largest : highest precision to try, by default :func:`gpbnb.arithmetic.search.largest_by_default`. An answer that
        needs no more digits than compiled loops have, 53 bits or 18 decimal digits, is found without trying more.

    Raises
    ------
    ValueError : another basis; outputs for fewer or more steps; a reference that depends on its digits, for
        example because a comparison decides between very different results; `largest` is no whole number above 1.
    TypeError : the function leaves the format: it converts numbers to floats, NumPy arrays, text or another format; see
        :mod:`gpbnb.arithmetic.exits`.

    Examples
    --------
    >>> def smoother(fmt, z):
    ...     old, new, x, estimates = fmt.array("0.9"), fmt.array("0.1"), fmt.array(0), []
    ...     for value in z:
    ...         x = old * x + new * value
    ...         estimates.append(x)
    ...     return estimates
    >>> print(required_recursion_precision(smoother, 4, 0.01, z=[1, 2, 3, 4]))
    7 digits of base 2, nearest: 0.15 of the tolerance (emulation, 4 steps)
    """
    largest = largest_by_default(like.base) if largest is None else whole_number("largest", largest, 2)
    error = _question(run, steps, tolerance, z, like.base, basis, largest)
    with tqdm(desc="precisions", unit="run", disable=not progress) as bar:
        found = Search(error, like, CHECKED[like.base], bar.update, largest=largest)
    return Requirement(found.fmt, basis, steps, found.tried, found.why, None, found.irregular, limit=found.limit)


def survey_recursion(
    run: Recursion,
    z: Any,
    tolerance: Any,
    formats: Sequence[FloatFormat],
    basis: Basis = "emulation",
) -> tuple[tuple[int, float], ...]:
    """Return precision, and largest error / tolerance, for some formats of one base."""
    error = _question(run, None, tolerance, z, formats[0].base, basis, max(fmt.precision for fmt in formats))
    return tuple((fmt.precision, error(fmt)[0]) for fmt in formats)


def _question(
    run: Recursion, steps: int | None, tolerance: Any, z: Any, base: int, basis: Basis, largest: int
) -> Callable[[FloatFormat], tuple[float, str]]:
    """Return a function that computes error / tolerance in a format, and why it is infinite."""
    checked_tolerance(tolerance, max(np.size(tolerance), 1), "outputs", base, basis)
    if basis != "emulation":
        raise ValueError(f'got basis "{basis}" of a function; needed "emulation": bounds exist for models')
    inputs = None if z is None else real_numbers(z)
    if inputs is not None and steps is not None and (not inputs.ndim or len(inputs) != steps):
        raise ValueError(f"got inputs of shape {inputs.shape}; needed one row for each of the {steps} steps")
    digits = max(largest, largest_by_default(base)) + math.ceil(SPARE_BITS / math.log2(base))
    short, true = (_reference(run, FloatFormat(base, each), inputs, steps) for each in (digits, digits * 3 // 2))
    tolerances = checked_tolerance(tolerance, true.shape[1], "outputs", base, basis)
    asked = np.isfinite(tolerances)
    off = largest_ratio(_largest(short - true)[asked], tolerances[asked])
    if not off <= SETTLED:
        raise ValueError(
            f"got a function whose reference in {digits} digits of base {base} is {off:.2g} times the tolerance from "
            f"that in {digits * 3 // 2}; needed one that settles; do comparisons, or the format itself, decide between "
            f"results far apart? If errors only grow, try largest={2 * digits}, which gives the reference more digits"
        )

    def error(fmt: FloatFormat) -> tuple[float, str]:
        try:
            found = _outputs(run, fmt, inputs, len(true))
        except _STOPS as fault:
            return math.inf, f"the function stops: {fault}"
        ratio = largest_ratio(_largest(found - true)[asked], tolerances[asked])
        return ratio, "" if ratio < math.inf else "an error of the function is beyond the range of float64"

    return error


def _reference(run: Recursion, fmt: FloatFormat, z: NDArray[Any] | None, steps: int | None) -> NDArray[Any]:
    try:
        return _outputs(run, fmt, z, steps)
    except _STOPS as fault:
        raise type(fault)(f"the function stops in its reference of {fmt.precision} digits: {fault}") from None


def _largest(errors: NDArray[Any]) -> NDArray[np.float64]:
    return np.array([_float(max(abs(each) for each in column)) for column in errors.T])


def _float(value: Fraction) -> float:
    try:
        return float(value)
    except OverflowError:
        return math.inf


def _outputs(run: Recursion, fmt: FloatFormat, z: NDArray[Any] | None, steps: int | None) -> NDArray[Any]:
    """Return the outputs of the function, (steps, p), exact; it must compute them in the format."""
    with kept_in(fmt) as own:
        own.restart()
        found = run(own) if z is None else run(own, own.array(z))
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
