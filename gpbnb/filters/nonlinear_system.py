"""A system whose step is a function of your own, and the operations of this step as a program for C code.

The step is recorded once, see :mod:`gpbnb.arithmetic.traced`. Runs repeat it, see :mod:`gpbnb.filters.repeating`, and
:meth:`NonlinearSystem.program` returns the same operations with the places of states, inputs and constants.
"""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property, partial
from inspect import signature
from typing import Any, cast

import numpy as np
from numpy.typing import NDArray

from gpbnb.arithmetic.array import FloatArray
from gpbnb.arithmetic.conversion import Numbers
from gpbnb.arithmetic.fixed import FixedFormat
from gpbnb.arithmetic.formats import FloatFormat
from gpbnb.arithmetic.named import format_named
from gpbnb.arithmetic.rational import exact
from gpbnb.arithmetic.second_format import convert
from gpbnb.arithmetic.traced import TracedFunction
from gpbnb.filters.blocks import BlockFormats
from gpbnb.filters.model import real_numbers
from gpbnb.filters.named import checked_name, naming, sized, whole_number
from gpbnb.filters.program import Program, entries, without_exact
from gpbnb.filters.repeating import RepeatedStep
from gpbnb.filters.steps import StepTaken

Step = Callable[[Any, Any, Any], tuple[Any, Any]]
"""A function ``step(fmt, x, u)`` that returns the next state and the output."""


@dataclass(frozen=True, eq=False, init=False)
class NonlinearSystem:
    r"""A system with known inputs whose step is a function: :math:`(x_{k+1}, y_k) = s(x_k, u_k)`.

    A system is a function of a format and of inputs, ``system(fmt, u)``, which returns the outputs (steps, p).
    :func:`gpbnb.required_precision` and other verbs accept it as it is, and
    :func:`~gpbnb.wordlength.code.write_code` writes its step in C.

    Parameters
    ----------
    step : function of a format, the state (n,) and the inputs (m,) of a step. It returns the next state and the
        output, each as an array of the format or as a list of arrays, which are then joined. All operations must be
        in the format; write constants as ``fmt.array("0.1")``. To run in compiled code and in C, the function must
        express a choice that depends on a number with ``np.where``, ``np.clip`` or a similar function. A state may be
        returned in a format of its own, such as that of an exact plant, see :func:`gpbnb.convert`; the next step then
        gets a list of its entries, each in the format in which it was returned. Such a step has no C code.
    x0 : (n,), the first state.
    m : number of inputs.
    name : name in tables and in code.

    Raises
    ------
    TypeError : `step` is not a function, an entry of `x0` is not a number, or `name` is not text.
    ValueError : `x0` is not a vector of finite numbers, or `m` is not a whole number above 0.

    Examples
    --------
    A controller whose integral and whose output are clipped:

    >>> import numpy as np
    >>> from gpbnb import BINARY32, NonlinearSystem, required_precision
    >>> def step(fmt, x, u):
    ...     proportional, integral = fmt.array(["0.8", "0.05"])
    ...     total = np.clip(x[0] + integral * u[0], -1, 1)
    ...     return total, np.clip(proportional * u[0] + total, -1, 1)
    >>> controller = NonlinearSystem(step, [0], name="a PI controller")
    >>> controller(BINARY32, [0.5, 1, 1]).to_float().ravel()
    array([0.42500001, 0.875     , 0.92500001])
    >>> print(required_precision(controller, [0.5, 1, 1], 0.01))
    6 bits (binary32 is enough): 0.31 of the tolerance, observed in 3 steps
    """

    step: Step
    x0: NDArray[Any]
    m: int
    name: str

    def __init__(self, step: Step, x0: Numbers, m: int = 1, name: str = "a nonlinear system") -> None:
        if not callable(step):
            raise TypeError(f"got a step {type(step).__name__}; needed a function step(fmt, x, u)")
        checked_name(name)
        try:
            signature(step).bind(*"fxu")
        except TypeError as error:
            raise TypeError(f"got a step with other arguments: {error}; needed step(fmt, x, u)") from None
        except ValueError:  # a function of C without a signature
            pass
        with naming("x0"):
            first = exact(x0)
        if first.ndim != 1:
            raise ValueError(f"got x0 of shape {first.shape}; needed one entry for each state, (n,)")
        first.flags.writeable = False
        given = {"step": step, "x0": first, "m": whole_number("m", m), "name": name}
        for key, value in given.items():
            object.__setattr__(self, key, value)

    def __repr__(self) -> str:
        return f"NonlinearSystem {self.name!r}, {sized(self.n, 'state', ())}; {sized(self.m, 'input', ())}"

    @property
    def n(self) -> int:
        """Number of states."""
        return len(self.x0)

    def __call__(self, fmt: Any, u: Any) -> FloatArray:
        """Return the outputs of a run in a format, (steps, p); the parameters are those of :meth:`states`."""
        return cast(Any, np.concatenate)([each.gain for each in self._run_in(fmt, u)])

    def states(self, fmt: Any, u: Any) -> FloatArray:
        """Return state and output after each step of a run in a format, (steps, n + p).

        States with a format of their own are rounded into that of the run.

        Parameters
        ----------
        fmt : a floating-point or a fixed-point format.
        u : (steps, m), or (steps,) for one input; inputs, each rounded into the format.

        Raises
        ------
        ValueError, TypeError : inputs of another shape; a step that does not return states (n,) and outputs (p,).
        OverflowError, ZeroDivisionError, NegativeRootError : an operation has no result in the format.
        """
        return cast(Any, np.concatenate)(list(self.blocks(fmt, u)))

    def blocks(self, fmt: Any, u: Any) -> Iterator[FloatArray]:
        """Give what :meth:`states` returns after some steps at a time."""
        for each in self._run_in(fmt, u):
            yield cast(Any, np.concatenate)([_in_one_format(each.states[0], each.gain.format), each.gain], axis=1)

    def _run_in(self, fmt: Any, u: Any) -> Iterator[StepTaken]:
        """Give outputs and states, in a list if they have formats of their own, after some steps at a time."""
        fmt = format_named(fmt) if type(fmt) is str else fmt  # isinstance would ask a traced format for its class
        if type(fmt) is BlockFormats or not callable(getattr(fmt, "array", None)):
            raise TypeError(f"got the format {fmt!r}; needed a FloatFormat, a FixedFormat or a name")
        rows = self.inputs_in(fmt, u)
        return RepeatedStep(self._taken, [fmt], (fmt.array(self.x0),)).take(rows)

    def advance(self, fmt: Any, x: Any, u: Any) -> FloatArray:
        """Take one step from a state (n,) with inputs (m,); return the next state and the output, (n + p,)."""
        found: FloatArray = self._one_step(fmt, x, u)
        return found

    def inputs_in(self, fmt: Any, u: Any) -> FloatArray:
        """Return inputs (steps, m), or (steps,) for one input, rounded into a format, in rows (steps, m)."""
        given = u if isinstance(u, FloatArray) else real_numbers(u)
        rows = given.reshape(-1, 1) if given.ndim == self.m == 1 else given
        if rows.ndim != 2 or rows.shape[1] != self.m or not len(rows):
            way = f"; or NonlinearSystem(..., m={given.shape[1]})" if given.ndim == 2 and len(given) else ""
            raise ValueError(f"got inputs of shape {given.shape}; needed (steps, {self.m}){way}")
        found: FloatArray = fmt.array(rows)
        return found

    def program(self, fmt: FloatFormat | FixedFormat) -> tuple[Program, NDArray[Any]]:
        """Return the operations of a step, and the coefficients as a format stores them, (1, c).

        The last p states of the program are the outputs.

        Raises
        ------
        ValueError : the step cannot be traced.
        OverflowError : a constant is beyond the range of the format.
        """
        tape, returned = self._one_step.recorded((self.n,), (self.m,))
        constants = {place: value for place, value in tape.constants_in(fmt).items() if place}
        after, n = returned.components[0], self.n
        p = len(after) - n
        program = Program(
            tape,
            tape.instructions,
            tape.formats,
            [np.append(np.arange(1, 1 + n), [-1] * p)],
            [np.arange(1 + n, 1 + n + self.m)],
            [np.array([*constants], dtype=np.int64)],
            [after],
            p=p,
            state_names=(*entries("x", n), *entries("y", p)),
            coefficient_names=tuple(f"c{i}" for i in range(1, 1 + len(constants))),
            calls=tape.calls,
        )
        coefficients = np.array([[*constants.values()]], dtype=object)
        return without_exact(program, coefficients), coefficients

    @cached_property
    def _one_step(self) -> TracedFunction:
        return TracedFunction(partial(NonlinearSystem._stepped, self))

    @property
    def refusal(self) -> str:
        """Why the step cannot be traced; empty if it can be."""
        with contextlib.suppress(ValueError):
            self._one_step.recorded((self.n,), (self.m,))
        return self._one_step.refusal

    def _taken(self, formats: Sequence[Any], states: tuple[Any, ...], given: Sequence[Any]) -> StepTaken:
        after, output = self._parts(formats[0], *states, *given)
        return StepTaken((after,), output, True)

    def _stepped(self, fmt: Any, x: Any, u: Any) -> Any:
        return np.concatenate(self._parts(fmt, x, u))

    def _parts(self, fmt: Any, x: Any, u: Any) -> tuple[Any, Any]:
        """Take a step, and return the next state, as a list if it has formats of its own, and the output."""
        returned = self.step(fmt, x, u)
        if type(returned) not in (tuple, list) or len(returned) != 2:
            kind = f"{len(returned)} parts" if isinstance(returned, (tuple, list)) else f"a {type(returned).__name__}"
            raise ValueError(f"got {kind} from the step; needed two, the next state and the output")
        after, output = ([each for part in _flat(whole) for each in part] for whole in returned)
        if len(after) != self.n or not output:
            raise ValueError(
                f"got {len(after)} states and {len(output)} outputs from the step; needed {self.n} states, as x0 has, "
                "and at least one output"
            )
        return after if any(each.format != fmt for each in after) else np.stack(after), np.stack(output)


def _in_one_format(states: Any, fmt: Any) -> Any:
    """Return states of some steps, (steps, n), in the format of the run."""
    return np.stack([convert(each, fmt) for each in states], axis=1) if isinstance(states, list) else states


def _flat(part: Any) -> list[Any]:
    """Return the arrays of a part of what a step returns, each in one row."""
    if isinstance(part, (tuple, list)) and part:
        return [each for entry in part for each in _flat(entry)]
    if not isinstance(part, FloatArray):
        raise TypeError(
            f"got a {type(part).__name__} from the step; needed arrays of the format that it was given; make constants "
            "with fmt.array(...)"
        )
    return [part.reshape(-1)]
