"""Arrays of t-digit numbers whose every operation is correctly rounded."""

from __future__ import annotations

import operator
from collections.abc import Callable, Iterator, Sequence
from fractions import Fraction
from functools import cache
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from gpbnb.arithmetic.assignment import At
from gpbnb.arithmetic.conversion import entries, exact_ratio
from gpbnb.arithmetic.elementary import DomainError
from gpbnb.arithmetic.exits import check_exit, entering
from gpbnb.arithmetic.functions import floor_divide, kept, lines, power, remainder
from gpbnb.arithmetic.kernels.backends import Backend, Components
from gpbnb.arithmetic.number_format import NumberFormat
from gpbnb.arithmetic.protocols import NumPyProtocols, broadcast
from gpbnb.arithmetic.rounding import Rounding
from gpbnb.arithmetic.text import at_entry, decimal_text, in_columns, number_text, place
from gpbnb.arithmetic.words import in_words

_WIDTH = 120  # characters of a line of text
_PLAIN = (int, float)  # not bool, which is no number here

MANY = 100
"""In arrays with more entries than this, equal entries are converted once; for fewer, remembering takes longer."""


class WholeNumberError(ValueError):
    """A whole number as an operand that a format has too few digits, or too small a range, to hold."""


class NegativeRootError(DomainError):
    """The square root of a negative number."""


class ComponentArray:
    """An array whose entries are stored in components, which are arrays of the same shape."""

    __slots__ = ()

    components: Components

    @property
    def shape(self) -> tuple[int, ...]:
        """Length of each axis."""
        return self.components[0].shape

    @property
    def ndim(self) -> int:
        """Number of axes; 0 for a single number."""
        return self.components[0].ndim

    @property
    def size(self) -> int:
        """Number of entries."""
        return self.components[0].size


_Operator = Callable[["FloatArray", Any], "FloatArray"]


def operators(name: str) -> tuple[_Operator, _Operator]:
    """Return the methods of an operation for an array on its left and on its right side."""
    return lambda self, other: self._binary(name, self, other), lambda self, other: self._binary(name, other, self)


def calls(function: Callable[[Any, Any], Any]) -> tuple[_Operator, _Operator]:
    """Return the methods that call a function of two arrays, for an array on its left and on its right side."""

    def left(self: FloatArray, other: Any) -> Any:
        return function(self, self.operand(other))

    def right(self: FloatArray, other: Any) -> Any:
        return function(self.operand(other), self)

    return left, right


def _comparison(operation: Callable[[Any, Any], Any]) -> Callable[[FloatArray, Any], Any]:
    """Return the method that compares as an operation on orders, -1, 0 or 1, and zero does."""
    return lambda self, other: self._compare(other, lambda order: operation(order, 0))


class FloatArray(ComponentArray, NumPyProtocols):
    """An immutable n-dimensional array of numbers of one format. Create it with ``fmt.array``.

    ``+ - * / @``, ``-x``, ``abs(x)``, ``np.sqrt(x)``, sums and products are rounded after every single operation. The
    documentation of each function states the order of its operations. Shapes broadcast as in NumPy. The other operand
    may be a plain number or array if the format holds each of its entries exactly. An operand is never rounded
    silently. Indexing follows NumPy's rules and gives a FloatArray. Comparisons are exact and give booleans.

    Conversion to other number types is explicit. ``x.to_float()`` gives the nearest float64, ``x.to_fractions()`` the
    exact value. A function that converts on its own, such as ``np.asarray``, ``float``, ``math.sqrt``, ``np.save`` or
    ``scipy.linalg.solve``, receives float64 numbers if the conversion is exact. Otherwise the conversion raises an
    error. While the precision of a function is searched, all of these conversions raise an error; see
    :mod:`gpbnb.arithmetic.exits`.

    Raises
    ------
    ValueError : the operands have different formats, or shapes that do not broadcast; a plain
        operand is not a number of the format; the square root of a negative number.
    ZeroDivisionError : a divisor is zero; the message names the entry.
    TypeError : an operand is not a number, or code assigns to an entry.

    Examples
    --------
    >>> from gpbnb.arithmetic.formats import FloatFormat
    >>> x = FloatFormat(10, 4).array(["0.1", "0.5"])
    >>> float(x[1]), x.to_float()
    (0.5, array([0.1, 0.5]))

    References
    ----------
    hung1984, ch. II, (15): fl(x * y) is the exact x * y, rounded once.
    """

    __slots__ = ("_format", "backend", "components")
    __hash__ = None  # type: ignore[assignment]
    __pandas_priority__ = 10_000  # so that tables of pandas leave the operation to this class, not to float64

    _format: NumberFormat
    #: The backend, which computes with the entries.
    backend: Backend
    #: The entries, in the representation of the backend.
    components: Components

    def __init__(self) -> None:
        raise TypeError("got FloatArray(...); needed a format; write fmt.array(values)")

    @classmethod
    def from_pairs(cls, m: Any, e: Any, fmt: Any) -> Self:
        """Make an array from significands and exponents that are already normalized numbers of `fmt`."""
        pair = _frozen(m, object), _frozen(e, object)
        components = fmt.backend.from_exact(*pair)
        return (
            cls.from_components(fmt.exact_backend, pair, fmt)
            if components is None
            else cls.from_components(fmt.backend, components, fmt)
        )

    @classmethod
    def from_components(cls, backend: Backend, components: Any, fmt: Any) -> Self:
        """Make an array from components that a backend has computed or moved."""
        self = object.__new__(cls)
        self._format = fmt
        self.backend = backend
        self.components = tuple([_frozen(part, backend.dtype) for part in components])
        return self

    @classmethod
    def from_packed(cls, packed: NDArray[Any], fmt: Any) -> Self:
        """Make an array from what compiled loops of the format return; ``fmt.backend.pack`` is the inverse."""
        return cls.from_components(fmt.backend, fmt.backend.unpack(packed), fmt)

    def on_exact_backend(self) -> FloatArray:
        """Return the same numbers on the backend that can store every exponent."""
        return self.from_components(self.format.exact_backend, self.backend.to_exact(self.components), self.format)

    def to_pairs(self) -> tuple[NDArray[Any], NDArray[Any]]:
        """Return significands and exponents as Python integers; each entry is ``m * base**e``, normalized."""
        check_exit(self, "to_pairs()")
        m, e = self.on_exact_backend().components
        return m, e

    @classmethod
    def from_values(cls, values: Any, fmt: Any, exactly: bool = False) -> Self:
        """Round numbers of any kind, as ``fmt.array`` does, or with `exactly` reject those that are not in the format.

        See :meth:`gpbnb.arithmetic.formats.FloatFormat.array`.
        """
        if isinstance(values, FloatArray):
            if values.format == fmt and isinstance(values, cls):
                return values
            if (components := cls._converted(values, fmt)) is not None:
                return cls.from_components(fmt.backend, components, fmt)
            if values.format.base == fmt.base:
                with entering(fmt):
                    pairs = values.to_pairs()
                m, e = np.frompyfunc(fmt.kernel.from_ratio, 3, 2)(pairs[0], 1, pairs[1])
                return cls.from_pairs(m, e, fmt)
        random = fmt.rounding is Rounding.STOCHASTIC
        given = np.asarray(values) if type(values) in _PLAIN and not random else values
        if type(given) is np.ndarray and (components := fmt.backend.from_numbers(given, exactly)) is not None:
            return cls.from_components(fmt.backend, components, fmt)
        with entering(fmt):
            given = entries(values)
        read = []
        # Large cycles of matrices have few different entries. Random roundings differ for equal ones, too.
        known: dict[Any, Any] = {}
        for i, value in enumerate(given.ravel().tolist()):
            try:
                ratio = exact_ratio(value)
                if random or ratio not in known:
                    known[ratio] = pair = fmt.kernel.from_decimal(*ratio)
                    if exactly and not fmt.kernel.is_exactly(pair, *ratio):
                        raise (WholeNumberError if ratio[1] == 1 and ratio[2] >= 0 else ValueError)(
                            f"got the operand {number_text(value)}; needed a number that {fmt} holds exactly; "
                            "round it first by x.format.array(...), or compare x.to_float() with it"
                        )
            except (TypeError, ValueError, OverflowError) as error:
                raise type(error)(f"{at_entry(np.unravel_index(i, given.shape))}{error}") from None
            read.append(known[ratio])
        found = np.array(read, object).reshape(-1, 2).T
        m, e = (np.ascontiguousarray(part).reshape(given.shape) for part in found)
        return cls.from_pairs(m, e, fmt)

    @staticmethod
    def _converted(values: FloatArray, fmt: Any) -> Components | None:
        """Round the numbers of another format on the backend of this one; None if it cannot."""
        if fmt.rounding is Rounding.STOCHASTIC:
            return None
        with entering(fmt):
            check_exit(values, "to_pairs()")
        components: Components | None = fmt.backend.from_backend(values.backend, values.components)
        return components

    def __reduce__(self) -> tuple[Any, ...]:
        check_exit(self, "pickle")
        return type(self).from_pairs, (*self.on_exact_backend().components, self.format)

    # -- shape ---------------------------------------------------------------------------------

    @property
    def format(self) -> NumberFormat:
        """The format of every entry."""
        return self._format

    @property
    def T(self) -> FloatArray:
        """The transpose, with the axes in reverse order."""
        return self.moved(np.transpose)

    def reshape(self, *shape: Any) -> FloatArray:
        """Return the same entries in another shape."""
        return self.moved(lambda a: a.reshape(*shape))

    def __len__(self) -> int:
        if not self.ndim:
            raise TypeError("got a FloatArray of a single number, which has no length; needed at least one axis")
        return len(self.components[0])

    def __getitem__(self, index: Any) -> FloatArray:
        return self.moved(lambda a: a[index])

    def __setitem__(self, index: Any, value: Any) -> None:
        self.__delitem__(index)

    def __delitem__(self, index: Any) -> None:
        raise TypeError(
            f"got an assignment to an entry of a {type(self).__name__}, which cannot be changed; needed a copy with "
            "other entries: x = x.at[i].set(value), or np.where(condition, value, x)"
        )

    @property
    def at(self) -> At:
        """Makes copies of the array with some entries changed, as in JAX; see :class:`gpbnb.arithmetic.assignment.At`.

        Examples
        --------
        >>> from gpbnb import BINARY32
        >>> x = BINARY32.array([1, 2, 3])
        >>> x.at[0].set(5).to_float(), x.at[1:].add([10, 20]).to_float(), x.to_float()
        (array([5., 2., 3.]), array([ 1., 12., 23.]), array([1., 2., 3.]))
        """
        return At(self)

    def __iter__(self) -> Iterator[FloatArray]:
        return (self[i] for i in range(len(self)))

    def __contains__(self, value: Any) -> bool:
        return bool(np.any(self == value))

    def moved(self, move: Callable[[NDArray[Any]], Any]) -> FloatArray:
        """Apply to each component a function that only moves entries, such as a transposition."""
        return self.from_components(self.backend, map(move, self.components), self.format)

    def joined(self, join: Callable[[Sequence[Any]], Any], arrays: Sequence[FloatArray]) -> FloatArray:
        """Join arrays with a function that only moves entries, such as a concatenation."""
        backend, arrays = _common(arrays)
        components = zip(*(array.components for array in arrays), strict=True)
        return self.from_components(backend, map(join, components), self.format)

    # -- arithmetic ----------------------------------------------------------------------------

    def operand(self, other: Any) -> FloatArray:
        """Return the other operand as a FloatArray of this format, in which it must be exact."""
        if isinstance(other, FloatArray):
            if other._format is not self._format and other._format != self._format:
                raise ValueError(
                    f"got operands in {self.format} and {other.format}; needed one format; "
                    "convert one of them: fmt.array(x)"
                )
            return other
        return self.from_values(other, self.format, exactly=True)

    def _binary(self, name: str, left: Any, right: Any) -> FloatArray:
        a, b = self.operand(left), self.operand(right)
        broadcast(name, a.shape, b.shape)
        if name == "divide" and (zero := _first(b.components[0] == 0)) is not None:
            at = f" at {place(zero)} of the divisor" if zero else ""
            raise ZeroDivisionError(
                f"got a division by zero{at}; needed a divisor other than zero; test x == 0 before dividing"
            )
        return self._applied(name, a, b)

    def _applied(self, name: str, *arrays: FloatArray) -> FloatArray:
        """Apply an operation of the backend, or of the exact one if that has no result."""
        backend, found = _common(arrays)
        components = backend.apply(name, *(each.components for each in found))
        if components is None:
            return self._applied(name, *(each.on_exact_backend() for each in found))
        return self.from_components(backend, components, self.format)

    def multiply_add(self, factor: Any, addend: Any) -> FloatArray:
        """Return ``self * factor + addend``, rounded once for each entry, as a processor's fused multiply-add does."""
        arrays = [self, self.operand(factor), self.operand(addend)]
        broadcast("multiply_add", arrays[0].shape, arrays[1].shape)
        broadcast("multiply_add", np.broadcast_shapes(arrays[0].shape, arrays[1].shape), arrays[2].shape)
        return self._applied("fused", *arrays)

    def _unary(self, name: str) -> FloatArray:
        if name == "sqrt" and (negative := _first(self.components[0] < 0)) is not None:
            at = f" at {place(negative)}" if negative else ""
            raise NegativeRootError(
                f"got the square root of a negative number{at}; needed x >= 0; test x < 0 before, or take abs(x)"
            )
        return self._applied(name, self)

    __add__, __radd__ = operators("add")
    __sub__, __rsub__ = operators("subtract")
    __mul__, __rmul__ = operators("multiply")
    __truediv__, __rtruediv__ = operators("divide")
    __matmul__, __rmatmul__ = calls(lambda a, b: _matmul(a, b))
    __mod__, __rmod__ = calls(remainder)
    __floordiv__, __rfloordiv__ = calls(floor_divide)

    def __pow__(self, other: Any) -> FloatArray:
        return power(self, other)

    def __rpow__(self, other: Any) -> FloatArray:
        return power(self.operand(other), self)

    def __neg__(self) -> FloatArray:
        return self._unary("negative")

    def __pos__(self) -> FloatArray:
        return self

    def __abs__(self) -> FloatArray:
        return self._unary("absolute")

    def sqrt(self) -> FloatArray:
        """Return the correctly rounded square root of each entry; also ``np.sqrt(x)``."""
        return self._unary("sqrt")

    def sum(self, axis: int | None = None, keepdims: bool = False) -> FloatArray:
        """Add the entries from left to right, ``((x1 + x2) + x3) + ...``; the sum of no entries is zero.

        Parameters
        ----------
        axis : the axis along which to add; if None, all entries are added, row after row.
        keepdims : whether the axes that are added up stay in the result, with length 1.

        References
        ----------
        hung1984, ch. II, (17).
        """
        return kept(self, self._reduce("add", axis, 0), axis, keepdims)

    def prod(self, axis: int | None = None, keepdims: bool = False) -> FloatArray:
        """Multiply the entries from left to right; the product of no entries is one.

        Parameters
        ----------
        axis, keepdims : as in :meth:`sum`.

        References
        ----------
        hung1984, ch. II, (19).
        """
        return kept(self, self._reduce("multiply", axis, 1), axis, keepdims)

    def _reduce(self, name: str, axis: Any, of_none: int) -> FloatArray:
        given: FloatArray = lines(self, axis)
        if not len(given):
            return self._zeros(given.shape[1:]) + of_none
        if (components := self.backend.fold(name, given.components)) is not None:
            return self.from_components(self.backend, components, self.format)
        total = given[0]
        for line in given[1:]:
            total = self._binary(name, total, line)
        return total

    def _zeros(self, shape: tuple[int, ...]) -> FloatArray:
        return self.from_pairs(np.zeros(shape, object), np.zeros(shape, object), self.format)

    # -- comparison ----------------------------------------------------------------------------

    def _compare(self, other: Any, holds: Callable[[Any], Any]) -> Any:
        b = self.operand(other)
        broadcast("compare", self.shape, b.shape)
        backend, (a, b) = _common((self, b))
        return holds(backend.compare(a.components, b.components))[()]

    __eq__, __ne__ = _comparison(operator.eq), _comparison(operator.ne)
    __lt__, __le__ = _comparison(operator.lt), _comparison(operator.le)
    __gt__, __ge__ = _comparison(operator.gt), _comparison(operator.ge)

    def __bool__(self) -> bool:
        if self.size != 1:
            raise ValueError(
                f"got the truth value of a FloatArray of shape {self.shape}; needed one number; "
                "compare, then use np.all or np.any"
            )
        return bool(self.components[0].item() != 0)

    # -- conversion ----------------------------------------------------------------------------

    def to_float(self) -> Any:
        """Return the nearest float64 of each entry, as an array, or as a float for a single number.

        Raises
        ------
        OverflowError : an entry would become infinite, or a nonzero entry would become zero.
        """
        check_exit(self, "to_float()")
        return self.backend.to_float(self.components)[()]

    def to_fractions(self) -> Any:
        """Return the exact value of each entry, as an object array of Fractions or as one Fraction.

        Raises
        ------
        OverflowError : an entry is too long to write out.
        """
        check_exit(self, "to_fractions()")
        convert: Callable[..., Fraction] = Fraction  # of float64, exactly
        components = self.components
        if self.backend.dtype != np.float64:
            convert, components = self.format.kernel.to_fraction, self.on_exact_backend().components
        whole = np.frompyfunc(cache(convert) if self.size > MANY else convert, len(components), 1)
        return np.asarray(whole(*components), dtype=object)[()]

    def to_bits(self) -> Any:
        """Return the words in which a processor stores the entries, as unsigned integers, or as an int for one number.

        Formats of base 2 use the layout of IEEE 754, formats without subnormal numbers use the layout of IBM's
        machines, and fixed-point formats use two's complement.

        Raises
        ------
        ValueError : the format has no range, or has base 10.

        Examples
        --------
        >>> from gpbnb import BINARY32
        >>> hex(BINARY32.array("0.1").to_bits())
        '0x3dcccccd'
        """
        check_exit(self, "to_bits()")
        layout = self.format.layout
        return in_words(np.frompyfunc(layout.bits, 2, 1)(*self.on_exact_backend().components), layout.width)

    # -- text ----------------------------------------------------------------------------------

    def __repr__(self) -> str:
        """Return code that makes the same array, with ``...`` if there are more entries than NumPy prints.

        The format stands in the first line, and the entries follow below it if rows behind it would be wrapped.
        """
        start, end = f"{self.format}.array(", ")"
        entries = self._text(quote=chr(39), separator=", ", prefix=start)
        below = self._text(quote=chr(39), separator=", ", prefix="    ")
        if below.count("\n") < entries.count("\n") or max(map(len, f"{start}{entries})".split("\n"))) > _WIDTH:
            start, entries, end = f"{start}\n    ", below, "\n)"
        shape = "" if self.size or self.shape == (0,) else f".reshape{self.shape}"
        return f"{start}{entries}{end}{shape}"

    def __str__(self) -> str:
        return self._text(quote="", separator=" ", prefix="")

    def _text(self, quote: str, separator: str, prefix: str) -> str:
        """Return decimal digits, in columns, from which ``fmt.array`` makes the same numbers again."""
        check_exit(self, "text")
        flat = self.reshape(-1)

        def text(i: int) -> str:
            m, e = flat[i].on_exact_backend().components
            return f"{quote}{decimal_text(m.item(), e.item(), self.format.kernel)}{quote}"

        return in_columns(text, self.shape, separator, prefix)


def _frozen(a: Any, dtype: Any) -> NDArray[Any]:
    """Return a read-only array."""
    array = a if isinstance(a, np.ndarray) else np.asarray(a, dtype=dtype)
    array.flags.writeable = False
    return array


def _common(arrays: Sequence[FloatArray]) -> tuple[Backend, Sequence[FloatArray]]:
    """Return one backend that can store all the arrays."""
    backend = arrays[0].backend
    if all(array.backend is backend for array in arrays):
        return backend, arrays
    return arrays[0].format.exact_backend, [array.on_exact_backend() for array in arrays]


def _first(condition: Any) -> tuple[int, ...] | None:
    """Return the index of the first place where `condition` holds."""
    condition = np.asarray(condition, dtype=bool)
    if not condition.any():
        return None
    return tuple(int(i) for i in np.argwhere(condition)[0])


def _matmul(a: FloatArray, b: FloatArray) -> FloatArray:
    """Multiply rows and columns, each product summed from left to right, as in (26) and (27)."""
    if not a.ndim or not b.ndim:
        raise ValueError(f"matmul: got shapes {a.shape} and {b.shape}; needed at least one axis each; use *")
    rows = a if a.ndim > 1 else a[np.newaxis, :]
    columns = b if b.ndim > 1 else b[:, np.newaxis]
    n = rows.shape[-1]
    if n != columns.shape[-2]:
        raise ValueError(
            f"matmul: got shapes {a.shape} and {b.shape}, so {n} columns against {columns.shape[-2]} "
            "rows; needed equal numbers; transpose or reshape one of them"
        )
    broadcast("matmul", rows.shape[:-2], columns.shape[:-2])
    components = None
    if n and rows.backend is columns.backend and rows.ndim == columns.ndim == 2:
        components = rows.backend.matmul(rows.components, columns.components)
    if n == 0:
        stack = np.broadcast_shapes(rows.shape[:-2], columns.shape[:-2])
        c = a._zeros((*stack, rows.shape[-2], columns.shape[-1]))
    elif components is not None:
        c = a.from_components(a.backend, components, a.format)
    else:
        c = rows[..., :, 0, np.newaxis] * columns[..., np.newaxis, 0, :]
        for k in range(1, n):
            c = c + rows[..., :, k, np.newaxis] * columns[..., np.newaxis, k, :]
    if a.ndim == 1:
        c = c[..., 0, :]
    return c if b.ndim > 1 else c[..., 0]
