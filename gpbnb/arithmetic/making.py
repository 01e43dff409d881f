"""What every number format makes besides ``fmt.array``: zeros, identities, and numbers from their bits."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping
from fractions import Fraction
from typing import Any, Generic, TypeVar

import numpy as np

from gpbnb.arithmetic import linalg
from gpbnb.arithmetic.array import FloatArray
from gpbnb.arithmetic.kernels.exact import ExactKernel
from gpbnb.arithmetic.text import at_entry
from gpbnb.arithmetic.words import Layout, words

Made = TypeVar("Made", bound=FloatArray)


class Makes(ABC, Generic[Made]):
    """A number format that makes arrays of one class."""

    @property
    @abstractmethod
    def kernel(self) -> ExactKernel:
        """The scalar operations of this format."""

    @property
    @abstractmethod
    def layout(self) -> Layout:
        """How a word stores a number of this format."""

    @property
    def algebra(self) -> Mapping[str, Callable[..., Any]]:
        """What functions of ``np.linalg`` do for arrays of the format; elimination pivots, as LAPACK does."""
        return linalg.NUMPY

    @abstractmethod
    def round(self, value: Any) -> Fraction:
        """Round one number."""

    @abstractmethod
    def array(self, values: Any) -> Made:
        """Round numbers into an array."""

    def zeros(self, shape: int | tuple[int, ...]) -> Made:
        """Return an array of zeros.

        Examples
        --------
        >>> from gpbnb import BINARY32
        >>> BINARY32.zeros(3).to_float()
        array([0., 0., 0.])
        """
        return self.array(np.zeros(shape, dtype=int))

    def eye(self, n: int, m: int | None = None) -> Made:
        """Return the identity matrix (n, n), or (n, m) with ones on the diagonal.

        Raises
        ------
        OverflowError : the format cannot represent 1; Q15, for example, cannot.
        """
        return self.array(np.eye(n, m, dtype=int))

    def from_bits(self, bits: Any) -> Made:
        """Return the numbers that words store; the inverse of :meth:`gpbnb.arithmetic.array.FloatArray.to_bits`.

        A negative zero becomes zero, and infinity and NaN are refused, unless the format has them.

        Parameters
        ----------
        bits : whole numbers, of any shape, such as ``np.float32(x).view(np.uint32)``.

        Raises
        ------
        ValueError : the format has no range, or has base 10; a word is too long, or its value is not a number of the
            format, for example infinity or NaN.
        TypeError : an entry is not a whole number.

        Examples
        --------
        >>> from gpbnb import BINARY32
        >>> BINARY32.from_bits(0x3F800000).to_float()
        1.0
        """
        layout = self.layout
        given = words(bits, layout.width)
        values = np.empty(given.shape, dtype=object)
        for index, word in np.ndenumerate(given):
            m, e = layout.pair(word)
            if type(m) is float:
                values[index] = m
                continue
            values[index] = value = self.kernel.to_fraction(m, e)
            try:
                stored = self.round(value) == value
            except OverflowError:
                stored = False
            if not stored:
                where = at_entry(tuple(map(str, index)))
                raise ValueError(
                    f"{where}got bits {word:#x}, which are infinity, NaN or beyond the range; needed those of a number "
                    f"of {self}"
                )
        return self.array(values)
