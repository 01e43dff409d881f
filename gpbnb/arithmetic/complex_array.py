"""Complex numbers as pairs of emulated numbers, and the fast Fourier transform, in a stated order of operations."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import replace
from functools import lru_cache, partial
from typing import Any, cast

import numpy as np
from flint import arb, fmpq
from numpy.typing import NDArray

from gpbnb.arithmetic.array import FloatArray
from gpbnb.arithmetic.conversion import entries
from gpbnb.arithmetic.elementary import rounded_enclosure
from gpbnb.arithmetic.rounding import Rounding
from gpbnb.arithmetic.text import in_columns


class ComplexArray:
    r"""An immutable array of complex numbers :math:`a + \mathrm{i} b`, whose two parts are arrays of one format.

    Each operation below is rounded once. If a formula has several operations, the products are computed first and the
    quotient last.

    ===================  ==========================================================================
    result               real part, imaginary part
    ===================  ==========================================================================
    :math:`x \pm y`      :math:`a \pm c`, :math:`b \pm d`
    :math:`x y`          :math:`ac - bd`, :math:`ad + bc`
    :math:`x / y`        :math:`(ac + bd)/(cc + dd)`, :math:`(bc - ad)/(cc + dd)`
    :math:`|x|`          :math:`\sqrt{aa + bb}`, a :class:`~gpbnb.arithmetic.array.FloatArray`
    ===================  ==========================================================================

    A real operand, such as a FloatArray or a plain number, multiplies or divides both parts, but is added only to the
    real part.

    Parameters
    ----------
    real, imag : arrays of one format and one shape. An `imag` of None is zero.

    Raises
    ------
    TypeError : a part is not an array of a format.
    ValueError : parts of different formats or shapes.

    Examples
    --------
    >>> from gpbnb import BINARY32, ComplexArray
    >>> z = ComplexArray(BINARY32.array([3, 1]), BINARY32.array([4, -1]))
    >>> z
    ComplexArray(['3+4i', '1-1i'], FloatFormat(base=2, precision=24, rounding=Rounding.EVEN, emin=-126, emax=127))
    >>> (z * z[0]).to_complex(), float(abs(z[0]))
    (array([-7.+24.j,  7. +1.j]), 5.0)
    """

    __slots__ = ("imag", "real")
    __array_ufunc__ = None  # so that NumPy's arrays leave the operation to this class
    __hash__ = None  # type: ignore[assignment]

    #: The parts.
    real: FloatArray
    imag: FloatArray

    def __init__(self, real: FloatArray, imag: FloatArray | None = None) -> None:
        for name, part in (("real", real), ("imag", imag)):
            if not isinstance(part, FloatArray) and (name == "real" or part is not None):
                raise TypeError(f"{name}: got {type(part).__name__}; needed an array of a format; write fmt.array(...)")
        other = cast(FloatArray, np.zeros_like(cast(Any, real)) if imag is None else imag)
        if real.format != other.format or real.shape != other.shape:
            raise ValueError(
                f"got parts of shapes {real.shape} and {other.shape} in {real.format} and {other.format}; needed one "
                "shape and one format"
            )
        object.__setattr__(self, "real", real)
        object.__setattr__(self, "imag", other)

    @classmethod
    def of(cls, fmt: Any, values: Any) -> ComplexArray:
        """Round both parts of complex or real numbers into a format.

        Parameters
        ----------
        fmt : a FloatFormat or FixedFormat.
        values : one number, nested lists, or a NumPy array, complex or not.

        Raises
        ------
        TypeError, ValueError, OverflowError : as for ``fmt.array``.

        Examples
        --------
        >>> from gpbnb import ComplexArray, FloatFormat
        >>> ComplexArray.of(FloatFormat(10, 3), [1 / 3, 2j]).to_complex().tolist()
        [(0.333+0j), 2j]
        """
        if isinstance(values, ComplexArray):
            return cls(fmt.array(values.real), fmt.array(values.imag))
        if isinstance(values, np.ndarray) and values.dtype.kind == "c":
            return cls(fmt.array(values.real), fmt.array(values.imag))
        found = entries(values)
        parts = [np.empty(found.shape, dtype=object) for _ in range(2)]
        for index, value in np.ndenumerate(found):
            both = (value.real, value.imag) if isinstance(value, (complex, np.complexfloating)) else (value, 0)
            parts[0][index], parts[1][index] = both
        return cls(*(fmt.array(part[()]) if part.ndim else fmt.array(part.item()) for part in parts))

    def __setattr__(self, name: str, value: Any) -> None:
        raise AttributeError(
            f"got an assignment to {name} of a ComplexArray, which cannot be changed; make another one"
        )

    def __reduce__(self) -> tuple[Any, ...]:
        return type(self), (self.real, self.imag)

    # -- shape ---------------------------------------------------------------------------------

    @property
    def format(self) -> Any:
        """The format of both parts."""
        return self.real.format

    @property
    def shape(self) -> tuple[int, ...]:
        """Length of each axis."""
        return self.real.shape

    @property
    def ndim(self) -> int:
        """Number of axes; 0 for a single number."""
        return self.real.ndim

    @property
    def size(self) -> int:
        """Number of entries."""
        return self.real.size

    @property
    def T(self) -> ComplexArray:
        """The transpose, without conjugation."""
        return self._moved(lambda part: part.T)

    def reshape(self, *shape: Any) -> ComplexArray:
        """Return the same entries in another shape."""
        return self._moved(lambda part: part.reshape(*shape))

    def __len__(self) -> int:
        return len(self.real)

    def __getitem__(self, index: Any) -> ComplexArray:
        return self._moved(lambda part: part[index])

    def __iter__(self) -> Iterator[ComplexArray]:
        return (self[i] for i in range(len(self)))

    def _moved(self, move: Callable[[Any], Any]) -> ComplexArray:
        return type(self)(move(self.real), move(self.imag))

    # -- arithmetic ----------------------------------------------------------------------------

    def _operand(self, other: Any) -> ComplexArray | FloatArray:
        """Return a complex operand, or a real one, as numbers that are exact in the format."""
        if isinstance(other, (ComplexArray, FloatArray)):
            return other
        if (
            isinstance(other, (complex, np.complexfloating))
            or getattr(getattr(other, "dtype", None), "kind", "") == "c"
        ):
            parts = np.asarray(other)
            return ComplexArray(self.real.operand(parts.real), self.real.operand(parts.imag))
        return self.real.operand(other)

    def __add__(self, other: Any) -> ComplexArray:
        y = self._operand(other)
        if isinstance(y, ComplexArray):
            return ComplexArray(self.real + y.real, self.imag + y.imag)
        return self._with_real(self.real + y)

    def __radd__(self, other: Any) -> ComplexArray:
        return self + other

    def __sub__(self, other: Any) -> ComplexArray:
        y = self._operand(other)
        if isinstance(y, ComplexArray):
            return ComplexArray(self.real - y.real, self.imag - y.imag)
        return self._with_real(self.real - y)

    def __rsub__(self, other: Any) -> ComplexArray:
        y = self._operand(other)
        return y - self if isinstance(y, ComplexArray) else (-self)._with_real(y - self.real)

    def __mul__(self, other: Any) -> ComplexArray:
        y = self._operand(other)
        if isinstance(y, FloatArray):
            return ComplexArray(self.real * y, self.imag * y)
        a, b, c, d = self.real, self.imag, y.real, y.imag
        return ComplexArray(a * c - b * d, a * d + b * c)

    def __rmul__(self, other: Any) -> ComplexArray:
        y = self._operand(other)
        return y * self if isinstance(y, ComplexArray) else self * y

    def __truediv__(self, other: Any) -> ComplexArray:
        y = self._operand(other)
        if isinstance(y, FloatArray):
            return ComplexArray(self.real / y, self.imag / y)
        a, b, c, d = self.real, self.imag, y.real, y.imag
        square = c * c + d * d
        return ComplexArray((a * c + b * d) / square, (b * c - a * d) / square)

    def __rtruediv__(self, other: Any) -> ComplexArray:
        y = self._operand(other)
        return (y if isinstance(y, ComplexArray) else ComplexArray(y)) / self

    def __neg__(self) -> ComplexArray:
        return ComplexArray(-self.real, -self.imag)

    def __abs__(self) -> FloatArray:
        return (self.real * self.real + self.imag * self.imag).sqrt()

    def conj(self) -> ComplexArray:
        """Return the conjugate of each entry; nothing is rounded."""
        return ComplexArray(self.real, -self.imag)

    def __eq__(self, other: object) -> Any:
        y = self._operand(other)
        if isinstance(y, ComplexArray):
            return (self.real == y.real) & (self.imag == y.imag)
        return (self.real == y) & (self.imag == 0)

    def __ne__(self, other: object) -> Any:
        return ~np.asarray(self == other, dtype=bool)

    def _with_real(self, real: FloatArray) -> ComplexArray:
        return ComplexArray(real, cast(FloatArray, np.broadcast_to(cast(Any, self.imag), real.shape)))

    # -- conversion ----------------------------------------------------------------------------

    def to_complex(self) -> Any:
        """Return the nearest complex128 of each entry, as an array, or as a complex for a single number.

        Raises
        ------
        OverflowError : as for ``to_float``.
        """
        found = np.empty(self.shape, dtype=np.complex128)
        found.real, found.imag = self.real.to_float(), self.imag.to_float()
        return found[()]

    def __repr__(self) -> str:
        real, imag = self.real.reshape(-1), self.imag.reshape(-1)

        def text(i: int) -> str:
            second = str(imag[i])
            return f"'{real[i]}{'' if second.startswith('-') else '+'}{second}i'"

        start = "ComplexArray("
        return f"{start}{in_columns(text, self.shape, ', ', start)}, {self.format})"


def fft(x: ComplexArray | FloatArray, inverse: bool = False) -> ComplexArray:
    r"""Fourier transform along the last axis, by Cooley and Tukey's radix 2 with decimation in time.

    .. math:: X_k = \sum_{j=0}^{n-1} x_j\, w^{jk}, \qquad w = \mathrm{e}^{-2\pi\mathrm{i}/n}

    A transform of length 2h combines two of length h: E, that of the entries with even indices, and O, that of the
    entries with odd indices. For k from 0 to h - 1, with correctly rounded real and imaginary parts of the factor,

    .. math:: t = O_k\, \mathrm{e}^{-\pi\mathrm{i}k/h}, \qquad X_k = E_k + t, \qquad X_{k+h} = E_k - t

    The factor for k = 0 is 1, so that product is omitted; all other factors multiply as complex numbers. A transform
    of n numbers takes :math:`\log_2 n` such stages. With stochastic rounding, factors are rounded to nearest.

    Parameters
    ----------
    x : (..., n), n a power of two; a real array has imaginary parts of zero.
    inverse : whether to compute the inverse transform: w is conjugated, and each result divided by n.

    Returns
    -------
    (..., n), in the usual order.

    Raises
    ------
    TypeError : `x` is not an array of a format.
    ValueError : n is not a power of two. Either append zeros, which gives another transform, or write out the sum
        above.
    OverflowError : a number leaves the range of the format. In fixed point, numbers grow by up to
        :math:`1 + \sqrt 2` in a stage; scale them before the call, or use more integer bits. A format that cannot store
        1, such as Q15, cannot store the factor i of the inverse transform either.

    References
    ----------
    Cooley & Tukey 1965; Van Loan 1992, Computational Frameworks for the Fast Fourier Transform, algorithm 1.6.1.

    Examples
    --------
    >>> from gpbnb import BINARY32, fft
    >>> fft(BINARY32.array([1, 2, 3, 4])).to_complex()
    array([10.+0.j, -2.+2.j, -2.+0.j, -2.-2.j])

    How many bits a transform of 64 numbers needs for an error of 0.001:

    >>> import numpy as np
    >>> from gpbnb import required_precision
    >>> def spectrum(fmt, z):
    ...     found = fft(z)
    ...     return np.stack([found.real, found.imag], axis=1)
    >>> signal = np.sin(np.arange(64) ** 2)
    >>> required_precision(spectrum, 64, 0.001, z=signal).precision
    15
    """
    given = ComplexArray(x) if isinstance(x, FloatArray) else x
    if not isinstance(given, ComplexArray):
        raise TypeError(f"x: got {type(x).__name__}; needed a ComplexArray or a FloatArray; write fmt.array(x)")
    n = given.shape[-1] if given.ndim else 0
    if n < 1 or n & (n - 1):
        raise ValueError(
            f"x: got shape {given.shape}; needed a power of two along the last axis; append zeros, or write out the sum"
        )
    stack = given.shape[:-1]
    parts = given.reshape((*stack, n, 1))[..., _reversed_bits(n), :]  # transforms of one number each
    while parts.shape[-1] < n:
        half = parts.shape[-1]
        even, odd = parts[..., ::2, :], parts[..., 1::2, :]
        if half > 1:
            odd = _joined(odd[..., :1], odd[..., 1:] * _factors(given.format, half, inverse))
        parts = _joined(even + odd, even - odd)
    found = parts.reshape((*stack, n))
    return found / given.format.array(n) if inverse and n > 1 else found


def _joined(a: ComplexArray, b: ComplexArray) -> ComplexArray:
    """Join two arrays along their last axis."""
    return ComplexArray(
        *(cast(FloatArray, np.concatenate(cast(Any, pair), axis=-1)) for pair in ((a.real, b.real), (a.imag, b.imag)))
    )


def _reversed_bits(n: int) -> Any:
    """Return the numbers from 0 to n - 1, each with its bits reversed."""
    found = np.zeros(1, dtype=np.intp)
    while len(found) < n:
        found = np.concatenate([2 * found, 2 * found + 1])
    return found


def _factors(fmt: Any, half: int, inverse: bool) -> ComplexArray:
    """Return the correctly rounded factors for k from 1 to half - 1."""
    found = ComplexArray(*(FloatArray.from_pairs(part[0], part[1], fmt) for part in _rounded_factors(fmt, half)))
    return found.conj() if inverse else found


@lru_cache(maxsize=64)
def _rounded_factors(fmt: Any, half: int) -> tuple[NDArray[Any], NDArray[Any]]:
    """Return significands and exponents, each (2, half - 1), of the real and the imaginary parts."""
    if fmt.rounding is Rounding.STOCHASTIC:
        fmt = replace(fmt, rounding=Rounding.EVEN)  # constants are no results of a run

    def rounded(enclosures: Iterable[Callable[[], Any]]) -> NDArray[Any]:
        what = "a factor of the Fourier transform"
        pairs = [rounded_enclosure(each, fmt, lambda: what) for each in enclosures]
        return np.array(pairs, dtype=object).reshape(-1, 2).T

    angles = [fmpq(k, half) for k in range(1, half)]
    return (
        rounded(partial(arb.cos_pi_fmpq, angle) for angle in angles),
        rounded(partial(arb.sin_pi_fmpq, -angle) for angle in angles),
    )
