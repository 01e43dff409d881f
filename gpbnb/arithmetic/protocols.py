"""NumPy's array protocols for arrays of a format: which of its functions they take, and what each does."""

from __future__ import annotations

import difflib
import inspect
import operator
from abc import abstractmethod
from collections.abc import Callable, Sequence
from functools import partial
from typing import Any, cast

import numpy as np

from gpbnb.arithmetic import functions

_JOINERS = frozenset(("concatenate", "hstack", "stack", "vstack"))

# fmt: off
_MOVERS = frozenset((
    "atleast_1d", "atleast_2d", "broadcast_to", "copy", "diag", "diagonal", "expand_dims", "flip", "moveaxis", "ravel",
    "repeat", "reshape", "roll", "squeeze", "swapaxes", "take", "tile", "transpose", "tril", "triu",
))
# fmt: on


class NumPyProtocols:
    """What an array of a format needs so that NumPy's own functions take it."""

    __slots__ = ()

    def __getattr__(self, name: str) -> Any:
        if name.startswith("__"):
            raise AttributeError(name)
        near = difflib.get_close_matches(name, [each for each in dir(type(self)) if not each.startswith("_")], 1)
        hint = f"; the nearest is x.{near[0]}" if near else ""
        raise AttributeError(f"a {type(self).__name__} has no attribute {name!r}{hint}")

    # -- methods of NumPy's arrays ------------------------------------------------------------------------

    def mean(self, axis: int | None = None, keepdims: bool = False) -> Any:
        """See :func:`gpbnb.arithmetic.functions.mean`."""
        return functions.mean(self, axis, keepdims)

    def max(self, axis: int | None = None, keepdims: bool = False) -> Any:
        """See :func:`gpbnb.arithmetic.functions.largest`."""
        return functions.largest(self, axis, keepdims)

    def min(self, axis: int | None = None, keepdims: bool = False) -> Any:
        """See :func:`gpbnb.arithmetic.functions.smallest`."""
        return functions.smallest(self, axis, keepdims)

    def clip(self, low: Any = None, high: Any = None) -> Any:
        """See :func:`gpbnb.arithmetic.functions.clip`."""
        return functions.clip(self, low, high)

    def cumsum(self, axis: int | None = None) -> Any:
        """See :func:`gpbnb.arithmetic.functions.cumsum`."""
        return functions.cumsum(self, axis)

    def trace(self) -> Any:
        """See :func:`gpbnb.arithmetic.functions.trace`."""
        return functions.trace(self)

    def dot(self, other: Any) -> Any:
        """As ``np.dot``: entries of products are summed from left to right."""
        return _dot(self, self, other)

    def copy(self) -> Any:
        """The same array: it does not change, and needs no copy."""
        return self

    def ravel(self) -> Any:
        """The entries in one row."""
        return self.moved(np.ravel)

    def flatten(self) -> Any:
        """The entries in one row."""
        return self.moved(np.ravel)

    def transpose(self, *axes: Any) -> Any:
        """The axes in another order; by default in reverse."""
        order = axes[0] if len(axes) == 1 and not isinstance(axes[0], int) else axes or None
        return self.moved(lambda a: np.transpose(a, order))

    @abstractmethod
    def to_fractions(self) -> Any:
        """The exact value of each entry."""

    def tolist(self) -> Any:
        """Exact Fractions in nested lists, or one Fraction."""
        found = self.to_fractions()
        return found.tolist() if isinstance(found, np.ndarray) else found

    def item(self, *index: Any) -> Any:
        """One entry as an exact Fraction."""
        found = np.asarray(self.to_fractions(), dtype=object)
        return found.item(*index)

    @abstractmethod
    def operand(self, other: Any) -> Any:
        """The other operand of an operation, as an array of the same format."""

    @abstractmethod
    def moved(self, move: Callable[[Any], Any]) -> Any:
        """Apply to each component a function that only moves entries."""

    @abstractmethod
    def joined(self, join: Callable[[Sequence[Any]], Any], arrays: Sequence[Any]) -> Any:
        """Apply to each component of several arrays a function that only moves entries."""

    def __array_ufunc__(self, ufunc: Any, method: str, *inputs: Any, **kwargs: Any) -> Any:
        name = ufunc.__name__
        if method == "__call__" and name in _UFUNCS and not kwargs:
            return _UFUNCS[name](*map(self.operand, inputs))
        if method == "reduce" and name in _REDUCTIONS:
            axis = kwargs.pop("axis", 0)
            if not any(value is not None and value is not False for value in kwargs.values()):
                return _REDUCTIONS[name](inputs[0], axis)
        options = f" with {', '.join(kwargs)}" if kwargs else ""
        called = f"np.{name}" if method == "__call__" else f"np.{name}.{method}"
        raise TypeError(
            f"got {called}{options} of a {type(self).__name__}; needed one of {', '.join(sorted(_UFUNCS))}, "
            "add.reduce, multiply.reduce, without further options; or convert: x.to_float()"
        )

    def __array_function__(self, func: Any, types: Any, args: Any, kwargs: Any) -> Any:
        name = func.__name__
        if name in _JOINERS or name in _MOVERS:
            return self._rearrange(func, args, kwargs)
        if name in _FUNCTIONS:
            signature = inspect.signature(_FUNCTIONS[name])
            try:
                signature.bind(self, *args, **kwargs)
            except TypeError as error:
                taken = ", ".join(list(signature.parameters)[1:])
                raise TypeError(f"np.{name} of a {type(self).__name__}: {error}; needed np.{name}({taken})") from None
            return _FUNCTIONS[name](self, *args, **kwargs)
        raise TypeError(
            f"got np.{name} of a {type(self).__name__}; needed one of "
            f"{', '.join(sorted((*_JOINERS, *_MOVERS, *_FUNCTIONS)))}; for linear algebra see gpbnb.linalg; "
            "or convert: x.to_float()"
        )

    def _rearrange(self, func: Any, args: Any, kwargs: Any) -> Any:
        """Call a NumPy function that only moves entries, on each component."""
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


def broadcast(name: str, a: tuple[int, ...], b: tuple[int, ...]) -> None:
    """ValueError if two shapes do not broadcast."""
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
    "power": lambda a, b: functions.power(a, _exponent(b)),
    **{name: partial(functions.elementary, name) for name in functions.ELEMENTARY},
}

_REDUCTIONS: dict[str, Callable[..., Any]] = {
    "add": lambda a, axis: a.sum(axis),
    "multiply": lambda a, axis: a.prod(axis),
}


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


def _append(x: NumPyProtocols, a: Any, values: Any, axis: int | None) -> Any:
    arrays = [x.operand(each) for each in (a, values)]
    if axis is None:
        arrays = [each.reshape(-1) for each in arrays]
    return np.concatenate(arrays, axis=axis or 0)


def _exponent(value: Any) -> Any:
    """A plain exponent: NumPy hands it over as an array of a format."""
    if not value.ndim and (exact := value.to_fractions()).denominator == 1:
        return int(exact)
    raise TypeError("got an exponent that is not a single whole number; needed one, as in np.power(x, 3)")


_FUNCTIONS: dict[str, Callable[..., Any]] = {
    "array_equal": _array_equal,
    "dot": _dot,
    "ndim": lambda x, a: a.ndim,
    "outer": lambda x, a, b: x.operand(a).reshape(-1, 1) * x.operand(b).reshape(1, -1),
    "amax": lambda x, a, axis=None, keepdims=False: a.max(axis, keepdims),
    "amin": lambda x, a, axis=None, keepdims=False: a.min(axis, keepdims),
    "append": lambda x, arr, values, axis=None: _append(x, arr, values, axis),
    "clip": lambda x, a, a_min=None, a_max=None: a.clip(a_min, a_max),
    "cumsum": lambda x, a, axis=None: a.cumsum(axis),
    "einsum": functions.einsum,
    "kron": functions.kron,
    "max": lambda x, a, axis=None, keepdims=False: a.max(axis, keepdims),
    "mean": lambda x, a, axis=None, keepdims=False: a.mean(axis, keepdims),
    "min": lambda x, a, axis=None, keepdims=False: a.min(axis, keepdims),
    "norm": lambda x, a, ord=None, axis=None: functions.norm(a, ord, axis),
    "ones_like": lambda x, a: a * 0 + 1,
    "prod": lambda x, a, axis=None, keepdims=False: functions.kept(a, a.prod(axis), axis, keepdims),
    "sort": lambda x, a, axis=-1: functions.sort(a, axis),
    "shape": lambda x, a: a.shape,
    "size": lambda x, a: a.size,
    "sum": lambda x, a, axis=None, keepdims=False: functions.kept(a, a.sum(axis), axis, keepdims),
    "trace": lambda x, a: a.trace(),
    "where": _where,
    "zeros_like": lambda x, a: a * 0,
}
