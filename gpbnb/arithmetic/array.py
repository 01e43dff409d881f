"""Arrays of t-digit numbers whose every operation is correctly rounded."""

from __future__ import annotations

import inspect
import math
import operator
from collections.abc import Callable, Iterator, Mapping, Sequence, Set
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gpbnb.arithmetic.formats import FloatFormat, Rounding, exact_ratio
from gpbnb.arithmetic.kernels import backends
from gpbnb.arithmetic.kernels.backends import Backend, Components
from gpbnb.arithmetic.kernels.exact import integer_text


class FloatArray:
    """An immutable n-dimensional array of numbers of one format; make one with ``fmt.array``.

    ``+ - * / @``, ``-x``, ``abs(x)``, ``np.sqrt(x)`` and the sums and products round after each
    single operation, in the order stated by each. Shapes broadcast as in NumPy. The other operand
    may be a plain number or array if each entry is a number of the format: nothing is rounded
    unseen. Indexing with NumPy's rules gives a FloatArray; comparing gives booleans, exact.

    Raises
    ------
    ValueError : the operands have different formats, or shapes that do not broadcast; a plain
        operand is not a number of the format; the square root of a negative number.
    ZeroDivisionError : a divisor is zero; the message gives the place.
    TypeError : an operand is not a number; an entry is assigned to.

    References
    ----------
    hung1984, ch. II, (15): fl(x * y) is the exact x * y, rounded once.
    """

    __slots__ = ("_format", "backend", "components")
    __hash__ = None  # type: ignore[assignment]

    _format: FloatFormat
    backend: Backend
    components: Components

    def __init__(self) -> None:
        raise TypeError("got FloatArray(...); needed a format; write fmt.array(values)")

    @classmethod
    def _make(cls, m: Any, e: Any, fmt: FloatFormat) -> FloatArray:
        """Hold significands and exponents that are already normalized numbers of `fmt`."""
        pair = _frozen(m, object), _frozen(e, object)
        components = fmt.backend.from_exact(*pair)
        return (
            cls.from_components(_exact_backend(fmt), pair, fmt)
            if components is None
            else cls.from_components(fmt.backend, components, fmt)
        )

    @classmethod
    def from_components(cls, backend: Backend, components: Any, fmt: FloatFormat) -> FloatArray:
        """Hold what a backend has made, or moved."""
        self = object.__new__(cls)
        self._format = fmt
        self.backend = backend
        self.components = tuple(_frozen(part, backend.dtype) for part in components)
        return self

    def _exactly(self) -> FloatArray:
        """The same numbers, held by the exact backend."""
        return self.from_components(_exact_backend(self._format), self.backend.to_exact(self.components), self._format)

    @property
    def _m(self) -> NDArray[Any]:
        """The significands, Python's integers."""
        return self._exactly().components[0]

    @property
    def _e(self) -> NDArray[Any]:
        """The exponents, Python's integers."""
        return self._exactly().components[1]

    @classmethod
    def from_values(cls, values: Any, fmt: FloatFormat) -> FloatArray:
        """See :meth:`gpbnb.arithmetic.formats.FloatFormat.array`."""
        return cls._read(values, fmt, exactly=False)

    @classmethod
    def _read(cls, values: Any, fmt: FloatFormat, exactly: bool) -> FloatArray:
        if isinstance(values, FloatArray):
            if values.format == fmt:
                return values
            if values.format.base == fmt.base:
                m, e = np.frompyfunc(fmt.kernel.from_ratio, 3, 2)(values._m, 1, values._e)
                return cls._make(m, e, fmt)
        if type(values) is np.ndarray and (components := fmt.backend.from_numbers(values, exactly)) is not None:
            return cls.from_components(fmt.backend, components, fmt)
        entries = _entries(values)
        m, e = np.empty(entries.shape, object), np.empty(entries.shape, object)
        kernel = fmt.kernel
        for index in np.ndindex(entries.shape):
            value = entries[index]
            where = f"entry {_place(index)}: " if index else ""
            try:
                ratio = exact_ratio(value)
                pair = kernel.from_decimal(*ratio)
            except (TypeError, ValueError, OverflowError) as error:
                raise type(error)(f"{where}{error}") from None
            if exactly and not kernel.is_exactly(pair, *ratio):
                raise ValueError(
                    f"{where}got the operand {value!r}; needed a number that {fmt} holds exactly; "
                    "round it first: fmt.array(...)"
                )
            m[index], e[index] = pair
        return cls._make(m, e, fmt)

    def __reduce__(self) -> tuple[Any, ...]:
        return FloatArray._make, (self._m, self._e, self._format)

    # -- shape ---------------------------------------------------------------------------------

    @property
    def format(self) -> FloatFormat:
        """The format of every entry."""
        return self._format

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

    @property
    def T(self) -> FloatArray:
        """The transpose, with the axes in reverse order."""
        return self._moved(np.transpose)

    def reshape(self, *shape: Any) -> FloatArray:
        """The same entries in another shape."""
        return self._moved(lambda a: a.reshape(*shape))

    def __len__(self) -> int:
        if not self.ndim:
            raise TypeError("got a FloatArray of a single number; needed one with a length")
        return len(self.components[0])

    def __getitem__(self, index: Any) -> FloatArray:
        return self._moved(lambda a: a[index])

    def __setitem__(self, index: Any, value: Any) -> None:
        self.__delitem__(index)

    def __delitem__(self, index: Any) -> None:
        raise TypeError(
            "got a change of an entry; needed none, a FloatArray does not change; "
            "build a new one with fmt.array, np.where or np.concatenate"
        )

    def __iter__(self) -> Iterator[FloatArray]:
        return (self[i] for i in range(len(self)))

    def __contains__(self, value: Any) -> bool:
        return bool(np.any(self == value))

    def _moved(self, move: Callable[[NDArray[Any]], Any]) -> FloatArray:
        """Apply to each part a function that only moves entries."""
        return self.from_components(self.backend, map(move, self.components), self._format)

    # -- arithmetic ----------------------------------------------------------------------------

    def _operand(self, other: Any) -> FloatArray:
        if isinstance(other, FloatArray):
            if other._format != self._format:
                raise ValueError(
                    f"got operands in {self._format} and {other._format}; needed one format; "
                    "convert one of them: fmt.array(x)"
                )
            return other
        return self._read(other, self._format, exactly=True)

    def _binary(self, name: str, left: Any, right: Any) -> FloatArray:
        a, b = self._operand(left), self._operand(right)
        _broadcast(name, a.shape, b.shape)
        if name == "divide" and (zero := _first(b.components[0] == 0)) is not None:
            at = f" at {_place(zero)} of the divisor" if zero else ""
            raise ZeroDivisionError(
                f"got a division by zero{at}; needed a divisor other than zero; test x == 0 before dividing"
            )
        backend, (a, b) = _common((a, b))
        components = backend.apply(name, a.components, b.components)
        return (
            self._binary(name, a._exactly(), b)
            if components is None
            else self.from_components(backend, components, self._format)
        )

    def _unary(self, name: str) -> FloatArray:
        if name == "sqrt" and (negative := _first(self.components[0] < 0)) is not None:
            at = f" at {_place(negative)}" if negative else ""
            raise ValueError(
                f"got the square root of a negative number{at}; needed x >= 0; test x < 0 before, or take abs(x)"
            )
        components = self.backend.apply(name, self.components)
        return (
            self._exactly()._unary(name)
            if components is None
            else self.from_components(self.backend, components, self._format)
        )

    def __add__(self, other: Any) -> FloatArray:
        return self._binary("add", self, other)

    def __radd__(self, other: Any) -> FloatArray:
        return self._binary("add", other, self)

    def __sub__(self, other: Any) -> FloatArray:
        return self._binary("subtract", self, other)

    def __rsub__(self, other: Any) -> FloatArray:
        return self._binary("subtract", other, self)

    def __mul__(self, other: Any) -> FloatArray:
        return self._binary("multiply", self, other)

    def __rmul__(self, other: Any) -> FloatArray:
        return self._binary("multiply", other, self)

    def __truediv__(self, other: Any) -> FloatArray:
        return self._binary("divide", self, other)

    def __rtruediv__(self, other: Any) -> FloatArray:
        return self._binary("divide", other, self)

    def __matmul__(self, other: Any) -> FloatArray:
        return _matmul(self, self._operand(other))

    def __rmatmul__(self, other: Any) -> FloatArray:
        return _matmul(self._operand(other), self)

    def __pow__(self, other: Any) -> FloatArray:
        raise TypeError(
            "got x ** y of a FloatArray; needed + - * / @ or np.sqrt, each rounded once; write the products out: x * x"
        )

    __rpow__ = __pow__

    def __neg__(self) -> FloatArray:
        return self._unary("negative")

    def __pos__(self) -> FloatArray:
        return self

    def __abs__(self) -> FloatArray:
        return self._unary("absolute")

    def sqrt(self) -> FloatArray:
        """The square root of each entry, correctly rounded; also ``np.sqrt(x)``."""
        return self._unary("sqrt")

    def sum(self, axis: int | None = None) -> FloatArray:
        """Add up from left to right, ``((x1 + x2) + x3) + ...``; the sum of no entries is zero.

        Parameters
        ----------
        axis : along which to add; all entries, row after row, if None.

        References
        ----------
        hung1984, ch. II, (17).
        """
        return self._reduce("add", axis, 0)

    def prod(self, axis: int | None = None) -> FloatArray:
        """Multiply from left to right; the product of no entries is one.

        Parameters
        ----------
        axis : along which to multiply; all entries, row after row, if None.

        References
        ----------
        hung1984, ch. II, (19).
        """
        return self._reduce("multiply", axis, 1)

    def _reduce(self, name: str, axis: Any, of_none: int) -> FloatArray:
        try:
            axis = None if axis is None else operator.index(axis)
        except TypeError:
            raise TypeError(f"axis: got {axis!r}; needed an int or None; reduce one axis after the other") from None
        lines = self.reshape(-1) if axis is None else self._moved(lambda a: np.moveaxis(a, axis, 0))
        if not len(lines):
            return self._zeros(lines.shape[1:]) + of_none
        if (components := self.backend.fold(name, lines.components)) is not None:
            return self.from_components(self.backend, components, self._format)
        total = lines[0]
        for i in range(1, len(lines)):
            total = self._binary(name, total, lines[i])
        return total

    def _zeros(self, shape: tuple[int, ...]) -> FloatArray:
        return self._make(np.zeros(shape, object), np.zeros(shape, object), self._format)

    # -- comparison ----------------------------------------------------------------------------

    def _compare(self, other: Any, holds: Callable[[Any], Any]) -> Any:
        b = self._operand(other)
        _broadcast("compare", self.shape, b.shape)
        backend, (a, b) = _common((self, b))
        return holds(backend.compare(a.components, b.components))[()]

    def __eq__(self, other: object) -> Any:
        return self._compare(other, lambda order: order == 0)

    def __ne__(self, other: object) -> Any:
        return self._compare(other, lambda order: order != 0)

    def __lt__(self, other: Any) -> Any:
        return self._compare(other, lambda order: order < 0)

    def __le__(self, other: Any) -> Any:
        return self._compare(other, lambda order: order <= 0)

    def __gt__(self, other: Any) -> Any:
        return self._compare(other, lambda order: order > 0)

    def __ge__(self, other: Any) -> Any:
        return self._compare(other, lambda order: order >= 0)

    def _pair(self) -> Any:
        """Significand and exponent of a single number."""
        m, e = self._exactly().components
        return m.item(), e.item()

    def __bool__(self) -> bool:
        if self.size != 1:
            raise ValueError(
                f"got the truth value of a FloatArray of shape {self.shape}; needed one number; "
                "compare, then use np.all or np.any"
            )
        return bool(self.components[0].item() != 0)

    # -- conversion ----------------------------------------------------------------------------

    def to_float(self) -> Any:
        """The nearest float64 of each entry: an array, or a float for a single number.

        Raises
        ------
        OverflowError : an entry would become infinite, or is not zero and would become so.
        """
        return self.backend.to_float(self.components)[()]

    def to_fractions(self) -> Any:
        """The exact value of each entry: an object array of Fractions, or one Fraction.

        Raises
        ------
        OverflowError : an entry is too long to write out.
        """
        to_fraction = np.frompyfunc(self._format.kernel.to_fraction, 2, 1)
        return np.asarray(to_fraction(*self._exactly().components), dtype=object)[()]

    def __float__(self) -> float:
        if self.size != 1:
            raise TypeError(f"got float() of a FloatArray of shape {self.shape}; needed one number; use x.to_float()")
        return float(self.reshape(()).to_float())

    def astype(self, dtype: Any) -> NDArray[Any]:
        """A NumPy array of dtype float64, the nearest, or object, the exact Fractions.

        Raises
        ------
        TypeError : another dtype.
        OverflowError : as :meth:`to_float`.
        """
        dtype = np.dtype(dtype)
        if dtype == np.float64:
            return np.asarray(self.to_float(), dtype=np.float64)
        if dtype == np.dtype(object):
            return _single(self.to_fractions()) if not self.ndim else self.to_fractions()
        raise TypeError(
            f"got a conversion to dtype {dtype}; needed float64 (nearest) or object (exact Fractions); "
            "use x.to_float().astype(...)"
        )

    def __array__(self, dtype: Any = None, copy: bool | None = None) -> NDArray[Any]:
        if copy is False:
            raise ValueError("got copy=False; needed True or None: a FloatArray becomes an array by conversion only")
        return self.astype(np.float64 if dtype is None else dtype)

    # -- NumPy's protocols ---------------------------------------------------------------------

    def __array_ufunc__(self, ufunc: Any, method: str, *inputs: Any, **kwargs: Any) -> Any:
        name = ufunc.__name__
        if method == "__call__" and name in _UFUNCS and not kwargs:
            return _UFUNCS[name](self, *inputs)
        if method == "reduce" and name in ("add", "multiply"):
            axis = kwargs.pop("axis", 0)
            if not any(value is not None and value is not False for value in kwargs.values()):
                return inputs[0]._reduce(name, axis, int(name == "multiply"))
        options = f" with {', '.join(kwargs)}" if kwargs else ""
        called = f"np.{name}" if method == "__call__" else f"np.{name}.{method}"
        raise TypeError(
            f"got {called}{options} of a FloatArray; needed one of {', '.join(sorted(_UFUNCS))}, "
            "add.reduce, multiply.reduce, without further options; or convert: x.to_float()"
        )

    def __array_function__(self, func: Any, types: Any, args: Any, kwargs: Any) -> Any:
        name = func.__name__
        if name in _JOINERS or name in _MOVERS:
            return self._move(func, args, kwargs)
        if name in _FUNCTIONS:
            signature = inspect.signature(_FUNCTIONS[name])
            try:
                signature.bind(self, *args, **kwargs)
            except TypeError as error:
                taken = ", ".join(list(signature.parameters)[1:])
                raise TypeError(f"np.{name} of a FloatArray: {error}; needed np.{name}({taken})") from None
            return _FUNCTIONS[name](self, *args, **kwargs)
        raise TypeError(
            f"got np.{name} of a FloatArray; needed one of "
            f"{', '.join(sorted((*_JOINERS, *_MOVERS, *_FUNCTIONS)))}; for linear algebra see gpbnb.linalg; "
            "or convert: x.to_float()"
        )

    def _move(self, func: Any, args: Any, kwargs: Any) -> FloatArray:
        """Call a NumPy function that only moves entries, on each part."""
        if refused := {"out", "dtype", "casting", "like"} & kwargs.keys():
            raise TypeError(
                f"got np.{func.__name__} of a FloatArray with {', '.join(sorted(refused))}; "
                "needed none of them: the result is a FloatArray of the same format"
            )
        first, rest = (args[0], args[1:]) if args else (None, ())
        if func.__name__ in _JOINERS and isinstance(first, Sequence):
            backend, arrays = _common([self._operand(part) for part in first])
            components = zip(*(array.components for array in arrays), strict=True)
            return self.from_components(backend, (func(part, *rest, **kwargs) for part in components), self._format)
        if not isinstance(first, FloatArray) or any(isinstance(value, FloatArray) for value in rest):
            raise TypeError(
                f"got np.{func.__name__} with a FloatArray in an unexpected place; needed it as the first argument, "
                "or in a list that is the first"
            )
        return first._moved(lambda a: func(a, *rest, **kwargs))

    # -- text ----------------------------------------------------------------------------------

    def __repr__(self) -> str:
        """Code that makes the same array; with ``...`` in it for more entries than NumPy prints."""
        start = f"{self._format}.array("
        shape = "" if self.size or self.shape == (0,) else f".reshape{self.shape}"
        return f"{start}{self._text(quote=chr(39), separator=', ', prefix=start)}){shape}"

    def __str__(self) -> str:
        return self._text(quote="", separator=" ", prefix="")

    def __format__(self, spec: str) -> str:
        return format(float(self), spec) if spec else str(self)

    def _text(self, quote: str, separator: str, prefix: str) -> str:
        """Decimal digits from which ``fmt.array`` makes the same numbers again, in columns."""
        entries = self.reshape(-1)
        shown: dict[int, str] = {}

        def entry(place: Any) -> str:
            i = int(place)
            if i not in shown:
                m, e = entries[i]._pair()
                shown[i] = f"{quote}{_decimal_text(m, e, self._format)}{quote}"
            return shown[i].rjust(width)

        width = 0
        if not self.ndim:
            return entry(0)
        places = np.arange(self.size).reshape(self.shape)
        np.array2string(places, formatter={"int": entry})  # to see which are shown and how wide they are
        width = max(map(len, shown.values()), default=0)
        return np.array2string(
            places, separator=separator, prefix=prefix, suffix=")", formatter={"int": entry}, max_line_width=120
        )


def _single(value: Any) -> NDArray[Any]:
    """An object array of no axes that holds `value`, whatever it is."""
    array = np.empty(1, object)
    array[0] = value
    return array.reshape(())


def _frozen(a: Any, dtype: Any) -> NDArray[Any]:
    """An array that cannot be written to."""
    array = a if isinstance(a, np.ndarray) else np.asarray(a, dtype=dtype)
    array.flags.writeable = False
    return array


def _entries(values: Any) -> NDArray[Any]:
    """An object array of the numbers in `values`, whatever holds them."""
    if isinstance(values, np.ma.MaskedArray):
        raise TypeError("got a masked array; needed every entry; fill it first: a.filled(...)")
    if isinstance(values, FloatArray):
        return values.astype(object)
    if isinstance(values, (str, bytes, bytearray, np.generic)):
        return _single(values)
    if hasattr(values, "__array__"):
        values = np.asarray(values)
        if values.dtype.kind not in "iufUTO":
            raise TypeError(
                f"got an array of dtype {values.dtype}; needed integers, floats, strings, or "
                "objects that are numbers; convert it: a.astype(float)"
            )
        return values.astype(object)
    if isinstance(values, Sequence):
        components = [_entries(value) for value in values]
        shapes = {part.shape for part in components}
        if len(shapes) > 1:
            raise ValueError(
                f"got nested lists with parts of shapes {', '.join(map(str, sorted(shapes)))}; "
                "needed parts of one shape; fill or cut the lists"
            )
        array = np.empty((len(components), *(shapes.pop() if components else ())), object)
        for i, part in enumerate(components):
            array[i] = part[()]  # of a single number: itself, not an array of it
        return array
    if isinstance(values, (Set, Mapping, Iterator)):
        raise TypeError(
            f"got a {type(values).__name__}; needed a number, list or array; make it a list first: list(...)"
        )
    return _single(values)


def _exact_backend(fmt: FloatFormat) -> Backend:
    return backends.exact(fmt.base, fmt.precision, fmt.rounding is Rounding.NEAREST)


def _common(arrays: Sequence[FloatArray]) -> tuple[Backend, Sequence[FloatArray]]:
    """One backend that holds all the arrays."""
    backend = arrays[0].backend
    if all(array.backend is backend for array in arrays):
        return backend, arrays
    return _exact_backend(arrays[0]._format), [array._exactly() for array in arrays]


def _broadcast(name: str, a: tuple[int, ...], b: tuple[int, ...]) -> None:
    if a == b:
        return
    try:
        np.broadcast_shapes(a, b)
    except ValueError:
        raise ValueError(
            f"{name}: got operands of shapes {a} and {b}; needed shapes that broadcast "
            "(equal or 1 in each axis, counted from the last); reshape one of them"
        ) from None


def _first(condition: Any) -> tuple[int, ...] | None:
    """Index of the first place where `condition` holds."""
    condition = np.asarray(condition, dtype=bool)
    if not condition.any():
        return None
    return tuple(int(i) for i in np.argwhere(condition)[0])


def _place(index: tuple[int, ...]) -> str:
    return f"[{', '.join(map(str, index))}]"


def _matmul(a: FloatArray, b: FloatArray) -> FloatArray:
    """Products of rows and columns, each summed from left to right, as (26) and (27)."""
    if not a.ndim or not b.ndim:
        raise ValueError(f"matmul: got shapes {a.shape} and {b.shape}; needed at least one axis each; use *")
    rows = a if a.ndim > 1 else a[np.newaxis, :]
    columns = b if b.ndim > 1 else b[:, np.newaxis]
    n = rows.shape[-1]
    if n != columns.shape[-2]:
        raise ValueError(
            f"matmul: got shapes {a.shape} and {b.shape}, so {n} columns against "
            f"{columns.shape[-2]} rows; needed as many; transpose or reshape one of them"
        )
    _broadcast("matmul", rows.shape[:-2], columns.shape[:-2])
    if n == 0:
        stack = np.broadcast_shapes(rows.shape[:-2], columns.shape[:-2])
        c = a._zeros((*stack, rows.shape[-2], columns.shape[-1]))
    elif rows.ndim == columns.ndim == 2 and (components := _product(rows, columns)) is not None:
        c = a.from_components(a.backend, components, a._format)
    else:
        c = rows[..., :, 0, np.newaxis] * columns[..., np.newaxis, 0, :]
        for k in range(1, n):
            c = c + rows[..., :, k, np.newaxis] * columns[..., np.newaxis, k, :]
    if a.ndim == 1:
        c = c[..., 0, :]
    return c if b.ndim > 1 else c[..., 0]


def _product(rows: FloatArray, columns: FloatArray) -> Components | None:
    """The components of the product of two matrices, where their backend can form it."""
    return rows.backend.matmul(rows.components, columns.components) if rows.backend is columns.backend else None


def _decimal_text(m: int, e: int, fmt: FloatFormat) -> str:
    """Decimal digits that round to ``m * base**e`` in `fmt`: exact in base 10."""
    if m == 0:
        return "0"
    if fmt.base == 10:
        digits, exponent = integer_text(abs(m)), e
    else:
        try:
            digits, exponent = _shortened(abs(m), e, fmt)
        except OverflowError:  # the decimal exponent has millions of digits to compute
            return f"{integer_text(m)}*{integer_text(fmt.base)}**{integer_text(e)}"
    digits, exponent = digits.rstrip("0"), exponent + len(digits) - len(digits.rstrip("0"))
    sign = "-" if m < 0 else ""
    point = len(digits) + exponent
    if -4 <= point - 1 < 16:
        if exponent >= 0:
            return sign + digits + "0" * exponent
        if point > 0:
            return f"{sign}{digits[:point]}.{digits[point:]}"
        return f"{sign}0.{'0' * -point}{digits}"
    tail = f".{digits[1:]}" if len(digits) > 1 else ""
    return f"{sign}{digits[0]}{tail}e{'+' if point > 0 else ''}{integer_text(point - 1)}"


def _shortened(m: int, e: int, fmt: FloatFormat) -> tuple[str, int]:
    """Enough decimal digits to tell ``m * base**e`` from its neighbours in `fmt`.

    Rounded up when the format chops, so that chopping them gives the number and not the one below.
    """
    count = math.ceil(fmt.precision * math.log10(fmt.base)) + 2
    decimal = FloatFormat(10, count, Rounding.NEAREST).kernel
    value = fmt.kernel.to_fraction(m, e)
    digits, exponent = decimal.from_ratio(value.numerator, value.denominator)
    if fmt.rounding is Rounding.CHOP and decimal.to_fraction(digits, exponent) < value:
        digits += 1
    return integer_text(digits), exponent


_UFUNCS: dict[str, Callable[..., Any]] = {
    "add": lambda x, a, b: x._binary("add", a, b),
    "subtract": lambda x, a, b: x._binary("subtract", a, b),
    "multiply": lambda x, a, b: x._binary("multiply", a, b),
    "divide": lambda x, a, b: x._binary("divide", a, b),
    "matmul": lambda x, a, b: _matmul(x._operand(a), x._operand(b)),
    "square": lambda x, a: x._binary("multiply", a, a),
    "sqrt": lambda x, a: a._unary("sqrt"),
    "negative": lambda x, a: a._unary("negative"),
    "positive": lambda x, a: a,
    "absolute": lambda x, a: a._unary("absolute"),
    "fabs": lambda x, a: a._unary("absolute"),
    "equal": lambda x, a, b: x._operand(a) == b,
    "not_equal": lambda x, a, b: x._operand(a) != b,
    "less": lambda x, a, b: x._operand(a) < b,
    "less_equal": lambda x, a, b: x._operand(a) <= b,
    "greater": lambda x, a, b: x._operand(a) > b,
    "greater_equal": lambda x, a, b: x._operand(a) >= b,
}

_JOINERS = frozenset(("concatenate", "hstack", "stack", "vstack"))

# fmt: off
_MOVERS = frozenset((
    "atleast_1d", "atleast_2d", "broadcast_to", "copy", "diag", "diagonal", "expand_dims", "flip", "moveaxis", "ravel",
    "repeat", "reshape", "roll", "squeeze", "swapaxes", "take", "tile", "transpose", "tril", "triu",
))
# fmt: on


def _dot(x: FloatArray, a: Any, b: Any) -> FloatArray:
    a, b = x._operand(a), x._operand(b)
    if not a.ndim or not b.ndim:
        return a * b
    if max(a.ndim, b.ndim) > 2:
        raise ValueError(f"dot: got shapes {a.shape} and {b.shape}; needed at most two axes each; use @")
    return _matmul(a, b)


def _array_equal(x: FloatArray, a1: Any, a2: Any) -> bool:
    a, b = x._operand(a1), x._operand(a2)
    return a.shape == b.shape and bool(np.all(a == b))


def _where(x: FloatArray, condition: Any, a: Any, b: Any) -> FloatArray:
    if isinstance(condition, FloatArray):
        raise TypeError("where: got a FloatArray as condition; needed booleans; compare it with something")
    condition = np.asarray(condition, dtype=bool)
    a, b = x._operand(a), x._operand(b)
    _broadcast("where", condition.shape, a.shape)
    _broadcast("where", np.broadcast_shapes(condition.shape, a.shape), b.shape)
    backend, (a, b) = _common((a, b))
    components = zip(a.components, b.components, strict=True)
    return x.from_components(backend, (np.where(condition, p, q) for p, q in components), x._format)


_FUNCTIONS: dict[str, Callable[..., Any]] = {
    "array_equal": _array_equal,
    "dot": _dot,
    "ndim": lambda x, a: a.ndim,
    "outer": lambda x, a, b: x._operand(a).reshape(-1, 1) * x._operand(b).reshape(1, -1),
    "prod": lambda x, a, axis=None: a.prod(axis),
    "shape": lambda x, a: a.shape,
    "size": lambda x, a: a.size,
    "sum": lambda x, a, axis=None: a.sum(axis),
    "where": _where,
}
