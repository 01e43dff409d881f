"""Backends that store an array's numbers and compute with them: as float64, pairs of int64, or Python integers.

A backend works on `components`, a tuple of arrays with the same shape, so that NumPy can reshape, slice and join all of
them in the same way. The first array carries the sign. If a compiled backend cannot hold or compute a result, it
returns None, and the exact backend computes the same digits instead. The compiled loops are imported on first use.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from fractions import Fraction
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gpbnb.arithmetic.kernels.exact import kernel
from gpbnb.arithmetic.kernels.tags import LARGEST_SHORT, Binary, Decimal, Hexadecimal, ShortDecimal, Tag

Array = NDArray[Any]
Components = tuple[Array, ...]

LARGEST_PRECISION = {2: 53, 10: 18, 16: 13}  # of the compiled backends
_LARGEST_EXPONENT = 2**60
_POWERS_OF_TEN = np.array([10**k for k in range(23)], np.float64)  # exact


class Backend(ABC):
    """Store numbers of one format and compute with them."""

    dtype: Any

    def __init__(self, base: int, precision: int, nearest: bool) -> None:
        self.base, self.precision, self.nearest = base, precision, nearest
        self.kernel = kernel(base, precision, nearest)

    def __reduce__(self) -> tuple[Any, ...]:
        return type(self), (self.base, self.precision, self.nearest)

    @abstractmethod
    def from_exact(self, m: Array, e: Array) -> Components | None:
        """Convert normalized pairs of Python integers to components; None if they do not fit."""

    @abstractmethod
    def to_exact(self, components: Components) -> Components:
        """Convert components to significands and exponents, as Python integers."""

    @abstractmethod
    def from_numbers(self, values: Array, exactly: bool) -> Components | None:
        """Round an array of a NumPy number type; with `exactly`, return None if rounding changes an entry."""

    @abstractmethod
    def apply(self, name: str, *operands: Components) -> Components | None:
        """Apply an operation of :class:`ExactKernel` to each entry; callers exclude zero divisors, negative roots."""

    @abstractmethod
    def compare(self, a: Components, b: Components) -> Array:
        """Compare each pair of entries: -1, 0 or 1, as int8."""

    @abstractmethod
    def to_float(self, components: Components) -> Array:
        """Round each entry to the nearest float64; raises OverflowError like :meth:`ExactKernel.to_float`."""

    def fold(self, name: str, components: Components) -> Components | None:
        """Combine the entries along the first axis from left to right; there must be at least one."""
        return None

    def matmul(self, a: Components, b: Components) -> Components | None:
        """Multiply two matrices with an inner dimension of at least 1, summing each entry from left to right."""
        return None


class Exact(Backend):
    """Any base, precision and exponent: significands and exponents are Python integers."""

    dtype = object

    def from_exact(self, m: Array, e: Array) -> Components:
        return m, e

    def to_exact(self, components: Components) -> Components:
        return components

    def from_numbers(self, values: Array, exactly: bool) -> None:
        return None

    def apply(self, name: str, *operands: Components) -> Components:
        return self._ufunc(name, 2 * len(operands), 2)(*(part for components in operands for part in components))

    def compare(self, a: Components, b: Components) -> Array:
        return np.asarray(self._ufunc("compare", 4, 1)(*a, *b), dtype=np.int8)

    def to_float(self, components: Components) -> Array:
        return np.asarray(self._ufunc("to_float", 2, 1)(*components), dtype=np.float64)

    def _ufunc(self, name: str, inputs: int, outputs: int) -> Any:
        return np.frompyfunc(getattr(self.kernel, name), inputs, outputs)


class Compiled(Backend):
    """Common part of the backends with compiled loops."""

    tag: Tag
    count: int  # number of components
    fuses = False  # whether it has a fused multiply-add

    def run_tag(self) -> Tag:
        """Return the tag for a separate run, whose random roundings start at the first number of their seed."""
        return self.tag

    def apply(self, name: str, *operands: Components) -> Components | None:
        if name == "fused" and not self.fuses:
            return None
        shape = _shape(*operands)
        size = math.prod(shape)
        out = self._empty(size)
        inputs = [self._seen(tuple([_flat(part, shape) for part in components])) for components in operands]
        try:
            gone = _loops().ENTRIES[name](self.tag, size, *inputs, self._seen(out))
        except OverflowError:
            return None
        return None if gone else tuple(part.reshape(shape) for part in out)

    def fold(self, name: str, components: Components) -> Components | None:
        shape = components[0].shape
        out = self._empty(math.prod(shape[1:]))
        lines = self._seen(tuple(_flat(part, shape) for part in components))
        try:
            gone = _loops().FOLDS[name](self.tag, shape[0], math.prod(shape[1:]), lines, self._seen(out))
        except OverflowError:
            return None
        return None if gone else tuple(part.reshape(shape[1:]) for part in out)

    def matmul(self, a: Components, b: Components) -> Components | None:
        x, y = self.pack(a), self.pack(b)
        c = np.empty((a[0].shape[0], b[0].shape[1], *x.shape[2:]), self.dtype)
        try:
            _loops().product(self.tag, _read_only(x), _read_only(y), c)
        except OverflowError:
            return None
        return self.unpack(c)

    def pack(self, components: Components) -> Array:
        """Pack components into a new array, in the layout that the topics' compiled loops take and return."""
        return (
            np.array(components[0], order="C")
            if self.count == 1
            else np.ascontiguousarray(np.stack(components, axis=-1))
        )

    def unpack(self, array: Array) -> Components:
        """Unpack an array that :meth:`pack` made into components, as new arrays."""
        if self.count == 1:
            return (np.array(array, order="C"),)
        return tuple(np.array(array[..., i], order="C") for i in range(self.count))

    def _empty(self, size: int) -> Components:
        return tuple(np.empty(size, self.dtype) for _ in range(self.count))

    def _seen(self, components: Components) -> Any:
        """Bring components into the form that a compiled loop expects."""
        return components[0] if self.count == 1 else components


class Floats(Compiled):
    """Bases 2 and 16, stored as float64."""

    dtype = np.float64
    count = 1
    lowest_power, highest_power = -960, 1023  # powers of two between which its numbers lie

    def __init__(self, base: int, precision: int, nearest: bool) -> None:
        super().__init__(base, precision, nearest)
        self.tag = Binary(precision, nearest) if base == 2 else Hexadecimal(precision, nearest)
        self.bits = base.bit_length() - 1

    def from_exact(self, m: Array, e: Array) -> Components | None:
        # base**(e + t - 1) <= |x| < base**(e + t)
        if np.any((e + self.precision) * self.bits > self.highest_power):
            return None
        if np.any((e + self.precision - 1) * self.bits < self.lowest_power):
            return None
        return (np.asarray(np.ldexp(m.astype(np.float64), self.bits * e.astype(np.int64))),)

    def to_exact(self, components: Components) -> Components:
        x = components[0]
        e = (np.frexp(x)[1].astype(np.int64) - 1) // self.bits - (self.precision - 1)
        e = np.where(x == 0, 0, e)
        return np.ldexp(x, -self.bits * e).astype(np.int64).astype(object), e.astype(object)

    def from_numbers(self, values: Array, exactly: bool) -> Components | None:
        kind, size = values.dtype.kind, values.dtype.itemsize
        if kind not in "fiu" or size > 8:
            return None
        x = values.astype(np.float64, copy=False)
        if kind != "f" and size == 8 and not (np.abs(x) <= 2.0**53).all():
            return None
        components = self.apply("round_", (x,))
        return None if components is None or (exactly and not np.array_equal(components[0], x)) else components

    def apply(self, name: str, *operands: Components) -> Components | None:
        if name == "negative":
            return (np.asarray(0.0 - operands[0][0]),)
        if name == "absolute":
            return (np.asarray(np.abs(operands[0][0])),)
        return super().apply(name, *operands)

    def compare(self, a: Components, b: Components) -> Array:
        return np.asarray(np.greater(a[0], b[0]).astype(np.int8) - np.less(a[0], b[0]).astype(np.int8))

    def to_float(self, components: Components) -> Array:
        return components[0].copy()


class Pairs(Compiled):
    """Base 10: significand and exponent as int64."""

    dtype = np.int64
    count = 2

    def __init__(self, base: int, precision: int, nearest: bool) -> None:
        super().__init__(base, precision, nearest)
        self.tag = (ShortDecimal if precision <= LARGEST_SHORT else Decimal)(precision, nearest)
        self.exact = Exact(base, precision, nearest)

    def from_exact(self, m: Array, e: Array) -> Components | None:
        if np.any(e > _LARGEST_EXPONENT) or np.any(e < -_LARGEST_EXPONENT):
            return None
        return m.astype(np.int64), e.astype(np.int64)

    def to_exact(self, components: Components) -> Components:
        return components[0].astype(object), components[1].astype(object)

    def from_numbers(self, values: Array, exactly: bool) -> Components | None:
        if values.dtype.kind == "f" and values.dtype.itemsize <= 8:
            x = values.astype(np.float64, copy=False)
            if not ((np.abs(x) < 2.0**53) & (np.rint(x) == x)).all():
                return None  # fractions: the exact backend converts every digit
        elif values.dtype.kind not in "iu":
            return None
        largest = 10**self.precision if exactly else 2**63
        if ((values >= largest) | (values <= -largest)).any():
            return None
        return self.apply("round_", (values.astype(np.int64), np.zeros(values.shape, np.int64)))

    def apply(self, name: str, *operands: Components) -> Components | None:
        if name == "negative":
            return np.asarray(-operands[0][0]), operands[0][1]
        if name == "absolute":
            return np.asarray(np.abs(operands[0][0])), operands[0][1]
        return super().apply(name, *operands)

    def compare(self, a: Components, b: Components) -> Array:
        shape = _shape(a, b)
        order = np.empty(math.prod(shape), np.int8)
        x, y = (tuple(_flat(part, shape) for part in components) for components in (a, b))
        _loops().compared(self.tag, order.size, x, y, order)
        return order.reshape(shape)

    def to_float(self, components: Components) -> Array:
        m, e = components
        # Both operands are exact in float64, so the result is rounded only once.
        simple = (np.abs(m) <= 2**53) & (np.abs(e) <= 22)
        power = _POWERS_OF_TEN[np.where(simple, np.abs(e), 0)]
        x = np.asarray(np.where(e < 0, m / power, m * power))
        if not simple.all():
            x[~simple] = self.exact.to_float((m[~simple].astype(object), e[~simple].astype(object)))
        return x


@lru_cache(maxsize=256)
def exact(base: int, precision: int, nearest: bool) -> Exact:
    """Return the backend that holds every number of a format."""
    return Exact(base, precision, nearest)


@lru_cache(maxsize=256)
def backend(base: int, precision: int, nearest: bool) -> Backend:
    """Return the fastest backend for a format."""
    if precision > LARGEST_PRECISION.get(base, 0):
        return exact(base, precision, nearest)
    return (Pairs if base == 10 else Floats)(base, precision, nearest)


def double_doubles(values: NDArray[Any]) -> NDArray[np.float64]:
    """Round Fractions in an object array to the nearest double-doubles: float64 (..., 2), for ``DoubleDouble``."""
    pairs = []
    for value in values.ravel().tolist():
        n, d = value.numerator, value.denominator
        high = n / d
        # Most values are exact in float64, and testing for that is many times faster than subtracting two Fractions.
        exact = n.bit_length() <= 53 and d & (d - 1) == 0 and d.bit_length() <= 960
        pairs.append((high, 0.0 if exact else float(value - Fraction(high))))
    return np.array(pairs, dtype=np.float64).reshape(*values.shape, 2)


def _read_only(a: Array) -> Array:
    """Return a read-only view, so that loops are compiled for only one kind of input."""
    a = a.view()
    a.flags.writeable = False
    return a


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


@lru_cache(maxsize=1)
def _loops() -> Any:
    # Imported here because numba takes a second to import and exact arithmetic does not need it.
    from gpbnb.arithmetic.kernels import elementwise

    return elementwise
