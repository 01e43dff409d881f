"""Functions of arrays that are traced once, and then run in compiled code in every format.

A :class:`TracedFunction` runs its function on arrays of no format, whose operations are recorded on a
:class:`~gpbnb.arithmetic.tape.Tape`. Loops over steps become as many operations, and comparisons become truth values
that ``np.where``, ``np.clip``, ``np.maximum`` and other functions choose by. A tape cannot follow a function that
branches on a number, that asks for the digits of its format, or that converts numbers. Such a function runs operation
by operation, and :attr:`TracedFunction.reason` says why.
"""

from __future__ import annotations

import math
import operator
from collections.abc import Callable, Iterator, Sequence
from functools import partial, reduce
from typing import Any, NamedTuple, NoReturn, cast

import numpy as np

from gpbnb.arithmetic import functions, linalg
from gpbnb.arithmetic.array import ComponentArray, FloatArray
from gpbnb.arithmetic.conversion import entries
from gpbnb.arithmetic.elementary import elementary
from gpbnb.arithmetic.exits import unseen
from gpbnb.arithmetic.kernels.backends import Backend
from gpbnb.arithmetic.protocols import broadcast
from gpbnb.arithmetic.rounding import Rounding
from gpbnb.arithmetic.tape import Places, Tape, laid_out

_PLAIN = (int, float, str)
_ORDERS, _BITS = np.array([-1, 0, 1]), np.array([1, 2, 4])


class TracedFunction:
    """A function of a format and arrays that is traced for each set of shapes, and then runs as a list of operations.

    The results have the same digits as those of the function itself. If a run meets an overflow, a division by zero
    or the root of a negative number, the function itself runs instead and raises its own error.

    Parameters
    ----------
    function : ``function(fmt, *arrays)``, which returns an array of the format, or a list or tuple of such arrays,
        possibly nested. It is called once for each set of shapes of its arrays, with placeholders in place of
        numbers. It must not depend on anything that changes between its calls.

    Raises
    ------
    TypeError : the function cannot be called.

    Examples
    --------
    >>> import numpy as np
    >>> from gpbnb import BINARY32, FloatFormat
    >>> def integrator(fmt, z):
    ...     total, found = fmt.array(0), []
    ...     for value in z:
    ...         total = np.clip(total + value / 10, -1, 1)
    ...         found.append(total)
    ...     return np.stack(found)
    >>> traced = TracedFunction(integrator)
    >>> traced(BINARY32, [3, 4, 5]).to_float()
    array([0.30000001, 0.70000005, 1.        ])
    >>> traced(FloatFormat(10, 2), [3, 4, 5]).to_float(), traced.reason
    (array([0.3, 0.7, 1. ]), '')
    """

    def __init__(self, function: Callable[..., Any]) -> None:
        if not callable(function):
            raise TypeError(f"got a {type(function).__name__}; needed a function of a format and arrays")
        self.__wrapped__ = function
        self._traces: dict[tuple[tuple[int, ...], ...], _Trace | str] = {}
        #: Why the last run was one of the function itself; empty if it was one of its operations.
        self.reason = ""

    def __reduce__(self) -> tuple[Any, ...]:
        return TracedFunction, (self.__wrapped__,)

    @property
    def refusal(self) -> str:
        """Why the function cannot be traced; empty if it can be, or if it has not run yet."""
        return next((each for each in self._traces.values() if isinstance(each, str)), "")

    def recorded(self, *shapes: tuple[int, ...]) -> tuple[Tape, Any]:
        """Return the operations for arrays of the given shapes, and the function's result with placeholders.

        Raises
        ------
        ValueError : the function cannot be traced; the message says why.
        """
        trace = self._trace(shapes)
        if isinstance(trace, str):
            raise ValueError(f"got a function that cannot be traced: {trace}; needed one that can, without branches")
        return trace.tape, trace.returned

    def _trace(self, shapes: tuple[tuple[int, ...], ...]) -> _Trace | str:
        if shapes not in self._traces:
            self._traces[shapes] = self._traced(shapes)
        return self._traces[shapes]

    def __call__(self, fmt: Any, *given: Any) -> Any:
        """Run the function in a format, with numbers that are first rounded into it."""
        if type(fmt) is TracedFormat:  # part of a function that is traced itself
            return self.__wrapped__(fmt, *given)
        arrays = [fmt.array(each) for each in given]
        trace = self._trace(tuple(each.shape for each in arrays))
        if isinstance(trace, str):
            self.reason = trace
        elif fmt.rounding is Rounding.STOCHASTIC:
            self.reason = "random roundings are drawn operation by operation"
        else:
            self.reason = ""
            try:
                return trace.run(fmt, arrays)
            except (ArithmeticError, ValueError, TypeError) as error:
                self.reason = f"a run of its operations stops: {error}"
        return self.__wrapped__(fmt, *arrays)

    def _traced(self, shapes: Sequence[tuple[int, ...]]) -> _Trace | str:
        """Run the function on arrays without numbers; return what it did, or why it cannot be repeated."""
        tape = Tape(sum(math.prod(shape) for shape in shapes))
        fmt = TracedFormat(tape)
        arrays = map(fmt.made, laid_out(shapes))
        try:
            with unseen(fmt) as shown:
                returned = self.__wrapped__(fmt, *arrays)
                found = list(_arrays(returned, tape))
        except Exception as error:
            what = tape.refusal or f"without numbers it stops: {error}"
            return what + _line(error, self.__wrapped__)
        if shown:
            return "it shows values with peek"
        return tape.refusal or _Trace(tape, returned, np.concatenate([each.components[0].ravel() for each in found]))


class _Trace(NamedTuple):
    """A function that was traced: its operations, what it returned, and the places of all numbers in that."""

    tape: Tape
    returned: Any
    places: Places

    def run(self, fmt: Any, arrays: Sequence[FloatArray]) -> Any:
        """Repeat the operations for numbers of a format, and return what the function returns."""
        flat = [each.reshape(-1) for each in arrays] or [fmt.array([])]
        found = self.tape.run(flat[0] if len(flat) == 1 else cast(Any, np.concatenate)(flat), self.places)
        at = 0

        def filled(part: Any) -> Any:
            nonlocal at
            if isinstance(part, (list, tuple)):
                return type(part)(map(filled, part))
            at += part.size
            return found[at - part.size : at].reshape(part.shape)

        return filled(self.returned)


def _arrays(returned: Any, tape: Tape) -> Iterator[TracedArray]:
    """Yield the arrays that a function returns, one after the other."""
    if isinstance(returned, TracedArray):
        yield returned
    elif type(returned) in (list, tuple) and returned:
        for each in returned:
            yield from _arrays(each, tape)
    else:
        tape.refuse(f"it returns a {type(returned).__name__}")


def _line(error: BaseException, function: Any) -> str:
    """Name the line of the function's file where an error came from; empty if it is not known."""
    file, found = getattr(getattr(function, "__code__", None), "co_filename", None), 0
    step = error.__traceback__
    while step is not None:
        if step.tb_frame.f_code.co_filename == file:
            found = step.tb_lineno
        step = step.tb_next
    return f", in line {found}" if found else ""


class _Recording(Backend):
    """The backend of arrays of places, which has no numbers."""

    dtype = np.int64
    records = True

    def __init__(self, tape: Tape) -> None:
        self._tape = tape

    def _refuse(self, *given: Any) -> NoReturn:
        self._tape.refuse("it converts numbers of the format")

    from_exact = to_exact = from_numbers = from_backend = _refuse  # type: ignore[assignment]
    apply = compare = to_float = restart = _refuse  # type: ignore[assignment]


class TracedFormat:
    """The format of arrays of places, which makes constants and says nothing about its digits."""

    __hash__ = None  # type: ignore[assignment]

    def __init__(self, tape: Tape, number: int = 0) -> None:
        #: The tape on which operations are recorded, and the number of this format on it.
        self.tape, self.number = tape, number
        self._recording = _Recording(tape)
        #: What functions of ``np.linalg`` do.
        self.algebra = linalg.NUMPY

    def made(self, places: Places) -> TracedArray:
        """Return an array of places."""
        made = object.__new__(TracedArray)
        made._format, made.backend, made.components = cast(Any, self), self._recording, (places,)
        return made

    def array(self, values: Any) -> TracedArray:
        """Return constants that each run rounds into its format."""
        return self.constant(values, exactly=False)

    def zeros(self, shape: int | tuple[int, ...]) -> TracedArray:
        """Return an array of zeros."""
        return self.made(np.zeros(shape, dtype=np.int64))

    def eye(self, n: int, m: int | None = None) -> TracedArray:
        """Return the identity matrix (n, n), or (n, m) with ones on the diagonal."""
        return self.constant(np.eye(n, m, dtype=int), exactly=False)

    def constant(self, values: Any, exactly: bool) -> TracedArray:
        """Return constants, which must be exact in every format if `exactly` is set."""
        if isinstance(values, TracedArray):
            other: Any = values.format
            if other is self or other.tape is not self.tape:
                return values
            return self.made(self.tape.record("round", values.components[0], fmt=self.number))
        if self.number:
            return self.made(self.tape.record("round", self._constant(values, exactly).components[0], fmt=self.number))
        return self._constant(values, exactly)

    def _constant(self, values: Any, exactly: bool) -> TracedArray:
        if type(values) in _PLAIN:
            return self.made(np.array(self.tape.constant(values, exactly)))
        if isinstance(values, (FloatArray, TracedTruth)):
            self.tape.refuse("it takes arrays of another format, or truth values, as numbers")
        if isinstance(values, (list, tuple)) and values:
            parts = [self.constant(each, exactly) for each in values]
            if len({part.shape for part in parts}) > 1:
                self.tape.refuse("it makes an array of parts of unequal shapes")
            return self.made(np.stack([part.components[0] for part in parts]))
        return self.made(self.tape.constants(entries(values), exactly))

    def _refused(self, *given: Any) -> NoReturn:
        self.tape.refuse("it asks for its format")

    def __getattr__(self, name: str) -> Any:
        if name.startswith("__"):
            raise AttributeError(name)
        self.tape.refuse(f"it asks for fmt.{name}")

    def __eq__(self, other: object) -> bool:
        return self is other or self._refused()

    __repr__ = __str__ = __format__ = __bool__ = __reduce_ex__ = _refused

    @property
    def __class__(self) -> Any:
        """Refuse to tell what kind of format it is, as ``isinstance`` asks."""
        self._refused()

    @__class__.setter
    def __class__(self, kind: Any) -> None:
        self._refused()


class TracedArray(FloatArray):
    """An array whose operations are recorded."""

    __slots__ = ()

    format: Any

    @property
    def tape(self) -> Tape:
        """The tape on which operations are recorded."""
        tape: Tape = self.format.tape
        return tape

    def operand(self, other: Any) -> TracedArray:
        """Return the other operand, an array of the same trace or exact constants."""
        if type(other) is TracedArray and other._format is self._format:
            return other
        made: TracedArray = self.format.constant(other, exactly=True)
        return made

    def called(self, name: str, *arrays: TracedArray) -> TracedArray:
        """Record an elementary function."""
        own = {"fmod": functions.fmod, "remainder": functions.remainder, "floor_divide": functions.floor_divide}
        return self._called(own.get(name) or partial(elementary, name), arrays)

    def _called(self, function: Callable[..., FloatArray], arrays: Sequence[TracedArray]) -> TracedArray:
        made: TracedArray = self.format.made(self.tape.call(function, *(each.components[0] for each in arrays)))
        return made

    def multiply_add(self, factor: Any, addend: Any) -> TracedArray:
        """Record a fused multiply-add."""
        arrays = np.broadcast_arrays(*(each.components[0] for each in (self, *map(self.operand, (factor, addend)))))
        if self.tape.fuses:
            fused: TracedArray = self.format.made(self.tape.record("fused", *arrays, fmt=self.format.number))
            return fused
        return self._called(FloatArray.multiply_add, [self.format.made(each) for each in arrays])

    def _binary(self, name: str, left: Any, right: Any) -> TracedArray:
        made: TracedArray = self.format.made(
            self.tape.record(name, *_matched(name, self.operand(left), self.operand(right)), fmt=self.format.number)
        )
        return made

    def _unary(self, name: str) -> TracedArray:
        made: TracedArray = self.format.made(self.tape.record(name, self.components[0], fmt=self.format.number))
        return made

    def _compare(self, other: Any, holds: Callable[[Any], Any]) -> TracedTruth:
        orders = int(holds(_ORDERS).dot(_BITS))
        return TracedTruth(
            self.format, self.tape.record("compare", *_matched("compare", self, self.operand(other)), orders)
        )

    def _zeros(self, shape: tuple[int, ...]) -> TracedArray:
        made: TracedArray = self.format.zeros(shape)
        return made

    def __bool__(self) -> bool:
        self.tape.refuse("it branches on a number")

    def check_nonzero(self) -> None:
        """Record that this number must not be zero."""
        self.tape.check(int(self.components[0]))


def _matched(name: str, a: Any, b: Any) -> Sequence[Places]:
    """Return the places of two arrays in one shape."""
    x, y = a.components[0], b.components[0]
    if x.shape == y.shape:
        return x, y
    broadcast(name, x.shape, y.shape)
    return np.broadcast_arrays(x, y)


def _combination(table: int) -> Callable[[TracedTruth, Any], Any]:
    """Return the method that combines truth values a and b: the bit 2 a + b of a table is the result."""
    return lambda self, other: self._combined(other, table)


class TracedTruth(ComponentArray):
    """An array of truth values that each run finds anew."""

    __hash__ = None  # type: ignore[assignment]

    def __init__(self, fmt: TracedFormat, places: Any) -> None:
        self.format = fmt
        #: The places of the truth values.
        self.components = (np.asarray(places),)

    def reshape(self, *shape: Any) -> TracedTruth:
        """Return the same truth values in another shape."""
        return TracedTruth(self.format, self.components[0].reshape(*shape))

    def __len__(self) -> int:
        return len(self.components[0])

    def __getitem__(self, index: Any) -> TracedTruth:
        return TracedTruth(self.format, self.components[0][index])

    def __iter__(self) -> Iterator[TracedTruth]:
        return (self[i] for i in range(len(self)))

    def _operand(self, other: Any) -> TracedTruth:
        if isinstance(other, TracedTruth):
            return other
        plain = np.asarray(other)
        if plain.dtype != np.bool_:
            self.format.tape.refuse("it combines a comparison with numbers")
        return TracedTruth(self.format, plain.astype(np.int64))

    def _combined(self, other: Any, table: int) -> TracedTruth:
        places = _matched("truth values", self, self._operand(other))
        return TracedTruth(self.format, self.format.tape.record("combine", *places, table))

    __and__, __or__, __xor__ = _combination(0b1000), _combination(0b1110), _combination(0b0110)
    __rand__, __ror__, __rxor__ = __and__, __or__, __xor__
    __eq__, __ne__ = _combination(0b1001), _combination(0b0110)

    def __invert__(self) -> TracedTruth:
        return self._combined(self, 0b0001)

    def _reduced(self, combine: Callable[[Any, Any], Any], of_none: bool, axis: Any, keepdims: bool) -> TracedTruth:
        places = self.components[0]
        given = places.reshape(-1) if axis is None else np.moveaxis(places, operator.index(axis), 0)
        lines = [TracedTruth(self.format, each) for each in given]
        found = reduce(combine, lines) if lines else self._operand(np.full(given.shape[1:], of_none))
        kept = np.empty(places.shape, np.bool_).any(axis, keepdims=keepdims).shape
        return found.reshape(kept)

    def all(self, axis: int | None = None, keepdims: bool = False) -> TracedTruth:
        """Whether all hold."""
        return self._reduced(operator.and_, True, axis, keepdims)

    def any(self, axis: int | None = None, keepdims: bool = False) -> TracedTruth:
        """Whether one holds."""
        return self._reduced(operator.or_, False, axis, keepdims)

    def if_holds(self, changed: Callable[[], Any], unchanged: Any) -> Any:
        """Record what changes if this holds, and the choice; see ``filters.steps.if_holds``."""
        place = int(self.components[0])
        if place < 2:  # known
            return changed() if place else unchanged
        found = self.format.tape.only_if(self.components[0], changed)
        if isinstance(found, list):
            return [self.choose(a, b) for a, b in zip(found, unchanged, strict=True)]
        return self.choose(found, unchanged)

    def choose(self, a: Any, b: Any) -> TracedArray:
        """Return entries of the first array where the truth values hold, and of the second elsewhere."""
        array = self._array(a, b)

        def chosen(places: Sequence[Places]) -> Places:
            parts = np.broadcast_arrays(self.components[0], *places)
            return array.tape.record("choose", *parts, fmt=array.format.number)

        return cast(TracedArray, array.joined(chosen, [array.operand(each) for each in (a, b)]))

    def _array(self, *choices: Any) -> TracedArray:
        """Return an array among choices, with its derivatives if one has them."""
        arrays = [each for each in choices if isinstance(each, TracedArray)]
        if not arrays:
            self.format.tape.refuse("it chooses between plain numbers")
        return next((each for each in arrays if type(each) is not TracedArray), arrays[0])

    def _refuse(self, *given: Any) -> NoReturn:
        self.format.tape.refuse("it branches on a comparison, or counts or converts it")

    __bool__ = __index__ = __int__ = __float__ = __array__ = __setitem__ = _refuse

    def __getattr__(self, name: str) -> Any:
        if name.startswith("__"):
            raise AttributeError(name)
        self._refuse()

    def __array_ufunc__(self, ufunc: Any, method: str, *inputs: Any, **options: Any) -> Any:
        operation = _OF_TRUTHS.get(ufunc.__name__)
        if operation is None or method != "__call__" or options:
            self._refuse()
        return operation(*map(self._operand, inputs))

    def __array_function__(self, func: Any, types: Any, args: Any, kwargs: Any) -> Any:
        if func is np.where and len(args) == 3 and isinstance(args[0], TracedTruth):
            return args[0].choose(*args[1:])
        if func in (np.any, np.all) and isinstance(args[0], TracedTruth):
            return getattr(args[0], func.__name__)(*args[1:], **kwargs)
        if func is np.select:
            return self._selected(*args, **kwargs)
        self._refuse()

    def _selected(self, condlist: Any, choicelist: Any, default: Any = 0) -> Any:
        return functions.select(self._array(*choicelist, default), condlist, choicelist, default)


_OF_TRUTHS: dict[str, Callable[..., Any]] = {
    **dict.fromkeys(("logical_and", "bitwise_and"), operator.and_),
    **dict.fromkeys(("logical_or", "bitwise_or"), operator.or_),
    **dict.fromkeys(("logical_xor", "bitwise_xor", "not_equal"), operator.xor),
    **dict.fromkeys(("logical_not", "invert"), operator.invert),
    "equal": operator.eq,
}
