"""A tape: the operations of a function in the order in which they ran, to run again in any format.

A tape knows numbers and truth values by their places. :mod:`gpbnb.arithmetic.traced` records one by running a function
on arrays that hold places. :meth:`Tape.run` then repeats the operations on numbers, each rounded once, in compiled code
where the format has it.
"""

from __future__ import annotations

from array import array
from collections.abc import Callable, Sequence
from fractions import Fraction
from functools import cache, partial
from typing import Any, NamedTuple, NoReturn

import numpy as np
from numpy.typing import NDArray

from gpbnb.arithmetic.array import FloatArray, NegativeRootError
from gpbnb.arithmetic.kernels.backends import Compiled
from gpbnb.arithmetic.kernels.exact import ExactKernel

Places = NDArray[np.int64]
"""Numbers or truth values of a tape, of any shape."""

# fmt: off
CODES = {
    name: code for code, name in enumerate(
        ("add", "subtract", "multiply", "divide", "sqrt", "negative", "absolute", "choose", "compare", "combine")
    )
}
# fmt: on
"""Codes of operations, as in :mod:`gpbnb.arithmetic.kernels.replay`."""

MOST_OPERATIONS = 1 << 22
"""Longest tape. Arrays of so many entries run fast without one."""

FEW_OPERATIONS = 5_000
"""Shortest tape that runs in compiled code; for fewer operations, integers of Python are fast and need no loading."""

_DIVIDE, _SQRT, _CHOOSE, _COMPARE, _COMBINE = (
    CODES[name] for name in ("divide", "sqrt", "choose", "compare", "combine")
)


class UntraceableError(Exception):
    """A function has done what no tape can repeat."""


class Call(NamedTuple):
    """A function of arrays that is called between two operations of a tape.

    Parameters
    ----------
    at : number of operations before it.
    function : takes arrays of the format, each (n,), and returns another.
    operands, results : places, each (n,).
    """

    at: int
    function: Callable[..., FloatArray]
    operands: Sequence[NDArray[np.int64]]
    results: NDArray[np.int64]

    @property
    def name(self) -> str:
        """The name of the function, as in NumPy."""
        return str(self.function.args[0] if isinstance(self.function, partial) else self.function.__name__)


class Constants:
    """Numbers that a function takes from elsewhere, which each run rounds into its format.

    Parameters
    ----------
    exactly : whether only numbers that the format holds are allowed.
    """

    def __init__(self, exactly: bool) -> None:
        self.exactly = exactly
        self.places: list[int] = []
        self.numbers: list[Any] = []

    def rounded(self, fmt: Any) -> FloatArray:
        """Return the numbers in a format.

        Raises
        ------
        TypeError, ValueError, OverflowError : as for ``fmt.array``, or for an operand of an operation.
        """
        found: FloatArray = fmt.array([]).operand(self.numbers) if self.exactly else fmt.array(self.numbers)
        return found


class Tape:
    """Operations in the order in which they ran. Place 0 is the number zero; truth values 0 and 1 are false and true.

    Parameters
    ----------
    inputs : number of numbers that each run takes; their places are 1 and following.
    """

    def __init__(self, inputs: int) -> None:
        self.inputs = inputs
        #: The reason why the function cannot be repeated; empty if it can.
        self.refusal = ""
        self._instructions = array("i")
        self._values, self._truths = 1 + inputs, 2
        self._calls: list[Call] = []
        self._constants = (Constants(False), Constants(True))
        self._known: dict[Any, int] = {}

    def refuse(self, reason: str) -> NoReturn:
        """Stop recording, also if the function handles the error.

        Raises
        ------
        UntraceableError : always.
        """
        self.refusal = self.refusal or reason
        raise UntraceableError(reason)

    # -- recording -------------------------------------------------------------------------------------

    def constants(self, numbers: NDArray[Any], exactly: bool) -> Places:
        """Return places of constants, of the shape of an object array of numbers."""
        found = [self.constant(each, exactly) for each in numbers.ravel().tolist()]
        return np.array(found, dtype=np.int64).reshape(numbers.shape)

    def constant(self, number: Any, exactly: bool) -> int:
        """Return the place of a constant; equal constants of one type share a place."""
        key: tuple[Any, ...] = (type(number), number, exactly)
        try:
            place = self._known.get(key)
        except TypeError:  # a number without a hash
            key, place = (object(),), None
        if place is None:
            place = self._known[key] = self._values
            self._values += 1
            self._constants[exactly].places.append(place)
            self._constants[exactly].numbers.append(number)
        return place

    def record(self, name: str, *operands: Any) -> Places:
        """Record an operation on places of one shape, entry by entry, and return the places of its results.

        A third operand, a choice or a table, may be an int.
        """
        first = operands[0]
        code = CODES[name]
        truth = code >= _COMPARE
        size, begin = first.size, self._truths if truth else self._values
        if len(self._instructions) + 5 * size > 5 * MOST_OPERATIONS:
            self.refuse(f"it takes more than {MOST_OPERATIONS} operations")
        if size == 1:
            row = [code, 0, 0, 0, begin]
            for column, each in enumerate(operands, start=1):
                row[column] = each if type(each) is int else each.item()
            self._instructions.extend(row)
        else:
            rows = np.zeros((size, 5), dtype=np.intc)
            rows[:, 0], rows[:, 4] = code, np.arange(begin, begin + size)
            for column, each in enumerate(operands, start=1):
                rows[:, column] = each if type(each) is int else each.ravel()
            self._instructions.frombytes(rows.tobytes())
        if truth:
            self._truths += size
        else:
            self._values += size
        return np.arange(begin, begin + size).reshape(first.shape) if first.ndim else np.array(begin)

    def call(self, function: Callable[..., FloatArray], *operands: Places) -> Places:
        """Record the call of a function that takes one entry of each operand after the other."""
        results = np.arange(self._values, self._values + operands[0].size)
        self._values += len(results)
        self._calls.append(Call(len(self._instructions) // 5, function, [each.ravel() for each in operands], results))
        return results.reshape(operands[0].shape)

    @property
    def calls(self) -> Sequence[Call]:
        """The calls of functions, in their order."""
        return tuple(self._calls)

    def constants_in(self, fmt: Any) -> dict[int, Fraction]:
        """Return the constants as a format stores them, by their places.

        Raises
        ------
        TypeError, ValueError, OverflowError : as for :meth:`Constants.rounded`.
        """
        found: dict[int, Fraction] = {0: Fraction(0)}
        for each in self._constants:
            found.update(zip(each.places, np.ravel(each.rounded(fmt).to_fractions()).tolist(), strict=True))
        return found

    @property
    def instructions(self) -> NDArray[np.intc]:
        """Return the operations as an (n, 5) array with a code, three operands and the place of the result."""
        return np.frombuffer(self._instructions, dtype=np.intc).reshape(-1, 5)

    # -- running ---------------------------------------------------------------------------------------

    def run(self, inputs: FloatArray, results: Places) -> FloatArray:
        """Repeat the operations in the format of the inputs.

        Parameters
        ----------
        inputs : (inputs,).
        results : (m,), places.

        Raises
        ------
        ArithmeticError, ValueError, TypeError : an operation has no result in the format; a non-numeric constant.
        """
        fmt: Any = inputs.format
        constants = [each.rounded(fmt) for each in self._constants]
        given = [inputs, *constants]
        places = [np.arange(1, 1 + self.inputs), *(np.array(each.places, np.int64) for each in self._constants)]
        backend = fmt.backend
        if (
            isinstance(backend, Compiled)
            and len(self._instructions) >= 5 * FEW_OPERATIONS
            and all(each.backend is backend for each in given)
        ):
            found = self._compiled(backend, given, places, results)
            if found is not None:
                return found
        return self._exact(given, places, results)

    def _segments(self) -> list[tuple[int, int, Call | None]]:
        """Return first and last of the operations that run before each call, and after the last."""
        ends = [(each.at, each) for each in self._calls] + [(len(self._instructions) // 5, None)]
        return [(begin, end, each) for begin, (end, each) in zip([0, *(at for at, _ in ends)], ends, strict=False)]

    def _compiled(
        self, backend: Compiled, given: Sequence[FloatArray], places: Sequence[Places], results: Places
    ) -> FloatArray | None:
        """Run in compiled code; None if a number leaves the range of the backend, or has no value."""
        first = given[0]
        packed = [backend.pack(each.components) for each in given]
        values = np.zeros((self._values, *packed[0].shape[1:]), packed[0].dtype)
        for place, each in zip(places, packed, strict=True):
            values[place] = each
        truths, instructions = np.zeros(self._truths, np.uint8), self.instructions
        truths[1] = 1
        try:
            for begin, end, call in self._segments():
                if _replay()(backend.tag, instructions, begin, end, values, truths) < end:
                    return None
                if call is not None:
                    taken = [first.from_packed(values[each], first.format) for each in call.operands]
                    made = call.function(*taken)
                    if made.backend is not backend:
                        return None
                    values[call.results] = backend.pack(made.components)
        except (OverflowError, ZeroDivisionError):
            return None
        return first.from_packed(values[results], first.format)

    def _exact(self, given: Sequence[FloatArray], places: Sequence[Places], results: Places) -> FloatArray:
        """Run with integers of Python, which hold the numbers of every format."""
        first, (m, e) = given[0], np.zeros((2, self._values), dtype=object)
        for place, each in zip(places, given, strict=True):
            m[place], e[place] = each.on_exact_backend().components
        significands, exponents, truths = m.tolist(), e.tolist(), [False, True] + [False] * (self._truths - 2)
        rows, kernel = self.instructions.tolist(), first.format.kernel

        def numbers(taken: Places) -> FloatArray:
            listed = taken.tolist()
            pair = np.array([[each[i] for i in listed] for each in (significands, exponents)], dtype=object)
            return first.from_pairs(pair[0], pair[1], first.format)

        for begin, end, call in self._segments():
            _run_exactly(kernel, rows[begin:end], significands, exponents, truths)
            if call is not None:
                made = call.function(*map(numbers, call.operands))
                found = made.on_exact_backend().components
                for place, *pair in zip(call.results.tolist(), *found, strict=True):
                    significands[place], exponents[place] = pair
        return numbers(results)


def _run_exactly(
    kernel: ExactKernel, rows: list[list[int]], significands: list[int], exponents: list[int], truths: list[bool]
) -> None:
    m, e = significands, exponents
    of_two: list[Callable[..., tuple[int, int]]] = [kernel.add, kernel.subtract, kernel.multiply, kernel.divide]
    of_one: list[Callable[..., tuple[int, int]]] = [kernel.sqrt, kernel.negative, kernel.absolute]
    compare = kernel.compare
    for code, a, b, c, out in rows:
        if code <= _DIVIDE:
            if code == _DIVIDE and m[b] == 0:
                raise ZeroDivisionError("got a division by zero; needed a divisor other than zero")
            m[out], e[out] = of_two[code](m[a], e[a], m[b], e[b])
        elif code == _CHOOSE:
            chosen = b if truths[a] else c
            m[out], e[out] = m[chosen], e[chosen]
        elif code == _COMPARE:
            truths[out] = bool(c >> (compare(m[a], e[a], m[b], e[b]) + 1) & 1)
        elif code == _COMBINE:
            truths[out] = bool(c >> (2 * truths[a] + truths[b]) & 1)
        else:
            if code == _SQRT and m[a] < 0:
                raise NegativeRootError("got the square root of a negative number; needed x >= 0")
            m[out], e[out] = of_one[code - _SQRT](m[a], e[a])


@cache
def _replay() -> Callable[..., int]:
    # Imported here because numba takes a second to import.
    from gpbnb.arithmetic.kernels.replay import replay

    return replay
