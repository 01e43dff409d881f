"""Backends that store an array's numbers and compute with them: as float64, two or three int64, or Python integers.

A backend works on `components`, a tuple of arrays with the same shape, so that NumPy can reshape, slice and join all of
them in the same way. The first array carries the sign. If a compiled backend cannot hold or compute a result, it
returns None, and the exact backend computes the same digits instead. The compiled loops are imported on first use.
"""

from __future__ import annotations

import contextlib
import math
from abc import ABC, abstractmethod
from collections import Counter
from collections.abc import Iterator, Sequence
from fractions import Fraction
from functools import cache, cached_property
from typing import Any, cast

import numpy as np
from numpy.typing import NDArray

from gpbnb.arithmetic import machine
from gpbnb.arithmetic.kernels.exact import kernel, one_per_format, size_text
from gpbnb.arithmetic.kernels.selection import is_binary32, is_binary64, tag_of, wide_tag
from gpbnb.arithmetic.kernels.tags import (
    EVEN,
    FARTHEST,
    QUICK_LEAST,
    SAFE_TWICE,
    Careful,
    Double,
    Float,
    Proved,
    Quick,
    Single,
    Tag,
    Wide,
    extents_of_sums,
    random_state,
)
from gpbnb.arithmetic.rounding import Rounding, Rules
from gpbnb.interrupts import slices

Array = NDArray[Any]
Components = tuple[Array, ...]

_FEW = 1 << 18  # numbers that the machine rounds, which other work needs as well: no loop is compiled for them
LOOPS_AFTER = 20_000  # operations of a kind, which exact arithmetic does in 0.1 s; compiling a loop takes up to 3 s
_MANY = 1000  # multiplications in a product for which a look at the range of its entries pays
_LEAST_32, _LARGEST_32 = 2.0**-126, float(np.finfo(np.float32).max)


class Backend(ABC):
    """Store numbers of one format and compute with them."""

    dtype: Any
    records = False  # whether it only records operations, and holds no numbers

    def __init__(self, rules: Rules) -> None:
        self.rules = rules
        self.base, self.precision = rules.base, rules.precision
        self.nearest = rules.rounding is Rounding.NEAREST
        self.kernel = kernel(rules)

    def __reduce__(self) -> tuple[Any, ...]:
        return type(self), (self.rules,)

    def restart(self) -> None:
        """Restart the random numbers of stochastic rounding."""
        self.kernel.restart()

    @abstractmethod
    def from_exact(self, m: Array, e: Array) -> Components | None:
        """Convert normalized pairs of Python integers to components; None if they do not fit."""

    @abstractmethod
    def to_exact(self, components: Components) -> Components:
        """Convert components to significands and exponents, as Python integers."""

    @abstractmethod
    def from_numbers(self, values: Array, exactly: bool) -> Components | None:
        """Round an array of a NumPy number type; with `exactly`, return None if rounding changes an entry."""

    def from_backend(self, other: Backend, components: Components) -> Components | None:
        """Round numbers that another backend holds; None if this takes its exact kernel."""
        return None

    @abstractmethod
    def apply(self, name: str, *operands: Components) -> Components | None:
        """Apply an operation of :class:`ExactKernel` to each entry; callers exclude zero divisors, negative roots."""

    @abstractmethod
    def compare(self, a: Components, b: Components) -> Array:
        """Compare each pair of entries: -1, 0 or 1, as int8."""

    @abstractmethod
    def to_float(self, components: Components) -> Array:
        """Round each entry to the nearest float64; raises OverflowError like :meth:`ExactKernel.to_float`."""

    def sort_keys(self, components: Components) -> Components | None:
        """Return keys for ``np.lexsort``, the most significant last, or None if there are none."""
        return None

    def fold(self, name: str, components: Components) -> Components | None:
        """Combine the entries along the first axis from left to right; there must be at least one."""
        return None

    def scan(self, components: Components) -> Components | None:
        """Sum from left to right along the first axis, and keep each partial sum."""
        return None

    def matmul(self, a: Components, b: Components) -> Components | None:
        """Multiply two matrices with an inner dimension of at least 1, summing each entry from left to right."""
        return None


class Exact(Backend):
    """Any format: significands and exponents are Python integers."""

    dtype = object

    def from_exact(self, m: Array, e: Array) -> Components:
        return m, e

    def to_exact(self, components: Components) -> Components:
        return components

    def from_numbers(self, values: Array, exactly: bool) -> None:
        return None

    def apply(self, name: str, *operands: Components) -> Components:
        try:
            return self._ufunc(name, 2 * len(operands), 2)(*(part for components in operands for part in components))
        except OverflowError as error:
            raise OverflowError(f"{_NAMES[name]}{self._place(name, operands)}: {error}") from None

    def _place(self, name: str, operands: tuple[Components, ...]) -> str:
        """Index of the first entry that overflows, for the message."""
        parts = np.broadcast_arrays(*(np.asarray(part, object) for components in operands for part in components))
        operation = getattr(self.kernel, name)
        for index in np.ndindex(parts[0].shape):
            try:
                operation(*(part[index] for part in parts))
            except OverflowError:
                return f" at [{', '.join(map(str, index))}]" if index else ""
        return ""

    def compare(self, a: Components, b: Components) -> Array:
        return np.asarray(self._ufunc("compare", 4, 1)(*a, *b), dtype=np.int8)

    def to_float(self, components: Components) -> Array:
        return np.asarray(self._ufunc("to_float", 2, 1)(*components), dtype=np.float64)

    def _ufunc(self, name: str, inputs: int, outputs: int) -> Any:
        return np.frompyfunc(getattr(self.kernel, name), inputs, outputs)


_CODED = {"round_": "round"}  # names of operations that the machine calls otherwise
_NAMES = {
    "add": "addition",
    "subtract": "subtraction",
    "multiply": "multiplication",
    "divide": "division",
    "fused": "fused multiply-add",
    "sqrt": "square root",
    "negative": "negation",
    "absolute": "absolute value",
}


_USED = set[str]()
"""Modules whose compiled loops have been used."""

_DONE: Counter[type[Tag]] = Counter()
"""Operations of each kind of numbers so far."""


class Looped(Backend):
    """Common part of the backends with compiled loops."""

    count: int  # number of components
    tag: Tag

    def __init__(self, rules: Rules, tag: Tag) -> None:
        super().__init__(rules)
        self.tag = tag
        self.exact = exact(rules)

    def __reduce__(self) -> tuple[Any, ...]:
        return backend, (self.rules,)

    def _early(self, operations: int) -> bool:
        """Whether these operations, the next of their kind, come so early that no loop is compiled for them."""
        kind = type(self.tag)
        _DONE[kind] += operations
        return _DONE[kind] <= LOOPS_AFTER and random_state(self.tag) is None

    def from_numbers(self, values: Array, exactly: bool) -> Components | None:
        return None if self._early(values.size) else self._from_numbers(values, exactly)

    @abstractmethod
    def _from_numbers(self, values: Array, exactly: bool) -> Components | None: ...

    def from_backend(self, other: Backend, components: Components) -> Components | None:
        return None if self._early(components[0].size) else self._from_backend(other, components)

    def apply(self, name: str, *operands: Components) -> Components | None:
        if name in ("negative", "absolute"):
            return self._signed(name, operands[0])
        shape = _shape(*operands)
        if name != "round_" and self._early(math.prod(shape)):
            pairs = self.exact.apply(name, *map(self.to_exact, operands))
            return self.from_exact(*(np.asarray(part, dtype=object) for part in pairs))
        return self._applied(name, shape, [tuple([_flat(part, shape) for part in each]) for each in operands])

    @abstractmethod
    def _signed(self, name: str, components: Components) -> Components | None:
        """Return opposites or absolute values, if the format has all of them."""

    def _applied(self, name: str, shape: tuple[int, ...], flat: Sequence[Components]) -> Components | None:
        size = math.prod(shape)
        if name == "round_" and 0 < size <= _FEW:
            found = machine.rounded(*self._machine, self.pack(flat[0]))
            return None if found is None else tuple(part.reshape(shape) for part in self.unpack(found))
        out, (kind, formats) = self._empty(size), self._machine
        try:
            if name == "fused":
                _along(_loops("elementwise").fused, (kind, formats.address), size, *flat, out)
            else:
                code = machine.CODES[_CODED.get(name, name)]
                _along(_loops("elementwise").ALONG[code], (kind, formats.address, code), size, flat[0], flat[-1], out)
        except OverflowError:
            return None
        return tuple(part.reshape(shape) for part in out)

    @cached_property
    def _machine(self) -> tuple[Any, Any]:
        """The kind and columns of the format on the machine."""
        return machine.tables([self], self.tag)

    def fold(self, name: str, components: Components) -> Components | None:
        found = self._accumulated(name, components)
        return None if found is None else self.unpack(found[-1])

    def scan(self, components: Components) -> Components | None:
        found = self._accumulated("add", components)
        return None if found is None else self.unpack(found)

    def _accumulated(self, name: str, components: Components) -> Array | None:
        """Combine rows from left to right; return each result, or None if the format does not have one."""
        if self._early(10 * components[0].size):
            return None
        numbers = self.pack(components)
        return numbers if self._accumulate(name, numbers) else None

    def _accumulate(self, name: str, numbers: Array) -> bool:
        """Combine packed rows, each with the result before it; return whether the format has all of them."""
        width = math.prod(numbers.shape[1 : numbers.ndim - (self.count > 1)])
        return machine.accumulate(*self._machine, name, numbers.reshape(len(numbers), width, self.count))

    def _from_backend(self, other: Backend, components: Components) -> Components | None:
        """Round numbers of a backend with significands of one or two words."""
        if not isinstance(other, Pairs | TwoWords) or other.wide is None:
            return None
        return self._converted(other.wide, other.in_two_words(components))

    def _converted(self, source: Wide, given: Components, exactly: bool = False) -> Components | None:
        """Round numbers of another format, as the components of :class:`TwoWords`."""
        if self.wide is None:
            return None
        flat = tuple(_flat(part, given[0].shape) for part in given)
        out, states = tuple(np.empty(flat[0].size, np.int64) for _ in flat), np.empty(flat[0].size, np.int8)
        of_source = kernel(Rules(1 << source.bits if source.bits else 10, source.precision, Rounding.CHOP))
        try:
            _along(_loops("wide").converted, (source, self.wide, exactly), states.size, flat, out, states)
            if exactly and states.any():
                return None
            for i in np.flatnonzero(states == 2).tolist():
                high, low, e = (int(part[i]) for part in flat)
                size = (abs(high) << source.split) | low
                value = of_source.to_fraction(-size if high < 0 else size, e)
                m, e = self.kernel.from_ratio(value.numerator, value.denominator)
                high, low = divmod(abs(m), 1 << self.wide.split)
                out[0][i], out[1][i], out[2][i] = (-high if m < 0 else high), low, e
        except OverflowError:
            return None
        return self.from_two_words(tuple(part.reshape(given[0].shape) for part in out))

    @cached_property
    def wide(self) -> Wide | None:
        """The tag of the same format with significands of two words, if it has one; conversions use it."""
        return wide_tag(self.rules)

    @abstractmethod
    def in_two_words(self, components: Components) -> Components:
        """Return numbers as the components of :class:`TwoWords`."""

    @abstractmethod
    def from_two_words(self, components: Components) -> Components | None:
        """Return the components of numbers that :class:`TwoWords` holds, or None if they do not fit."""

    def compare(self, a: Components, b: Components) -> Array:
        shape = _shape(a, b)
        if self._early(math.prod(shape)):
            return self.exact.compare(self.to_exact(a), self.to_exact(b))
        order = np.empty(math.prod(shape), np.int8)
        x, y = (tuple(_flat(part, shape) for part in components) for components in (a, b))
        kind, formats = self._machine
        _along(_loops("elementwise").compared, (kind, formats.address), order.size, x, y, order)
        return order.reshape(shape)

    def to_float(self, components: Components) -> Array:
        shape, size = components[0].shape, components[0].size
        if self._early(size):
            return self.exact.to_float(self.to_exact(components))
        flat, x, states = tuple(_flat(part, shape) for part in components), np.empty(size), np.empty(size, np.int8)
        self._to_floats(flat, x, states)
        if (hard := states == 2).any():
            x[hard] = self.exact.to_float(self.to_exact(tuple(part[hard] for part in flat)))
        return x.reshape(shape)

    def _to_floats(self, flat: Components, x: Array, states: Array) -> None:
        """Set x to the nearest float64, and states to 2 where they need exact arithmetic."""
        raise NotImplementedError

    def matmul(self, a: Components, b: Components) -> Components | None:
        """Multiply matrices, in the first kind of numbers that holds all results."""
        (rows, count), columns = a[0].shape, b[0].shape[1]
        if self._early(2 * rows * count * columns):
            return None
        product = _loops("matrices").product
        for kind, (x, y) in self._attempts([a, b], rows * count * columns, copy=None):
            c = np.empty((rows, columns, *x.shape[2:]), x.dtype)
            given = kind, *self._of_loops, *map(_fixed, (x, y)), c.reshape(-1)
            with contextlib.suppress(OverflowError):
                parts = slices(rows, count * columns)
                if not any(product(*given, part.start, part.stop, count, columns) for part in parts):
                    return self.unpack(c)
        return None

    def factored(self, a: Components, pivot: bool) -> tuple[Components, NDArray[np.intp], int] | None:
        """Factor a matrix; return both factors in one, the order of rows and the column of a zero pivot, or below 0."""
        n = len(a[0])
        if self._early(n**3):
            return None
        loops = _loops("matrices")
        for kind, (x,) in self._attempts([a]):
            order, column = np.arange(n), loops.NONE
            with contextlib.suppress(OverflowError):
                for part in slices(n, n * n):
                    column = loops.factor(kind, *self._of_loops, x.reshape(-1), order, pivot, part.start, part.stop)
                    if column != loops.NONE:
                        break
                if column != loops.GONE:
                    return self.unpack(x), order, column
        return None

    def solved(self, factors: Components, b: Components) -> Components | None:
        """Solve for right-hand sides (n, p), in the order of the factored matrix."""
        n, p = b[0].shape
        if self._early(n * n * p):
            return None
        for kind, (x, y) in self._attempts([factors, b]):
            gone, given = False, (kind, *self._of_loops, _fixed(x))
            with contextlib.suppress(OverflowError):
                for part in slices(p, n * n):
                    some = np.ascontiguousarray(y[:, part])
                    gone |= _loops("matrices").solved(*given, some.reshape(-1), n, some.shape[1])
                    y[:, part] = some
                if not gone:
                    return self.unpack(y)
        return None

    @property
    def _of_loops(self) -> tuple[int, Array]:
        """The address of the format, and room, as loops over matrices take them."""
        return self._machine[1].address, np.empty(_loops("matrices").ROOM)

    def _attempts(
        self, given: Sequence[Components], products: int = 0, copy: bool | None = True
    ) -> Iterator[tuple[Any, list[Array]]]:
        """Yield the kinds of numbers in which loops over matrices may run, the fastest first, and packed matrices."""
        yield self._machine[0], [self.pack(each, copy=copy) for each in given]

    def pack(self, components: Components, copy: bool | None = True, dtype: Any = None) -> Array:
        """Pack components in the layout that compiled loops take and return.

        The array is new; without `copy`, only if the components do not have this layout.
        """
        if self.count > 1:
            return np.ascontiguousarray(np.stack(components, axis=-1))
        return np.array(components[0], dtype or self.dtype, order="C", copy=copy)

    def unpack(self, array: Array) -> Components:
        """Unpack an array that :meth:`pack` made into components, as new arrays."""
        if self.count == 1:
            return (np.array(array, self.dtype, order="C"),)
        return tuple(np.array(array[..., i], order="C") for i in range(self.count))

    def _empty(self, size: int) -> Components:
        return tuple(np.empty(size, self.dtype) for _ in range(self.count))


class Compiled(Looped):
    """Common part of the backends whose arithmetic the loops of filters know, too."""


class Floats(Compiled):
    """Bases 2 and 16, stored as float64."""

    dtype = np.float64
    count = 1
    lowest_power, highest_power = -960, 1023  # powers of two between which its numbers lie

    def __init__(self, rules: Rules, tag: Tag) -> None:
        super().__init__(rules, tag)
        self.bits = rules.base.bit_length() - 1
        self._random = random_state(tag) is not None
        self._single, self._double = is_binary32(rules), is_binary64(rules)
        if self._double:
            self.lowest_power, self.highest_power = -1074, 1024

    def restart(self) -> None:
        super().restart()
        if (state := random_state(self.tag)) is not None:
            state[1] = 0

    def from_exact(self, m: Array, e: Array) -> Components | None:
        # base**(e + t - 1) <= |x| < base**(e + t)
        if np.any((e + self.precision) * self.bits > self.highest_power):
            return None
        if np.any((e + self.precision - 1) * self.bits < self.lowest_power):
            return None
        return (np.asarray(np.ldexp(m.astype(np.float64), self.bits * e.astype(np.int64))),)

    def to_exact(self, components: Components) -> Components:
        m, _, e = self.in_two_words(components)
        return m.astype(object), e.astype(object)

    def in_two_words(self, components: Components) -> Components:
        x = components[0]
        e = (np.frexp(x)[1].astype(np.int64) - 1) // self.bits - (self.precision - 1)
        e = np.where(x == 0, 0, e)
        return np.ldexp(x, -self.bits * e).astype(np.int64), np.zeros(x.shape, np.int64), e

    def _from_numbers(self, values: Array, exactly: bool) -> Components | None:
        kind, size = values.dtype.kind, values.dtype.itemsize
        if kind not in "fiu" or size > 8:
            return None
        x = values.astype(np.float64, copy=False)
        if kind != "f" and size == 8 and not (np.abs(x) <= 2.0**53).all():
            return None
        components = self.apply("round_", (x,))
        return None if components is None or (exactly and not np.array_equal(components[0], x)) else components

    def _from_backend(self, other: Backend, components: Components) -> Components | None:
        if isinstance(other, Floats):
            return self.apply("round_", components)
        return super()._from_backend(other, components)

    def from_two_words(self, components: Components) -> Components | None:
        return self.from_exact(components[0], components[2])  # with at most 53 bits, the lower word is empty

    def _signed(self, name: str, components: Components) -> Components | None:
        x = components[0]
        if not self._has_opposites(x):
            return None
        return (np.asarray(0.0 - x if name == "negative" else np.abs(x)),)

    def _applied(self, name: str, shape: tuple[int, ...], flat: Sequence[Components]) -> Components | None:
        size, numbers = math.prod(shape), [each[0] for each in flat]
        if name == "round_" and 0 < size <= _FEW and not ("floats" in _USED or self._random):
            found = machine.rounded(*self._machine, numbers[0])
            return None if found is None else (found.reshape(shape),)
        code, (_, formats), loops = machine.CODES[_CODED.get(name, name)], self._machine, _loops("floats")
        out, given, gone = np.empty(size), (*numbers, numbers[0], numbers[0])[:3], False
        for part in slices(size):
            here = formats.address, code, part.stop - part.start, *(each[part] for each in given), out[part]
            gone |= bool(loops.along(*here) and loops.carefully_along(*here))
        return None if gone else (out.reshape(shape),)

    def _accumulate(self, name: str, numbers: Array) -> bool:
        width, flat, gone = math.prod(numbers.shape[1:]), numbers.reshape(-1), False
        code, (_, formats), loops = machine.CODES[name], self._machine, _loops("floats")
        for part in slices(len(numbers) - 1, width):
            gone |= bool(loops.accumulate(formats.address, code, (part.start + 1, part.stop + 1), width, flat))
        return not gone

    def matmul(self, a: Components, b: Components) -> Components | None:
        if b[0].shape[1] < a[0].shape[0] and not self._random:
            # The inner loop runs over the columns, so the product of the transposes is faster. No digit changes.
            c = super().matmul((b[0].T,), (a[0].T,))
            return None if c is None else (np.ascontiguousarray(c[0].T),)
        return super().matmul(a, b)

    def _attempts(
        self, given: Sequence[Components], products: int = 0, copy: bool | None = True
    ) -> Iterator[tuple[Any, list[Array]]]:
        kind, _ = self._machine

        def packed(dtype: Any = np.float64) -> list[Array]:
            return [self.pack(each, copy, dtype) for each in given]

        if self._single or self._double:
            yield (Single(), packed(np.float32)) if self._single else (Double(), packed())
            return
        if isinstance(kind, Quick):
            proved = self._proved(*given) if products >= _MANY else None
            yield kind if proved is None else proved, packed(np.float32 if isinstance(proved, Single) else np.float64)
            kind = Careful()
        yield kind, packed()

    def _proved(self, a: Components, b: Components) -> Any:
        """Return the fastest kind of numbers if the sizes of two matrices prove that their product is in its range."""
        (low, high), (low_b, high_b) = _loops("matrices").extents(*(_flat(each[0], each[0].shape) for each in (a, b)))
        n, smallest, largest = a[0].shape[1], (low, low_b), (high, high_b)
        tag = cast(Float, self.tag)
        gradual, even = tag.gradual, tag.mode == EVEN and self.base == 2
        low, high = extents_of_sums(n, self.base, self.precision, gradual, math.prod(smallest), math.prod(largest))
        if not high <= tag.largest or not (gradual or low >= tag.least):
            return None
        if even and self.precision == 53:
            return Double() if low >= gradual else None
        short = even and self.precision <= SAFE_TWICE
        single = min(low, *smallest) >= max(_LEAST_32, gradual) and max(high, *largest) <= _LARGEST_32
        if short and self.precision == 24 and single:
            return Single()
        return Proved() if low >= gradual or (short and gradual >= QUICK_LEAST) else None

    def _has_opposites(self, x: Array) -> bool:
        """Whether the opposite of each number is in the format; that of the lowest fixed-point number is not."""
        limits = self.rules.limits
        return limits is None or not limits.fixed or not np.any(x == float(limits.lowest))

    def compare(self, a: Components, b: Components) -> Array:
        return np.asarray(np.greater(a[0], b[0]).astype(np.int8) - np.less(a[0], b[0]).astype(np.int8))

    def sort_keys(self, components: Components) -> Components:
        return components

    def to_float(self, components: Components) -> Array:
        return components[0].copy()


class Pairs(Compiled):
    """Base 10: significand and exponent as int64."""

    dtype = np.int64
    count = 2

    def from_exact(self, m: Array, e: Array) -> Components | None:
        if np.any(e > FARTHEST) or np.any(e < -FARTHEST):
            return None
        return m.astype(np.int64), e.astype(np.int64)

    def to_exact(self, components: Components) -> Components:
        return components[0].astype(object), components[1].astype(object)

    def _from_numbers(self, values: Array, exactly: bool) -> Components | None:
        if values.dtype.kind == "f" and values.dtype.itemsize <= 8:
            return self._from_floats(values.astype(np.float64, copy=False), exactly)
        if values.dtype.kind not in "iu":
            return None
        largest = 10**self.precision if exactly else 2**63
        if ((values >= largest) | (values <= -largest)).any():
            return None
        return self.apply("round_", (values.astype(np.int64), np.zeros(values.shape, np.int64)))

    def _from_floats(self, x: Array, exactly: bool) -> Components | None:
        out, states = self._empty(x.size), np.empty(x.size, np.int8)
        try:
            _along(_loops("radix").from_floats, (self.tag,), x.size, _flat(x, x.shape), out, states)
        except OverflowError:
            return None
        if exactly and states.any():
            return None
        for i in np.flatnonzero(states == 2):
            value = float(x.flat[i])
            if not math.isfinite(value):
                return None
            try:
                out[0][i], out[1][i] = self.kernel.from_ratio(*value.as_integer_ratio())
            except OverflowError:
                return None
        return tuple(part.reshape(x.shape) for part in out)

    def _from_backend(self, other: Backend, components: Components) -> Components | None:
        if isinstance(other, Pairs):
            return self.apply("round_", components)
        if isinstance(other, Floats):
            return self._from_numbers(components[0], exactly=False)
        return super()._from_backend(other, components)

    def _applied(self, name: str, shape: tuple[int, ...], flat: Sequence[Components]) -> Components | None:
        if name != "fused":
            return super()._applied(name, shape, flat)
        if self.wide is None:
            return None
        found = TwoWords(self.rules, self.wide).apply(name, *map(self.in_two_words, flat))
        return None if found is None else tuple(part.reshape(shape) for part in self.from_two_words(found))

    def in_two_words(self, components: Components) -> Components:
        return components[0], np.zeros(components[0].shape, np.int64), components[1]

    def from_two_words(self, components: Components) -> Components:
        return components[0], components[2]  # with at most 18 digits, the lower word is empty

    def _signed(self, name: str, components: Components) -> Components:
        m, e = components
        return np.asarray(-m if name == "negative" else np.abs(m)), e

    def sort_keys(self, components: Components) -> Components:
        m, e = components
        sign = np.sign(m)
        return m, sign * e, sign

    def _to_floats(self, flat: Components, x: Array, states: Array) -> None:
        _along(_loops("radix").to_floats, (), x.size, *flat, x, states)


class TwoWords(Looped):
    """Bases 2, 10 and 16 with any range: the upper and lower part of a significand and an exponent, as int64."""

    dtype = np.int64
    count = 3
    tag: Wide

    def from_exact(self, m: Any, e: Any) -> Components | None:
        if np.any(e > FARTHEST) or np.any(e < -FARTHEST):
            return None
        size, split = abs(m), self.tag.split
        high = np.asarray(size >> split, dtype=np.int64)
        low = np.asarray(size & ((1 << split) - 1), dtype=np.int64)
        return np.where(np.asarray(m < 0, dtype=bool), -high, high), low, e.astype(np.int64)

    def to_exact(self, components: Components) -> Components:
        high, low, e = (part.astype(object) for part in components)
        size: Any = np.empty(e.shape, object)
        size[...] = (abs(cast(Any, high)) << self.tag.split) | low  # NumPy makes a single entry a plain int
        return np.where(components[0] < 0, -size, size), e

    def _from_numbers(self, values: Array, exactly: bool) -> Components | None:
        kind, size = values.dtype.kind, values.dtype.itemsize
        if kind == "f" and size <= 8:
            m, e = np.frexp(values.astype(np.float64, copy=False))
            if not np.isfinite(m).all():
                return None
            m, e = np.ldexp(m, 53).astype(np.int64), e.astype(np.int64) - 53
        elif kind not in "iu" or (size == 8 and ((values >= 2**63) | (values <= -(2**63))).any()):
            return None
        else:
            m, e = values.astype(np.int64), np.zeros(values.shape, np.int64)
        return self._converted(_BINARY, (m, np.zeros(m.shape, np.int64), e), exactly)

    def _from_backend(self, other: Backend, components: Components) -> Components | None:
        if isinstance(other, Floats):
            return self._from_numbers(components[0], exactly=False)
        return super()._from_backend(other, components)

    def in_two_words(self, components: Components) -> Components:
        return components

    def from_two_words(self, components: Components) -> Components:
        return components

    def _signed(self, name: str, components: Components) -> Components | None:
        high, low, e = components
        limits = self.rules.limits
        if limits is not None and limits.fixed and np.any((high == self.tag.lowest[0]) & (e == self.tag.lowest[2])):
            return None  # the opposite of the lowest number is not in the format
        return np.asarray(-high if name == "negative" else np.abs(high)), low, e

    def sort_keys(self, components: Components) -> Components:
        high, low, e = components
        sign = np.sign(high)
        return sign * low, high, sign * e, sign

    def _to_floats(self, flat: Components, x: Array, states: Array) -> None:
        _along(_loops("wide").to_floats, (self.tag,), x.size, flat, x, states)


_BINARY: Wide = wide_tag(Rules(2, 53, Rounding.CHOP))  # type: ignore[assignment]
"""A format of which a word is the upper part of a number."""


@one_per_format
def exact(rules: Rules) -> Exact:
    """Return the backend that holds every number of a format."""
    return Exact(rules)


@one_per_format
def backend(rules: Rules) -> Backend:
    """Return the fastest backend for a format."""
    tag = tag_of(rules)
    if tag is None:
        return exact(rules) if (wide := wide_tag(rules)) is None else TwoWords(rules, wide)
    return (Pairs if rules.base == 10 else Floats)(rules, tag)


def double_doubles(values: NDArray[Any]) -> NDArray[np.float64]:
    """Round Fractions in an object array to the nearest double-doubles: float64 (..., 2), for ``DoubleDouble``."""
    pairs = []
    for value in values.ravel().tolist():
        n, d = value.numerator, value.denominator
        try:
            high = n / d
        except OverflowError:
            raise OverflowError(f"got a number of about {size_text(value)}, beyond the range of float64") from None
        # Most values are exact in float64, and testing for that is many times faster than subtracting two Fractions.
        exact = n.bit_length() <= 53 and d & (d - 1) == 0 and d.bit_length() <= 960
        pairs.append((high, 0.0 if exact else float(value - Fraction(high))))
    return np.array(pairs, dtype=np.float64).reshape(*values.shape, 2)


def _along(loop: Any, first: tuple[Any, ...], size: int, *given: Any) -> bool:
    """Run a loop over the entries of flat arrays; return whether a result is lost."""
    gone = False
    for part in slices(size):
        gone |= bool(loop(*first, part.stop - part.start, *(_cut(each, part) for each in given)))
    return gone


def _cut(given: Any, part: slice) -> Any:
    if isinstance(given, tuple):
        return tuple(each[part] for each in given)
    return given[part] if isinstance(given, np.ndarray) else given


def _fixed(numbers: Array) -> Array:
    """Return numbers flat and read-only, so that loops are compiled for only one kind of input."""
    flat = numbers.reshape(-1).view()
    flat.flags.writeable = False
    return flat


def _flat(part: Array, shape: tuple[int, ...]) -> Array:
    # Always contiguous, so that loops are compiled for only one layout.
    flat = np.ascontiguousarray(part if part.shape == shape else np.broadcast_to(part, shape)).reshape(-1)
    flat.flags.writeable = False
    return flat


def _shape(*operands: Components) -> tuple[int, ...]:
    first = operands[0][0].shape
    if all(components[0].shape == first for components in operands[1:]):
        return first
    return np.broadcast_shapes(*(components[0].shape for components in operands))


@cache
def _loops(name: str) -> Any:
    """Return a module of compiled loops; numba takes a second to import, and exact arithmetic does not need it."""
    from gpbnb.arithmetic.kernels import elementwise, floats, matrices, radix, wide

    _USED.add(name)
    return {"elementwise": elementwise, "floats": floats, "matrices": matrices, "radix": radix, "wide": wide}[name]
