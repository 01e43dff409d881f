"""Numbers and matrices to first order in the rounding error ε: ``value + slope ε`` with ε² = 0, in exact Fractions."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from fractions import Fraction
from typing import Any

import numpy as np

from gpbnb.arithmetic.rational import column_sum_norm, exact, inverse_of
from gpbnb.report.ledger.dotted import DottedMatrix


class FirstOrder:
    """A number or a matrix, and the coefficient of ε in it; ``*`` of two matrices is their matrix product.

    Parameters
    ----------
    value : the number (Fraction) or matrix (object array of Fractions) without rounding errors.
    slope : the coefficient of ε, of the same shape; zero by default.
    """

    __hash__ = None  # type: ignore[assignment]
    __array_ufunc__ = None  # NumPy leaves mixed operations to this class

    def __init__(self, value: Any, slope: Any = None) -> None:
        self.value = value
        self.slope = value * 0 if slope is None else slope

    def __add__(self, other: Any) -> FirstOrder:
        other = quantity(other)
        return FirstOrder(self.value + other.value, self.slope + other.slope)

    def __neg__(self) -> FirstOrder:
        return FirstOrder(-self.value, -self.slope)

    def __sub__(self, other: Any) -> FirstOrder:
        return self + -quantity(other)

    def __rsub__(self, other: Any) -> FirstOrder:
        return quantity(other) - self

    def __mul__(self, other: Any) -> FirstOrder:
        if isinstance(other, int | Fraction):
            return FirstOrder(self.value * other, self.slope * other)
        other = quantity(other)
        return FirstOrder(
            _product(self.value, other.value), _product(self.value, other.slope) + _product(self.slope, other.value)
        )

    def __rmul__(self, other: Any) -> FirstOrder:
        return self * other if isinstance(other, int | Fraction) else quantity(other) * self

    def inv(self) -> FirstOrder:
        """The inverse of a matrix, or of a number."""
        inverse = 1 / self.value if isinstance(self.value, Fraction) else inverse_of(self.value)
        return FirstOrder(inverse, -_product(_product(inverse, self.slope), inverse))

    def __truediv__(self, other: Any) -> FirstOrder:
        return self * quantity(other).inv()

    def __rtruediv__(self, other: Any) -> FirstOrder:
        return quantity(other) / self

    def __pow__(self, exponent: Any) -> FirstOrder:
        if exponent != int(exponent) or exponent < 1:
            raise ValueError(f"got exponent {exponent}; needed an integer of at least 1")
        return self if exponent == 1 else self * self ** (exponent - 1)

    __radd__ = __add__

    @property
    def T(self) -> FirstOrder:
        """The transpose."""
        return FirstOrder(self.value.T, self.slope.T)

    @property
    def shape(self) -> tuple[int, ...]:
        """The numbers of rows and columns; empty for a number."""
        return np.shape(self.value)

    def tolist(self) -> list[list[FirstOrder]]:
        """The entries of a matrix, by row and column."""
        return [
            [FirstOrder(v, s) for v, s in zip(*rows, strict=True)] for rows in zip(self.value, self.slope, strict=True)
        ]

    def __abs__(self) -> FirstOrder:
        sign = np.where(self.value == 0, np.sign(self.slope), np.sign(self.value))
        return self * Fraction(int(sign)) if not self.shape else FirstOrder(self.value * sign, self.slope * sign)

    def __eq__(self, other: object) -> bool:
        if isinstance(other, DottedMatrix):
            return NotImplemented
        found = quantity(other)
        return bool(
            self.shape == found.shape and np.all(self.value == found.value) and np.all(self.slope == found.slope)
        )

    def __le__(self, other: Any) -> bool:
        """Whether no entry is larger for small positive ε: values are compared first, then slopes."""
        if isinstance(other, DottedMatrix):
            return NotImplemented
        found = quantity(other)
        equal = self.value == found.value
        return bool(np.all((self.value < found.value) | (equal & (self.slope <= found.slope))))

    def norm(self) -> FirstOrder:
        """Return the largest column sum of sizes, (22), or the largest entry of a column, (21)."""
        sizes = abs(self)
        largest = (lambda x: x.max()) if sizes.value.shape[1] == 1 else column_sum_norm
        return FirstOrder(largest(sizes.value), largest(sizes.slope))


def quantity(x: Any) -> FirstOrder:
    """Convert a number or a matrix of any type to a quantity with its rounding error."""
    if isinstance(x, FirstOrder):
        return x
    if isinstance(x, np.ndarray):
        return FirstOrder(exact(x))
    return FirstOrder(Fraction(x))


def matrix(rows: list[Any]) -> FirstOrder:
    """Return the matrix with these rows of numbers; a flat list gives one row."""
    table = [[quantity(cell) for cell in (row if isinstance(row, list) else rows)] for row in rows]
    table = table if isinstance(rows[0], list) else table[:1]
    return FirstOrder(
        np.array([[cell.value for cell in row] for row in table], dtype=object),
        np.array([[cell.slope for cell in row] for row in table], dtype=object),
    )


def looked_up(pairs: Iterable[tuple[FirstOrder, FirstOrder]]) -> Callable[[FirstOrder], FirstOrder]:
    """Return the function that returns the second of the pair with a given first one; LookupError if there is none."""
    pairs = tuple(pairs)

    def look(first: FirstOrder) -> FirstOrder:
        for each, second in pairs:
            if each == first:
                return second
        raise LookupError("got a value that no result has; needed the exact value of one of them")

    return look


def joined(columns: list[FirstOrder]) -> FirstOrder:
    """Return the matrix with these columns."""
    return FirstOrder(np.hstack([c.value for c in columns]), np.hstack([c.slope for c in columns]))


EPSILON = FirstOrder(Fraction(0), Fraction(1))


def _product(a: Any, b: Any) -> Any:
    return a @ b if isinstance(a, np.ndarray) and isinstance(b, np.ndarray) else a * b
