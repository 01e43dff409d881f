r"""Bounds of the errors of filters with fixed coefficients, for ever or over a number of steps.

The error of an output is the difference from the system with the given coefficients. A system with an eigenvalue of
size 1 or more, such as a clock, an integrator or a running sum, keeps its errors, and no bound on them holds for ever.
Over N steps, the sums over earlier steps have N terms, and the same bounds hold with these terms alone.
"""

from __future__ import annotations

from fractions import Fraction
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from gpbnb.arithmetic.bounds import all_above
from gpbnb.arithmetic.fixed import FixedFormat
from gpbnb.arithmetic.formats import FloatFormat
from gpbnb.arithmetic.kernels.backends import double_doubles
from gpbnb.arithmetic.named import arithmetic
from gpbnb.arithmetic.rounding import Rounding
from gpbnb.bounds.certificate import Proof, of_operations, proved
from gpbnb.bounds.guess import (
    EXCESS,
    ROUNDING,
    Guess,
    LinearValues,
    float_errors,
    gains,
    lags_of,
    linear_values,
    no_bound,
    positive,
    raised,
    rounding_errors,
    sizes_within,
)
from gpbnb.bounds.limited import limited_errors
from gpbnb.bounds.units import largest_errors, stored_sizes, units
from gpbnb.bounds.words import WordErrors
from gpbnb.filters.program import matrices
from gpbnb.filters.structures import LinearFilter
from gpbnb.filters.system import LinearSystem, is_stable
from gpbnb.filters.word_formats import WordFormats
from gpbnb.filters.words import integer_program

Array = NDArray[np.float64]


class _Sums(NamedTuple):
    """What inputs of size 1 and roundings do in all steps together, for certain stored coefficients."""

    step: LinearValues
    state: Array  # (n, m), from inputs to states of the exact filter
    values: Array  # (values, m), from earlier inputs to each value
    errors: Array  # (n, m), from inputs to errors of states, due to storing coefficients
    storing: Array  # (n, m), from errors of storing inputs
    rounding: Array  # (n, o), from roundings of operations
    lags: int  # how many earlier steps are summed one by one


class Recursion:
    """A filter with fixed coefficients whose inputs stay within limits, (m,), over some steps or for ever.

    It is compared with an exact filter whose coefficients and inputs are as given, or as stored. Inputs without limits
    are taken in fixed-point words alone, as stored, where roundings do not depend on sizes.
    """

    def __init__(self, made: LinearFilter, inputs: Array | None, steps: int | None, as_given: bool = True) -> None:
        if not made.program.is_linear:
            raise ValueError(f"got {made.name}, which limits its values; needed a linear system for a bound")
        self._made, self._steps, self._as_given = made, steps, as_given
        self._whole, self._inputs = inputs is not None, np.zeros(made.program.m) if inputs is None else inputs
        self._known = dict[tuple[Fraction, ...], _Sums]()

    def proof(self, fmt: FloatFormat | FixedFormat | WordFormats) -> Proof:
        """Return the bounds of states and outputs in a format, with their certificate."""
        return proved(self.guess(fmt), lambda guess: self.certificate(fmt, guess))

    def certificate(self, fmt: FloatFormat | FixedFormat | WordFormats, guess: Guess) -> dict[str, Any]:
        """Return the claim of a guess."""
        inputs = self._inputs if self._whole else np.full(len(self._inputs), np.inf)
        return of_operations(self._made, fmt, inputs, guess, self._steps, "as given" if self._as_given else "as stored")

    @np.errstate(over="ignore", invalid="ignore")
    def guess(self, fmt: FloatFormat | FixedFormat | WordFormats) -> Guess:
        """Guess the bounds of states and outputs; ValueError or OverflowError says why there are none."""
        made, program, inputs = self._made, self._made.program, self._inputs
        words = integer_program(made, fmt) if isinstance(fmt, WordFormats) else None
        data: Any = fmt if words is None else words.words.data
        stored = made.stored(data) if words is None else words.coefficients
        if self._steps is None and not is_stable(matrices(program, stored)[0]):
            raise ValueError("the system is stable, but not with its coefficients as stored; needed more of their bits")
        storing, kept = largest_errors(data, inputs) * self._as_given, stored_sizes(data, inputs)
        if not np.isfinite(largest_errors(data, inputs)).all():
            if words is None:
                raise ValueError(f"got inputs of up to {inputs}; needed inputs within the range of {arithmetic(data)}")
            raise OverflowError(f"inputs of up to {inputs.max():.6g} are beyond the range of {arithmetic(data)}")
        found, Z = self._sums(stored, units(data).exact), inputs if self._as_given else kept
        rows, n = found.step.rows[:, 0], program.n
        state = positive(found.state @ Z * EXCESS)
        self._check_gain(state)
        sizes = np.minimum(found.values @ Z * EXCESS, sizes_within(rows[:, :n], state))
        sizes = sizes + sizes_within(rows[:, n:], kept)
        of_inputs = found.storing @ storing + found.errors @ Z
        largest = float_errors(program, data, found.step) if words is None else WordErrors(words)

        def bounded(b: Array) -> Array:
            h = rounding_errors(program, found.step, sizes[:, None], state + b, b, largest)[:, 0]
            return np.asarray(sizes_within(found.rounding, h) + of_inputs)

        b = raised(bounded, len(state))
        if isinstance(largest, WordErrors) and self._whole:
            largest.check_range(state + b)
        if not np.isfinite(b).all():
            raise ValueError(no_bound(data))
        return Guess(b, state, Z, b[:, None] * (np.arange(3) == ROUNDING), found.lags)

    def _check_gain(self, reached: Array) -> None:
        """Reject a system that multiplies its inputs by more than float64 holds."""
        if not np.isfinite(reached).all():
            over = "" if self._steps is None else f" over {self._steps} steps"
            cure = "take fewer steps" if over else "scale the inputs"
            raise OverflowError(f"got a system whose largest gain{over} is beyond the range of float64; {cure}")

    def _sums(self, stored: Any, powers: Array) -> _Sums:
        key = tuple(stored)
        if key in self._known:
            return self._known[key]
        program, n, steps = self._made.program, self._made.program.n, self._steps
        F, K = matrices(program, stored)
        A, B = matrices(program, self._made.coefficients) if self._as_given else (F, K)
        of_state, of_input = ((x - y).astype(np.float64) for x, y in ((F, A), (K, B)))
        F, K, A, B = (each.astype(np.float64) for each in (F, K, A, B))
        step = linear_values(program, double_doubles(stored)[None], powers)
        step = step._replace(rows=step.rows.astype(np.float64))
        columns = np.hstack([K, step.effects[n + program.m :, 0].T])
        self._check_gain(B * self._inputs)
        lags = max(lags_of(A, B * self._inputs, steps), lags_of(F, columns[:, program.m :], steps))
        sums = gains(A, B, step.rows[:, 0, :n], steps, lags)
        later, errors = gains(F, columns, np.zeros((0, n)), steps, lags), np.zeros((n, program.m))
        if of_state.any() or of_input.any():
            both = np.block([[F, of_state], [np.zeros((n, n)), A]])
            errors = gains(both, np.vstack([of_input, B]), np.zeros((0, 2 * n)), steps, lags)[:n]
        of_storing, of_rounding = later[:, : program.m], later[:, program.m :]
        self._known[key] = _Sums(step, sums[:n], sums[n:], errors, of_storing, of_rounding, lags)
        return self._known[key]


def bounded_rounding(made: LinearFilter, words: WordFormats) -> Array:
    """Bound the error of each state, (n,), due to rounding, for ever and for all inputs, while nothing overflows."""
    return Recursion(made, None, None, as_given=False).proof(words).bound


class OutputBounds:
    """Error bounds of a system that starts from rest, for all inputs whose sizes stay within limits, (m,).

    They hold for a number of steps, by default for all time. Bounds of a linear system are guessed, and proved by
    :mod:`gpbnb.bounds.check`; those of a system that limits its values hold without a proof, and have no words.
    """

    def __init__(self, system: LinearSystem, largest: Any, steps: int | None = None) -> None:
        if any(system.x0):
            raise ValueError(f"got a first state {system.x0.tolist()}; needed x0 = 0 for a bound")
        self._system, self._steps, made = system, steps, system.as_filter()
        self._largest = np.broadcast_to(all_above(largest), (system.m,))
        self._linear = Recursion(made, self._largest, steps) if made.program.is_linear else None

    def errors(self, fmt: FloatFormat | FixedFormat | WordFormats, proved: bool = True) -> Array:
        """Bound the error of each output, (p,), from the system as given, due to rounding and storing."""
        return self.proof(fmt, proved).bound

    def proof(self, fmt: FloatFormat | FixedFormat | WordFormats, proved: bool = True) -> Proof:
        """Return the bounds of :meth:`errors` with their certificate, which is empty if there is none."""
        system, linear, n = self._system, self._linear, self._system.n
        if linear is None:
            if isinstance(fmt, WordFormats) and fmt != WordFormats(fmt.data):
                raise ValueError(f"got {system.name}, which limits its values; needed a linear system for a bound")
            fmt = fmt.data if isinstance(fmt, WordFormats) else fmt
            return Proof(limited_errors(system, fmt, self._largest, self._steps), "")
        if isinstance(fmt, FixedFormat) and fmt.rounding is not Rounding.STOCHASTIC:
            fmt = WordFormats(fmt)  # as a run takes it
        if self._steps is None and (cause := system.unstable(None if isinstance(fmt, WordFormats) else fmt)):
            raise ValueError(cause)
        if not proved:
            return Proof(linear.guess(fmt).bound[n:], "")
        found = linear.proof(fmt)
        return found._replace(bound=found.bound[n:])


def output_errors(
    system: LinearSystem, fmt: FloatFormat | FixedFormat, largest: Any, steps: int | None = None
) -> Array:
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
    return OutputBounds(system, largest, steps).errors(fmt)
