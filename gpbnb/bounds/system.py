r"""Bounds of the errors of a linear system's outputs, for ever or over a number of steps.

The error of an output is the difference from the system with the given coefficients. A system with an eigenvalue of
size 1 or more, such as a clock, an integrator or a running sum, keeps its errors, and no bound on them holds for ever.
Over N steps, the sums over earlier steps have N terms, and the same bounds hold with these terms alone.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gpbnb.arithmetic.bounds import all_above
from gpbnb.arithmetic.fixed import FixedFormat
from gpbnb.arithmetic.formats import FloatFormat
from gpbnb.arithmetic.named import arithmetic
from gpbnb.bounds.certificate import Proof, of_operations, proved
from gpbnb.bounds.guess import Guess, constant_guess
from gpbnb.bounds.limited import limited_errors
from gpbnb.bounds.units import largest_errors
from gpbnb.bounds.words import WordSums
from gpbnb.filters.system import LinearSystem
from gpbnb.filters.word_formats import WordFormats


class OutputBounds:
    """Error bounds of a system that starts from rest, for all inputs whose sizes stay within limits, (m,).

    They hold for a number of steps, by default for all time. Bounds of a linear system are guessed, and proved by
    :mod:`gpbnb.bounds.check`; those of a system that limits its values hold without a proof, and have no words.
    """

    def __init__(self, system: LinearSystem, largest: Any, steps: int | None = None) -> None:
        if any(system.x0):
            raise ValueError(f"got a first state {system.x0.tolist()}; needed x0 = 0 for a bound")
        self._system, self._made, self._steps = system, system.as_filter(), steps
        self._largest = np.broadcast_to(all_above(largest), (system.m,))

    @cached_property
    def _words(self) -> WordSums:
        return WordSums(self._system, self._largest, self._steps)

    def guessed(self, fmt: FloatFormat | FixedFormat | WordFormats) -> NDArray[np.float64]:
        """Return what :meth:`errors` is going to prove, without a proof."""
        return self._errors(fmt, self._guess)

    def errors(self, fmt: FloatFormat | FixedFormat | WordFormats) -> NDArray[np.float64]:
        """Bound the error of each output, (p,), from the system as given, due to rounding and storing."""
        return self._errors(fmt, self.proof)

    def _errors(self, fmt: Any, bounded: Callable[[Any], Guess | Proof]) -> NDArray[np.float64]:
        if not isinstance(fmt, WordFormats) and not self._made.program.is_linear:
            return limited_errors(self._system, fmt, self._largest, self._steps)
        return bounded(fmt).bound[self._system.n :]

    def proof(self, fmt: FloatFormat | FixedFormat | WordFormats) -> Proof:
        """Return the bounds of states and outputs of a linear system with their certificate; see :meth:`errors`."""
        inputs, steps = self._largest, self._steps
        return proved(self._guess(fmt), lambda guess: of_operations(self._made, fmt, inputs, guess, steps, "as given"))

    def _guess(self, fmt: FloatFormat | FixedFormat | WordFormats) -> Guess:
        if isinstance(fmt, WordFormats):
            return self._words.guess(fmt)
        system, inputs, steps = self._system, self._largest, self._steps
        if steps is None and (cause := system.unstable(fmt)):
            raise ValueError(cause)
        if not np.isfinite(largest_errors(fmt, inputs)).all():
            raise ValueError(f"got inputs of up to {inputs}; needed inputs within the range of {arithmetic(fmt)}")
        found = constant_guess(self._made, fmt, inputs, steps, as_given=True)
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
    return OutputBounds(system, largest, steps).errors(fmt)
