"""NumPy's array protocols for arrays of a format: the NumPy functions that they support, and their meaning."""

from __future__ import annotations

import difflib
import inspect
import operator
from abc import abstractmethod
from collections.abc import Callable, Container, Sequence
from fractions import Fraction
from functools import cache, partial
from typing import Any, cast

import numpy as np
from numpy.typing import NDArray

from gpbnb.arithmetic import functions
from gpbnb.arithmetic.conversion import single
from gpbnb.arithmetic.elementary import ELEMENTARY, ELEMENTARY_PAIRS, elementary
from gpbnb.arithmetic.exits import check_exit

_EXACT = {2: 53, 16: 13}  # digits of float64
_LEAST_NORMAL = 2.0**-1022

_JOINERS = frozenset(("concatenate", "hstack", "stack", "vstack"))

# fmt: off
_MOVERS = frozenset((
    "atleast_1d", "atleast_2d", "broadcast_to", "copy", "diag", "diagonal", "expand_dims", "flip", "moveaxis", "ravel",
    "repeat", "reshape", "roll", "squeeze", "swapaxes", "take", "tile", "transpose", "tril", "triu",
))
# fmt: on


_ASSIGNMENTS = frozenset(("copyto", "fill_diagonal", "place", "put", "put_along_axis", "putmask"))


class NumPyProtocols:
    """Methods that let NumPy's own functions accept an array of a format."""

    __slots__ = ()

    def __getattr__(self, name: str) -> Any:
        if name.startswith("__"):
            raise AttributeError(name)
        known = [each for each in dir(type(self)) if not each.startswith("_")]
        raise AttributeError(
            f"a {type(self).__name__} has no attribute {name!r}; "
            f"{_nearest_attribute(name, known) or 'needed one of ' + ', '.join(known)}; for NumPy's other attributes "
            "convert: x.to_float()"
        )

    # -- methods of NumPy's arrays ------------------------------------------------------------------------

    mean, max, min = functions.mean, functions.largest, functions.smallest
    argmax, argmin, argsort = functions.argmax, functions.argmin, functions.argsort
    all, any, clip = functions.every, functions.some, functions.clip
    cumsum, trace = functions.cumsum, functions.trace

    def dot(self, other: Any) -> Any:
        """Compute ``np.dot``, with products summed from left to right."""
        return _dot(self, self, other)

    def copy(self) -> Any:
        """Return the array itself, which is immutable and needs no copy."""
        return self

    __copy__ = copy

    def __deepcopy__(self, memo: Any) -> Any:
        return self

    def ravel(self) -> Any:
        """Return the entries as a one-dimensional array, row after row."""
        return self.moved(np.ravel)

    flatten = ravel

    def transpose(self, *axes: Any) -> Any:
        """Return the array with its axes in another order, by default reversed."""
        order = axes[0] if len(axes) == 1 and not isinstance(axes[0], int) else axes or None
        return self.moved(lambda a: np.transpose(a, order))

    @abstractmethod
    def to_fractions(self) -> Any:
        """Return the exact value of each entry."""

    def tolist(self) -> Any:
        """Return exact Fractions in nested lists, or one Fraction."""
        check_exit(self, "tolist()")
        found = self.to_fractions()
        return found.tolist() if isinstance(found, np.ndarray) else found

    def item(self, *index: Any) -> Any:
        """Return one entry as an exact Fraction."""
        check_exit(self, "item()")
        found = np.asarray(self.to_fractions(), dtype=object)
        return found.item(*index)

    @abstractmethod
    def operand(self, other: Any) -> Any:
        """Return the other operand of an operation as an array of the same format."""

    @abstractmethod
    def moved(self, move: Callable[[Any], Any]) -> Any:
        """Apply to each component a function that only moves entries, such as a transposition."""

    @abstractmethod
    def joined(self, join: Callable[[Sequence[Any]], Any], arrays: Sequence[Any]) -> Any:
        """Join arrays with a function that only moves entries, such as a concatenation."""

    # -- leaving the format --------------------------------------------------------------------------------

    @abstractmethod
    def to_float(self) -> Any:
        """Return the nearest float64 of each entry."""

    def _exact_float(self, what: str) -> NDArray[np.float64]:
        """Return each entry as float64 if that is exact."""
        given: Any = self
        nearest = np.asarray(given.to_float(), dtype=np.float64)
        sizes = np.abs(nearest[nearest != 0])
        short = given.format.precision <= _EXACT.get(given.format.base, 0)
        if short and (not sizes.size or sizes.min() >= _LEAST_NORMAL):
            return nearest
        exact = np.asarray(given.to_fractions(), dtype=object)
        for index in np.ndindex(nearest.shape):
            if Fraction(float(nearest[index])) != exact[index]:
                where = f" at {list(index)}" if index else ""
                raise ValueError(
                    f"got {what} of a {type(self).__name__} in {given.format}, whose entry{where} is no float64; "
                    "needed an explicit conversion: x.to_float() for the nearest float64, x.to_fractions() for exact "
                    "values, pickle to save an array as it is"
                )
        return nearest

    def __float__(self) -> float:
        check_exit(self, "float()")
        given: Any = self
        if given.size != 1:
            raise TypeError(
                f"got float() of a {type(self).__name__} of shape {given.shape}; needed one number; use x.to_float()"
            )
        return float(given.reshape(())._exact_float("float()").item())

    def __int__(self) -> int:
        check_exit(self, "int()")
        raise TypeError(f"got int() of a {type(self).__name__}; needed its exact value: int(x.to_fractions())")

    def __index__(self) -> int:
        check_exit(self, "an index")
        raise TypeError(f"got a {type(self).__name__} as an index; needed an int: int(x.to_fractions())")

    def __round__(self, digits: int | None = None) -> Any:
        check_exit(self, "round()")
        raise TypeError(f"got round() of a {type(self).__name__}; needed its exact value: round(x.to_fractions())")

    def astype(self, dtype: Any) -> NDArray[Any]:
        """Return a NumPy array of the nearest float64 numbers, or of exact Fractions for dtype object.

        Raises
        ------
        TypeError : another dtype, or a format, whose ``array`` converts.
        OverflowError : as for ``to_float``.
        """
        if hasattr(dtype, "array"):
            raise TypeError(f"got a conversion to the format {dtype}; needed a dtype of NumPy; write fmt.array(x)")
        check_exit(self, "astype()")
        dtype = np.dtype(dtype)
        if dtype == np.float64:
            return np.asarray(self.to_float(), dtype=np.float64)
        if dtype == np.dtype(object):
            found = self.to_fractions()
            return found if isinstance(found, np.ndarray) else single(found)
        raise TypeError(
            f"got a conversion to dtype {dtype}; needed float64 (nearest) or object (exact Fractions); "
            "use x.to_float().astype(...)"
        )

    def __array__(self, dtype: Any = None, copy: bool | None = None) -> NDArray[Any]:
        check_exit(self, "a NumPy array")
        if copy is False:
            raise ValueError(
                f"got copy=False; needed True or None; converting a {type(self).__name__} always copies it"
            )
        if dtype is None or np.dtype(dtype) == np.float64:
            return self._exact_float("an array")
        return self.astype(dtype)

    def __format__(self, spec: str) -> str:
        check_exit(self, "text")
        return format(float(self.to_float()), spec) if spec else str(self)

    def __array_ufunc__(self, ufunc: Any, method: str, *inputs: Any, **kwargs: Any) -> Any:
        name = ufunc.__name__
        if method == "__call__" and name in _UFUNCS and not kwargs:
            return _UFUNCS[name](*map(self.operand, inputs))
        if method == "reduce" and name in _REDUCTIONS:
            axis, keepdims = kwargs.pop("axis", 0), kwargs.pop("keepdims", False)
            if not any(value is not None and value is not False for value in kwargs.values()):
                return _REDUCTIONS[name](inputs[0], axis, keepdims)
        options = f" with {', '.join(kwargs)}" if kwargs else ""
        called = f"np.{name}" if method == "__call__" else f"np.{name}.{method}"
        reductions = ", ".join(f"{each}.reduce" for each in _REDUCTIONS)
        near = "" if name in _UFUNCS else _nearest(name, _UFUNCS)
        raise TypeError(
            f"got {called}{options} of a {type(self).__name__}; needed one of {', '.join(sorted(_UFUNCS))}, "
            f"{reductions}, without further options{near}; or convert: x.to_float()"
        )

    def __array_function__(self, func: Any, types: Any, args: Any, kwargs: Any) -> Any:
        name, called = func.__name__, f"{func.__module__.replace('numpy', 'np', 1)}.{func.__name__}"
        if name in _JOINERS or name in _MOVERS:
            return self._rearrange(func, args, kwargs)
        of_linalg = func.__module__ == "numpy.linalg"
        algebra = cast(Any, self).format.algebra if of_linalg else {}
        function = algebra.get(name) or _FUNCTIONS.get(name)
        given = (self, *args)
        if function is None and name in _OF_ONE:
            function, given = _OF_ONE[name], args
        if function is not None:
            signature = _signature(function)
            try:
                signature.bind(*given, **kwargs)
            except TypeError as error:
                taken = ", ".join(list(signature.parameters)[len(given) - len(args) :])
                raise TypeError(f"{called} of a {type(self).__name__}: {error}; needed {called}({taken})") from None
            return function(*given, **kwargs)
        if name in _ASSIGNMENTS:
            raise TypeError(
                f"got {called} of a {type(self).__name__}, which cannot be changed; needed a copy with other entries: "
                "x = x.at[i].set(value), or np.where(condition, value, x)"
            )
        known = sorted((*algebra, "norm") if of_linalg else (*_JOINERS, *_MOVERS, *_FUNCTIONS, *_OF_ONE))
        shown = ", ".join(f"np.linalg.{each}" for each in known) if of_linalg else ", ".join(known)
        raise TypeError(
            f"got {called} of a {type(self).__name__}; needed one of {shown}{_nearest(name, known)}; for "
            "linear algebra see gpbnb.linalg; or convert: x.to_float()"
        )

    def _rearrange(self, func: Any, args: Any, kwargs: Any) -> Any:
        """Apply a NumPy function that only moves entries to each component."""
        if refused := {"out", "dtype", "casting", "like"} & kwargs.keys():
            raise TypeError(
                f"got np.{func.__name__} of a {type(self).__name__} with {', '.join(sorted(refused))}; "
                f"needed none of them: the result is a {type(self).__name__} of the same format"
            )
        first, rest = (args[0], args[1:]) if args else (None, ())
        if func.__name__ in _JOINERS and isinstance(first, Sequence):
            return self.joined(lambda components: func(components, *rest, **kwargs), list(map(self.operand, first)))
        if not isinstance(first, NumPyProtocols) or any(isinstance(value, NumPyProtocols) for value in rest):
            raise TypeError(
                f"got np.{func.__name__} with a {type(self).__name__} in an unexpected place; needed "
                "it as the first argument, or in a list that is the first argument"
            )
        return first.moved(lambda a: func(a, *rest, **kwargs))


_OTHER_NAMES = {
    "average": "mean", "cumprod": "prod", "inner": "dot", "vdot": "dot",
    "tensordot": "einsum", "conjugate": "copy", "conj": "copy", "real": "copy",
    "array_equiv": "array_equal", "ediff1d": "diff", "lexsort": "argsort", "full": "full_like",
    "flat": "ravel", "nbytes": "size", "dtype": "format", "put": "at", "fill": "at", "itemset": "at",
}  # fmt: skip


def _nearest(name: str, known: Container[str]) -> str:
    """Return a hint at the intended function of NumPy; empty if there is none."""
    found = _OTHER_NAMES.get(name, name.removeprefix("nan"))
    return f"; the nearest is np.{found}" if found in known else ""


def _nearest_attribute(name: str, known: Sequence[str]) -> str:
    """Return a hint at the intended attribute, or at the function to write in its place; empty if there is none."""
    if name in {*_MOVERS, *_FUNCTIONS, *_OF_ONE, *_UFUNCS}:
        return f"write np.{'linalg.' if name == 'norm' else ''}{name}(x)"
    if (other := _OTHER_NAMES.get(name, name.removeprefix("nan"))) in known:
        return f"the nearest is x.{other}"
    # A name of NumPy's means something else than a similar one here; other names may be slips.
    near = [] if name in vars(np) or hasattr(np.ndarray, name) else difflib.get_close_matches(name, known, 1, 0.8)
    return f"the nearest is x.{near[0]}" if near else ""


def broadcast(name: str, a: tuple[int, ...], b: tuple[int, ...]) -> None:
    """Raise ValueError if two shapes do not broadcast."""
    if a == b:
        return
    try:
        np.broadcast_shapes(a, b)
    except ValueError:
        raise ValueError(
            f"{name}: got operands of shapes {a} and {b}; needed shapes that broadcast "
            "(equal or 1 in each axis, counted from the last); reshape one of them"
        ) from None


_UFUNCS: dict[str, Callable[..., Any]] = {
    "add": operator.add,
    "subtract": operator.sub,
    "multiply": operator.mul,
    "divide": operator.truediv,
    "matmul": operator.matmul,
    "square": lambda a: a * a,
    "sqrt": lambda a: a.sqrt(),
    "negative": operator.neg,
    "positive": lambda a: a,
    "absolute": abs,
    "fabs": abs,
    "equal": operator.eq,
    "not_equal": operator.ne,
    "less": operator.lt,
    "less_equal": operator.le,
    "greater": operator.gt,
    "greater_equal": operator.ge,
    "maximum": functions.maximum,
    "minimum": functions.minimum,
    "sign": functions.sign,
    "fmax": functions.maximum,
    "fmin": functions.minimum,
    "isfinite": partial(functions.everywhere, True),
    "isinf": partial(functions.everywhere, False),
    "isnan": partial(functions.everywhere, False),
    "signbit": functions.signbit,
    "copysign": functions.copysign,
    "remainder": functions.remainder,
    "fmod": functions.fmod,
    "floor_divide": functions.floor_divide,
    "power": functions.power,
    "radians": partial(elementary, "deg2rad"),
    "degrees": partial(elementary, "rad2deg"),
    **{name: partial(elementary, name) for name in ELEMENTARY + ELEMENTARY_PAIRS},
    **{name: partial(elementary, name) for name in ("floor", "ceil", "trunc", "rint")},
}

_REDUCTIONS: dict[str, Callable[..., Any]] = {
    "add": lambda a, axis, keepdims: a.sum(axis, keepdims),
    "multiply": lambda a, axis, keepdims: a.prod(axis, keepdims),
    "maximum": functions.largest,
    "minimum": functions.smallest,
}


@cache
def _signature(function: Callable[..., Any]) -> inspect.Signature:
    return inspect.signature(function)


def _dot(x: NumPyProtocols, a: Any, b: Any) -> Any:
    a, b = x.operand(a), x.operand(b)
    if not a.ndim or not b.ndim:
        return a * b
    if max(a.ndim, b.ndim) > 2:
        raise ValueError(f"dot: got shapes {a.shape} and {b.shape}; needed at most two axes each; use @")
    return a @ b


def _array_equal(x: NumPyProtocols, a1: Any, a2: Any) -> bool:
    a, b = x.operand(a1), x.operand(a2)
    return a.shape == b.shape and bool(np.all(a == b))


def _where(x: NumPyProtocols, condition: Any, a: Any, b: Any) -> Any:
    if isinstance(condition, NumPyProtocols):
        raise TypeError(f"where: got a {type(x).__name__} as condition; needed a boolean array, such as x > 0")
    condition = np.asarray(condition, dtype=bool)
    a, b = x.operand(a), x.operand(b)
    broadcast("where", condition.shape, a.shape)
    broadcast("where", np.broadcast_shapes(condition.shape, a.shape), b.shape)
    return x.joined(lambda components: np.where(condition, *cast(Any, components)), [a, b])


def _append(x: NumPyProtocols, arr: Any, values: Any, axis: int | None = None) -> Any:
    arrays = [x.operand(each) for each in (arr, values)]
    if axis is None:
        arrays = [each.reshape(-1) for each in arrays]
    return np.concatenate(arrays, axis=axis or 0)


_FUNCTIONS: dict[str, Callable[..., Any]] = {
    "append": _append,
    "array_equal": _array_equal,
    "convolve": functions.convolve,
    "cross": functions.cross,
    "dot": _dot,
    "einsum": functions.einsum,
    "interp": functions.interp,
    "kron": functions.kron,
    "outer": lambda x, a, b: x.operand(a).reshape(-1, 1) * x.operand(b).reshape(1, -1),
    "save": lambda x, file, arr, **options: np.save(file, np.asarray(arr), **options),
    "select": lambda x, condlist, choicelist, default=0: functions.select(x, condlist, choicelist, default),
    "where": _where,
}
"""NumPy's functions that take an array of a format at any place; the array that NumPy asks comes first."""

# fmt: off
_AS_IN_NUMPY = (
    "argmax", "argmin", "argsort", "clip", "cumsum", "diff", "full_like", "isclose", "mean", "norm", "sort", "trace",
    "var",
)
# fmt: on
_OF_ONE: dict[str, Callable[..., Any]] = {
    **{name: getattr(functions, name) for name in _AS_IN_NUMPY},
    "all": functions.every,
    "allclose": lambda a, b, rtol=1e-5, atol=1e-8: bool(np.all(functions.isclose(a, b, rtol, atol))),
    "any": functions.some,
    "fix": lambda a: elementary("trunc", a),
    "max": functions.largest,
    "amax": functions.largest,
    "min": functions.smallest,
    "amin": functions.smallest,
    "ndim": lambda a: a.ndim,
    "ones_like": lambda a: functions.full_like(a, 1),
    "prod": lambda a, axis=None, keepdims=False: a.prod(axis, keepdims),
    "round": functions.rounded,
    "around": functions.rounded,
    "shape": lambda a: a.shape,
    "size": lambda a: a.size,
    "std": lambda a, axis=None, ddof=0, keepdims=False: functions.var(a, axis, ddof, keepdims).sqrt(),
    "sum": lambda a, axis=None, keepdims=False: a.sum(axis, keepdims),
    "zeros_like": lambda a: functions.full_like(a, 0),
}
"""NumPy's functions whose first argument is the array."""
