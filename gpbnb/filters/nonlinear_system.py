"""A system whose step is a function of your own, and the operations of this step as a program for C code.

The step is traced once, see :mod:`gpbnb.arithmetic.traced`. Runs repeat the trace in compiled code, and
:meth:`NonlinearSystem.program` lists the same operations with the codes of :mod:`gpbnb.filters.program`.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from fractions import Fraction
from functools import cached_property
from inspect import signature
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from gpbnb.arithmetic.array import FloatArray
from gpbnb.arithmetic.conversion import Numbers
from gpbnb.arithmetic.fixed import FixedFormat
from gpbnb.arithmetic.formats import FloatFormat
from gpbnb.arithmetic.interpreting import Call
from gpbnb.arithmetic.machine import CODES
from gpbnb.arithmetic.named import format_named
from gpbnb.arithmetic.rational import exact
from gpbnb.arithmetic.tape import Tape
from gpbnb.arithmetic.traced import TracedFunction
from gpbnb.filters.blocks import BlockFormats
from gpbnb.filters.model import real_numbers
from gpbnb.filters.named import checked_name, sized, whole_number
from gpbnb.filters.program import (
    ADD,
    AT_LEAST,
    AT_MOST,
    CEILING,
    CHOOSE,
    CONSTANT,
    DIVIDE,
    DIVISOR,
    EQUAL,
    FLOOR,
    LESS,
    MODULO,
    MULTIPLY,
    NEAREST,
    PRODUCT,
    RADICAND,
    ROOT,
    SUBTRACT,
    TRUNCATE,
    Builder,
    Program,
    entries,
)
from gpbnb.filters.tracing import without_exact

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
        express a choice that depends on a number with ``np.where``, ``np.clip`` or a similar function.
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
        try:
            first = exact(x0)
        except (TypeError, ValueError) as error:
            raise type(error)(f"x0: {error}") from None
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
        return self.states(fmt, u)[:, self.n :]

    def states(self, fmt: Any, u: Any) -> FloatArray:
        """Return state and output after each step of a run in a format, (steps, n + p).

        Parameters
        ----------
        fmt : a floating-point or a fixed-point format.
        u : (steps, m), or (steps,) for one input; inputs, each rounded into the format.

        Raises
        ------
        ValueError, TypeError : inputs of another shape; a step that does not return states (n,) and outputs (p,).
        OverflowError, ZeroDivisionError, NegativeRootError : an operation has no result in the format.
        """
        fmt = format_named(fmt) if type(fmt) is str else fmt  # isinstance would ask a traced format for its class
        if type(fmt) is BlockFormats or not callable(getattr(fmt, "array", None)):
            raise TypeError(f"got the format {fmt!r}; needed a FloatFormat, a FixedFormat or a name")
        found: FloatArray = self._whole_run(fmt, self.inputs_in(fmt, u))
        return found

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
        ValueError : the step cannot be traced, or uses a function that has no exact counterpart in C.
        OverflowError : a constant is beyond the range of the format.
        """
        tape, returned = self._one_step.recorded((self.n,), (self.m,))
        constants = tape.constants_in(fmt)
        places = returned.components[0].tolist()
        listing = _Listing(tape, constants, (self.n, self.m, len(places) - self.n))
        found, coefficients = listing.program(places), np.array([listing.coefficients], dtype=object)
        return without_exact(found, coefficients), coefficients

    @cached_property
    def _one_step(self) -> TracedFunction:
        return TracedFunction(self._stepped)

    @cached_property
    def _whole_run(self) -> TracedFunction:
        return TracedFunction(self._run)

    def _run(self, fmt: Any, u: Any) -> Any:
        x, found = fmt.array(self.x0), []
        for row in u:
            found.append(self._stepped(fmt, x, row))
            x = found[-1][: self.n]
        return np.stack(found)

    def _stepped(self, fmt: Any, x: Any, u: Any) -> Any:
        returned = self.step(fmt, x, u)
        if type(returned) not in (tuple, list) or len(returned) != 2:
            kind = f"{len(returned)} parts" if isinstance(returned, (tuple, list)) else f"a {type(returned).__name__}"
            raise ValueError(f"got {kind} from the step; needed two, the next state and the output")
        after, output = map(_joined, returned)
        if len(after) != self.n or not len(output):
            raise ValueError(
                f"got {len(after)} states and {len(output)} outputs from the step; needed {self.n} states, as x0 has, "
                "and at least one output"
            )
        return np.concatenate([after, output])


def _joined(part: Any) -> Any:
    """Return the entries of an array of a format, or of a list of arrays, in one row."""
    if isinstance(part, (tuple, list)) and part:
        return np.concatenate([_joined(each) for each in part])
    if not isinstance(part, FloatArray):
        raise TypeError(
            f"got a {type(part).__name__} from the step; needed arrays of the format that it was given; make constants "
            "with fmt.array(...)"
        )
    return part.reshape(-1)


# -- the operations of a step -----------------------------------------------------------------------------------------

_NAMES = {code: name for name, code in CODES.items()}
_OF_TWO = {"add": ADD, "subtract": SUBTRACT, "multiply": PRODUCT, "divide": DIVIDE}
_CALLS = {"fmod": MODULO, "floor": FLOOR, "ceil": CEILING, "trunc": TRUNCATE, "rint": NEAREST}
_LESS, _SAME, _GREATER = 1, 2, 4
_AND, _OR = 8, 14
_ALL = _LESS + _SAME + _GREATER


class _Truth(NamedTuple):
    """A truth value: whether a value is not zero, or is zero if `negated`; without a value, false, or true."""

    value: int | None
    negated: bool


_FALSE, _TRUE = _Truth(None, False), _Truth(None, True)


class _Listing:
    """The operations of a tape in the codes of a program."""

    def __init__(self, tape: Tape, constants: dict[int, Fraction], sizes: tuple[int, int, int]) -> None:
        n, m, p = sizes
        self._tape, self._build, self._sizes = tape, Builder(n + p, m), sizes
        #: The different constants; the first is zero.
        self.coefficients = list(dict.fromkeys(constants.values()))
        numbers = {value: i for i, value in enumerate(self.coefficients)}
        self._coefficients = {place: numbers[value] for place, value in constants.items()}
        self._values = dict(enumerate([*self._build.states[:n], *self._build.inputs], start=1))
        self._truths = {0: _FALSE, 1: _TRUE}
        self._loaded: dict[int, int] = {}
        self._comparisons: dict[tuple[int, int, int], int] = {}
        #: The two places of each comparison by size.
        self._ordered: dict[int, tuple[int, int]] = {}

    def program(self, returned: Sequence[int]) -> Program:
        """Return the program whose results are at the places that the step returned, with the outputs last."""
        rows, at = self._tape.instructions.tolist(), 0
        for call in self._tape.calls:
            self._operations(rows[at : call.at])
            self._call(call)
            at = call.at
        self._operations(rows[at:])
        outputs, count = [self._value(place) for place in returned], len(self.coefficients)
        n, _, p = self._sizes
        names = ["zero", *(f"c{i}" for i in range(1, count))]
        return self._build.finish(outputs, count, p, [*entries("x", n), *entries("y", p)], names)

    def _operations(self, rows: Sequence[Sequence[int]]) -> None:
        for code, a, b, c, out in rows:
            name = _NAMES[code]
            if name == "compare":
                self._truths[out] = self._order(a, b, c)
            elif name == "combine":
                self._truths[out] = self._combination(self._truths[a], self._truths[b], c)
            elif name == "nonzero":
                self._check(a, DIVISOR)
            elif name == "choose":
                self._values[out] = self._choice(self._truths[a], b, c)
            elif name == "sqrt":
                self._check(a, RADICAND)
                self._values[out] = self._build.append(ROOT, 0, self._value(a))
            elif name == "negative":
                self._values[out] = self._opposite(a)
            elif name == "absolute":
                self._values[out] = self._chosen(self._order(a, 0, _LESS), self._opposite(a), self._value(a))
            else:
                self._values[out] = self._of_two(_OF_TWO[name], a, b)

    def _call(self, call: Call) -> None:
        if call.name not in _CALLS and call.name != "remainder":
            raise ValueError(
                f"got np.{call.name} in the step, for which C has no function with the digits of the emulation; needed "
                "+ - * /, comparisons, choices, np.sqrt, np.fmod, np.remainder, np.floor, np.ceil, np.trunc, np.rint; "
                "write a polynomial or a table in its place"
            )
        for *places, out in zip(*(each.tolist() for each in (*call.operands, call.results)), strict=True):
            if call.name == "remainder":
                self._values[out] = self._remainder(places[0], places[1], -out)
            elif call.name == "fmod":
                self._values[out] = self._of_two(MODULO, *places)
            else:
                self._values[out] = self._build.append(_CALLS[call.name], 0, self._value(places[0]))

    def _remainder(self, x: int, y: int, rest: int) -> int:
        """Add y to fmod(x, y), to which a place is given, if their signs differ."""
        self._values[rest] = self._of_two(MODULO, x, y)
        (below, above), (under, over) = ([self._order(each, 0, k) for k in (_LESS, _GREATER)] for each in (rest, y))
        opposite = self._combination(self._combination(below, over, _AND), self._combination(above, under, _AND), _OR)
        added = self._chosen(opposite, self._value(y), self._value(0))
        return self._build.append(ADD, self._value(rest), added)

    # -- numbers -------------------------------------------------------------------------------------------

    def _value(self, place: int) -> int:
        """Return the value of a place; a constant is loaded where it is first needed."""
        if place in self._values:
            return self._values[place]
        coefficient = self._coefficients[place]
        if coefficient not in self._loaded:
            self._loaded[coefficient] = self._build.append(CONSTANT, coefficient)
        return self._loaded[coefficient]

    def _check(self, place: int, kind: int) -> None:
        self._build.checks.append((self._value(place), kind))

    def _opposite(self, place: int) -> int:
        return self._build.append(SUBTRACT, self._value(0), self._value(place))

    def _of_two(self, code: int, a: int, b: int) -> int:
        if code in (DIVIDE, MODULO) and not self._coefficients.get(b):  # zero is the first coefficient
            self._check(b, DIVISOR)
        if code == PRODUCT and b in self._coefficients:
            a, b = b, a
        if code == PRODUCT and a in self._coefficients:
            return self._build.append(MULTIPLY, self._coefficients[a], self._value(b))
        return self._build.append(code, self._value(a), self._value(b))

    def _choice(self, truth: _Truth, a: int, b: int) -> int:
        """Choose one of the numbers at two places; the larger, or smaller, of a number and a constant is a limit."""
        if truth.value in self._ordered:
            less, greater = self._ordered[truth.value]
            for code, constant, value in ((AT_LEAST, greater, less), (AT_MOST, less, greater)):
                chosen = (value, constant) if truth.negated else (constant, value)
                if constant in self._coefficients and value not in self._coefficients and (a, b) == chosen:
                    return self._build.append(code, self._coefficients[constant], self._value(value))
        return self._chosen(truth, self._value(a), self._value(b))

    def _chosen(self, truth: _Truth, a: int, b: int) -> int:
        if truth.negated:
            a, b = b, a
        if truth.value is None:
            return b
        self._build.guard = truth.value
        found = self._build.append(CHOOSE, a, b)
        self._build.guard = -1
        return found

    # -- truth values --------------------------------------------------------------------------------------

    def _order(self, a: int, b: int, orders: int) -> _Truth:
        """Compare the numbers at two places; the bits of the orders are those of a tape."""
        if orders in (_ALL, 0):
            return _TRUE if orders else _FALSE
        negated = orders.bit_count() == 2
        only = _ALL - orders if negated else orders
        if only == _GREATER:
            a, b = b, a
        code = EQUAL if only == _SAME else LESS
        if (code, a, b) not in self._comparisons:
            value = self._comparisons[code, a, b] = self._build.append(code, self._value(a), self._value(b))
            if code == LESS:
                self._ordered[value] = a, b
        return _Truth(self._comparisons[code, a, b], negated)

    def _combination(self, a: _Truth, b: _Truth, table: int) -> _Truth:
        """Combine two truth values; bit 2 a + b of the table is the result."""
        if a == b:
            return self._row(a, table & 1 | table >> 2 & 2)
        false, true = self._row(b, table & 3), self._row(b, table >> 2)
        if a.negated:
            false, true = true, false
        if a.value is None or false == true:
            return false
        negated = false == _TRUE
        if negated:
            false, true = self._row(false, 1), self._row(true, 1)
        if (false, true) == (_FALSE, _TRUE):
            return _Truth(a.value, negated)
        holds = a.value if true == _TRUE else self._number(true)
        return _Truth(self._chosen(_Truth(a.value, False), holds, self._number(false)), negated)

    @staticmethod
    def _row(b: _Truth, row: int) -> _Truth:
        """Return what a truth value becomes if it is false, bit 0, and if it is true, bit 1."""
        if row in (0, 3):
            return _TRUE if row == 3 else _FALSE
        return b if row == 2 else b._replace(negated=not b.negated)

    def _number(self, truth: _Truth) -> int:
        """Return a value that is zero where a truth value does not hold, and not zero where it holds."""
        if truth.value is None:
            return self._value(0)
        return self._build.append(EQUAL, truth.value, self._value(0)) if truth.negated else truth.value
