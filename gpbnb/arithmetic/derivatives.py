r"""Exact differentiation of a function that is written with arrays of a format.

A :class:`Dual` array carries its derivatives with respect to all variables. Each operation on it follows one rule of
calculus, whose operations are rounded in the format, too:

==================  =========================================================================================
operation           derivative, in this order of operations
==================  =========================================================================================
:math:`a \pm b`     :math:`da \pm db`
:math:`ab`          :math:`da\,b + a\,db`, also for products of matrices
:math:`c = a/b`     :math:`(da - c\,db)/b`
:math:`\sqrt a`     :math:`da/(c + c)` with :math:`c = \sqrt a`
arctan2(y, x)       :math:`(dy\,x - dx\,y)/(xx + yy)`
hypot(x, y)         :math:`(dx\,x + dy\,y)/c` with :math:`c = \mathrm{hypot}(x, y)`
:math:`g(a)`        :math:`da\,g'(a)`, for the functions of one number in ``SLOPES``
==================  =========================================================================================

Nothing is approximated by differences. A derivative of zero or one stays exact, so that a linear function has its own
matrix as its Jacobian.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gpbnb.arithmetic.array import FloatArray, calls, operators
from gpbnb.arithmetic.elementary import elementary
from gpbnb.arithmetic.functions import lines

SLOPES: dict[str, Callable[[Any, Any], Any]] = {
    "exp": lambda a, c: c,
    "expm1": lambda a, c: c + 1,
    "sin": lambda a, c: elementary("cos", a),
    "cos": lambda a, c: -elementary("sin", a),
    "tan": lambda a, c: c * c + 1,
    "arcsin": lambda a, c: 1 / (1 - a * a).sqrt(),
    "arccos": lambda a, c: -(1 / (1 - a * a).sqrt()),
    "arctan": lambda a, c: 1 / (1 + a * a),
    "sinh": lambda a, c: elementary("cosh", a),
    "cosh": lambda a, c: elementary("sinh", a),
    "tanh": lambda a, c: 1 - c * c,
    "log": lambda a, c: 1 / a,
    "log1p": lambda a, c: 1 / (1 + a),
}
"""For each elementary function, its slope from the argument a and the value c."""

_DIFFERENTIATED = ("add", "subtract", "multiply", "divide", "matmul", "square", "sqrt", "negative", "positive")
_COMPARED = ("equal", "not_equal", "less", "less_equal", "greater", "greater_equal")
_CHOSEN = ("absolute", "fabs", "maximum", "minimum", "fmax", "fmin")


class Dual(FloatArray):
    """An array of a format with its derivatives; created by :func:`jacobian`.

    It takes the operations of a :class:`~gpbnb.arithmetic.array.FloatArray` that have a rule above, those that only
    move, join, choose or add up entries, and comparisons of its values.

    Examples
    --------
    >>> import numpy as np
    >>> from gpbnb import BINARY32
    >>> value, slopes = jacobian(lambda x: np.stack([x[0] * x[1], np.sin(x[1])]), BINARY32.array([3, 0]))
    >>> value.to_float(), slopes.to_float()
    (array([0., 0.]), array([[0., 3.],
           [0., 1.]]))
    """

    __slots__ = ("slope", "value")

    #: The array itself.
    value: FloatArray
    #: The derivatives of each entry with respect to p variables, with p as the first axis.
    slope: FloatArray

    @classmethod
    def of(cls, value: Any, slope: Any) -> Dual:
        """Join an array, and its derivatives along a first axis."""
        kind: Any = type(value)
        self = object.__new__(_dual(kind))
        self.value, self.slope, self._format = value, slope, value.format
        return self

    @classmethod
    def from_components(cls, backend: Any, components: Any, fmt: Any) -> Any:
        """Refuse an operation that would lose the derivatives."""
        raise _no_rule("this operation")

    @property
    def components(self) -> Any:  # type: ignore[override]
        """Refuse to convert entries, which would lose the derivatives."""
        raise _no_rule("a conversion or this operation")

    @property
    def backend(self) -> Any:  # type: ignore[override]
        """The backend of the values."""
        return self.value.backend

    @property
    def shape(self) -> tuple[int, ...]:
        """Length of each axis."""
        return self.value.shape

    @property
    def ndim(self) -> int:
        """Number of axes."""
        return self.value.ndim

    @property
    def size(self) -> int:
        """Number of entries."""
        return self.value.size

    def __len__(self) -> int:
        return len(self.value)

    def __bool__(self) -> bool:
        return bool(self.value)

    def operand(self, other: Any) -> Dual:
        """Return the other operand with its derivatives, which are zero for a constant."""
        if isinstance(other, Dual):
            self.value.operand(other.value)
            return other
        value = self.value.operand(other)
        zero = self.value.operand(0)
        return self.of(value, np.broadcast_to(zero, (len(self.slope), *value.shape)))

    def moved(self, move: Callable[[NDArray[Any]], Any]) -> Dual:
        """Move values and derivatives alike."""
        return self.of(self.value.moved(move), self.slope.moved(lambda a: np.stack([move(each) for each in a])))

    def joined(self, join: Callable[[Sequence[Any]], Any], arrays: Sequence[Any]) -> Dual:
        """Join values and derivatives alike."""
        duals = [self.operand(each) for each in arrays]

        def join_each(components: Sequence[Any]) -> Any:
            return np.stack([join(each) for each in zip(*components, strict=True)])

        value = duals[0].value.joined(join, [each.value for each in duals])
        return self.of(value, duals[0].slope.joined(join_each, [each.slope for each in duals]))

    def _wide(self, ndim: int) -> FloatArray:
        """Return the derivatives for values that broadcast to more axes."""
        return self.slope.reshape(len(self.slope), *(1,) * (ndim - self.ndim), *self.shape)

    def _binary(self, name: str, left: Any, right: Any) -> Dual:
        a, b = self.operand(left), self.operand(right)
        value = a.value._binary(name, a.value, b.value)
        da, db = a._wide(value.ndim), b._wide(value.ndim)
        if name in ("add", "subtract"):
            return self.of(value, da._binary(name, da, db))
        if name == "multiply":
            return self.of(value, da * b.value + a.value * db)
        return self.of(value, (da - value * db) / b.value)

    def _unary(self, name: str) -> Dual:
        value = self.value._unary(name)
        if name == "sqrt":
            return self.of(value, self.slope / (value + value))
        if name == "absolute":
            return self.of(value, np.where(self.value < 0, -self.slope, self.slope))
        return self.of(value, -self.slope)

    def _reduce(self, name: str, axis: Any, of_none: int) -> Any:
        given = lines(self, axis)
        total: Any = self.operand(np.full(given.shape[1:], of_none)) if not len(given) else given[0]
        for line in given[1:]:
            total = self._binary(name, total, line)
        return total

    # Python prefers the reflected operators of a derived class only if it defines them itself.

    __radd__, __rsub__ = operators("add")[1], operators("subtract")[1]
    __rmul__, __rtruediv__ = operators("multiply")[1], operators("divide")[1]
    __matmul__, __rmatmul__ = calls(lambda a, b: _product(a, b))

    def __pow__(self, other: Any) -> Any:
        if isinstance(other, Dual):
            raise _no_rule("np.power with an exponent that varies")
        return super().__pow__(other)

    def __rpow__(self, other: Any) -> Any:
        raise _no_rule("np.power with an exponent that varies")

    def __mod__(self, other: Any) -> Any:
        return _with_steps("remainder", self, other)

    def __rmod__(self, other: Any) -> Any:
        raise _no_rule("np.remainder with a divisor that varies")

    def _compare(self, other: Any, holds: Callable[[Any], Any]) -> Any:
        return self.value._compare(self.operand(other).value, holds)

    def __array_ufunc__(self, ufunc: Any, method: str, *inputs: Any, **kwargs: Any) -> Any:
        name = ufunc.__name__
        if method == "__call__" and not kwargs:
            if name in SLOPES:
                value = ufunc(self.value)
                return self.of(value, self.slope * SLOPES[name](self.value, value))
            if name in ("arctan2", "hypot"):
                return _of_two(ufunc, *map(self.operand, inputs))
            if name in ("remainder", "fmod"):
                return _with_steps(name, *inputs)
            if name not in (*_DIFFERENTIATED, *_COMPARED, *_CHOSEN):
                raise _no_rule(f"np.{name}")
        elif method != "reduce" or name not in ("add", "multiply", "maximum", "minimum"):
            raise _no_rule(f"np.{name}.{method}")
        return super().__array_ufunc__(ufunc, method, *inputs, **kwargs)


def _product(a: Dual, b: Dual) -> Dual:
    value = a.value @ b.value
    slopes = [da @ b.value + a.value @ db for da, db in zip(a.slope, b.slope, strict=True)]
    return Dual.of(value, np.stack(slopes))


def _of_two(ufunc: Any, a: Dual, b: Dual) -> Dual:
    value = ufunc(a.value, b.value)
    da, db = a._wide(value.ndim), b._wide(value.ndim)
    if ufunc.__name__ == "hypot":
        return Dual.of(value, (da * a.value + db * b.value) / value)
    return Dual.of(value, (da * b.value - db * a.value) / (b.value * b.value + a.value * a.value))


def _with_steps(name: str, a: Any, b: Any) -> Dual:
    """Return a remainder, which differs from its argument by whole multiples of a constant."""
    if not isinstance(a, Dual) or isinstance(b, Dual):
        raise _no_rule(f"np.{name} with a divisor that varies")
    value = getattr(np, name)(a.value, b)
    return Dual.of(value, np.broadcast_to(a._wide(value.ndim), (len(a.slope), *value.shape)))


def _no_rule(what: str) -> TypeError:
    return TypeError(
        f"got {what} on an array that carries its derivatives; needed operations with a rule: + - * / @, powers, "
        f"sqrt, arctan2, hypot, {', '.join(SLOPES)}, comparisons and np.where; for others, give the Jacobians F and H"
    )


@cache
def _dual(kind: Any) -> type[Dual]:
    """Return the class for arrays of a kind with derivatives, which takes operations with one of this kind first."""
    return Dual if kind is FloatArray else type(f"{kind.__name__}Dual", (Dual, kind), {"__slots__": ()})


def jacobian(function: Callable[[Any], Any], x: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Evaluate a function of a vector, and differentiate it exactly; see :mod:`gpbnb.arithmetic.derivatives`.

    Parameters
    ----------
    function : function of an array (n,) that returns an array (m,), written with operations of the format.
    x : (n,), the variables.

    Returns
    -------
    value : (m,), with the digits of ``function(x)``.
    slopes : (m, n), the derivative of each component with respect to each variable, rounded in the format.
    """
    n = x.shape[0]
    found = function(Dual.of(x, x.operand(np.eye(n, dtype=int))))
    if isinstance(found, Dual):
        return found.value, found.slope.T
    value = x.operand(found)  # it does not depend on x
    none: Any = np.broadcast_to(x.operand(0), (*value.shape, n))
    return value, none
