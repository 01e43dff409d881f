"""Reading numbers of any type without rounding them."""

from __future__ import annotations

import re
import reprlib
from collections.abc import Iterator, Mapping, Sequence, Set
from decimal import Decimal
from fractions import Fraction
from numbers import Rational
from typing import Any, Protocol, TypeAlias

import numpy as np
from numpy.typing import NDArray

from gpbnb.arithmetic.kernels.exact import LARGEST_BITS, integer_text


class Ratio(Protocol):
    """A number that converts exactly: a float, Decimal or Fraction, or one of NumPy or gmpy2."""

    def as_integer_ratio(self) -> tuple[Any, Any]:
        """Return numerator and denominator."""


class AnyArray(Protocol):
    """An array of NumPy, of a format, or of another library."""

    def __array__(self) -> NDArray[Any]: ...


Number: TypeAlias = str | int | np.integer | Ratio
"""One number, as the package reads it."""

Numbers: TypeAlias = "Number | AnyArray | Sequence[Numbers]"
"""Numbers of any shape, from one number to an array or nested lists."""

MaybeNone: TypeAlias = Any
"""None, in the type of a value that is None only where there is no answer; type checkers ask for no test of it."""

LARGEST_TEXT = 100_000
"""Largest number of characters of a number that is read, and largest power of ten of a Fraction."""

_SHOWN = reprlib.Repr()
_SHOWN.maxstring = 60
_DECIMAL = re.compile(r"\s*([+-]?)(\d+(?:\.\d*)?|\.\d+)(?:[eE]([+-]?\d+))?\s*", re.ASCII)
_NOT_FINITE = re.compile(r"\s*[+-]?(nan|inf|infinity)\s*", re.IGNORECASE)
_RATIO = re.compile(r"\s*([+-]?\d+)\s*/\s*(\d+)\s*", re.ASCII)
_ACCEPTED = "a str, int, float, Decimal or Fraction"


def exact_ratio(value: Any) -> tuple[int, int, int]:
    """Read a number without rounding it, as integers p, q > 0 and k: ``p / q * 10**k``."""
    if type(value) is Fraction:  # the commonest, and its class is slow to ask
        return value.numerator, value.denominator, 0
    if type(value) is int:
        return value, 1, 0
    if (pair := _of_mpmath_or_flint(value)) is not None:
        return pair
    if isinstance(value, str):
        return _read(value)
    if isinstance(value, (bool, np.bool_)):
        raise TypeError(f"got the truth value {value!r}; needed {_ACCEPTED}; write 1 or 0")
    if isinstance(value, np.timedelta64):  # a subclass of np.integer, but with a unit
        raise TypeError(f"got {value!r} of type timedelta64; needed {_ACCEPTED}")
    if isinstance(value, (int, np.integer)):
        return int(value), 1, 0
    if isinstance(value, Rational):
        return int(value.numerator), int(value.denominator), 0
    if isinstance(value, Decimal):
        sign, digits, exponent = value.as_tuple()
        if not isinstance(exponent, int):
            raise ValueError(_not_finite(value))
        _check_length(len(digits))
        p = int(Decimal((0, digits, 0)))
        return (-p if sign else p), 1, exponent
    # floats of Python, NumPy, gmpy2 and sympy, and everything else that converts exactly
    if hasattr(value, "as_integer_ratio"):
        try:
            p, q = value.as_integer_ratio()
        except (ValueError, OverflowError):
            raise ValueError(_not_finite(value)) from None
        return int(p), int(q), 0
    raise TypeError(f"got {value!r} of type {type(value).__name__}; needed {_ACCEPTED}")


def _of_mpmath_or_flint(value: Any) -> tuple[int, int, int] | None:
    """Read a number of mpmath (``man_exp``) or python-flint (``man_exp()``, ``p`` and ``q``); None for other types."""
    home = type(value).__module__.partition(".")[0]
    if home not in ("mpmath", "flint"):
        return None
    if home == "flint" and hasattr(value, "p") and hasattr(value, "q"):
        return int(value.p), int(value.q), 0
    if home == "flint" and type(value).__name__ == "fmpz":
        return int(value), 1, 0
    if not hasattr(value, "man_exp"):
        return None
    if home == "flint" and not (value.is_finite() and value.is_exact()):
        raise ValueError(f"got {value}; needed one finite number; take its midpoint: x.mid()")
    if home == "mpmath" and value.man_exp[0] == 0 and not value == 0:
        raise ValueError(_not_finite(value))
    significand, exponent = value.man_exp if home == "mpmath" else value.man_exp()
    if home == "mpmath" and value < 0 < significand:
        significand = -significand
    significand, exponent = int(significand), int(exponent)
    if abs(exponent) > LARGEST_BITS:
        raise ValueError(f"got a number of about 2**{exponent}; needed an exponent of at most {LARGEST_BITS} in size")
    return (significand << exponent, 1, 0) if exponent >= 0 else (significand, 1 << -exponent, 0)


def exact_fraction(value: Any) -> Fraction:
    """Read a number without rounding it, as a Fraction."""
    p, q, power = exact_ratio(value)
    if not p or not power:
        return Fraction(p, q)
    if abs(power) > LARGEST_TEXT:
        raise ValueError(
            f"got a number with the power of ten {shown(integer_text(power))[1:-1]}; needed a power of at most "
            f"{LARGEST_TEXT} in size, or the exact number is too long to compute with; scale it"
        )
    return Fraction(p, q) * Fraction(10) ** power


def shown(text: str) -> str:
    """Return a text in quotation marks for a message, without its middle if it is long."""
    return _SHOWN.repr(text)


def _check_length(count: int) -> None:
    if count > LARGEST_TEXT:
        raise ValueError(
            f"got a number of {count} characters; needed at most {LARGEST_TEXT}, or reading it takes minutes; round it"
        )


def _read(text: str) -> tuple[int, int, int]:
    _check_length(len(text))
    if match := _DECIMAL.fullmatch(text):
        sign, digits, exponent = match.groups()
        whole, _, places = digits.partition(".")
        p = _integer(whole + places)
        return (-p if sign == "-" else p), 1, _integer(exponent or "0") - len(places)
    if match := _RATIO.fullmatch(text):
        p, q = _integer(match[1]), _integer(match[2])
        if q == 0:
            raise ValueError(f"got {shown(text)}; needed a denominator other than zero; correct it")
        return p, q, 0
    if _NOT_FINITE.fullmatch(text):
        raise ValueError(_not_finite(repr(text)))
    raise ValueError(
        f"got {shown(text)}; needed a number such as '765.4567', '1e-3' or '1/3', "
        "with a point as decimal mark and no separators"
    )


def _integer(digits: str) -> int:
    """Read an integer of any length; ``int`` refuses more than 4300 digits."""
    return int(Decimal(digits))


def _not_finite(value: object) -> str:
    return f"got {value}; needed a finite number; remove or replace the entry"


def entries(values: Any) -> NDArray[Any]:
    """Return an object array of the numbers in `values`, a container of any type."""
    if isinstance(values, np.ma.MaskedArray):
        raise TypeError("got a masked array; needed an array without masked entries; fill them first: a.filled(...)")
    if hasattr(values, "to_fractions"):  # an array of a format
        return single(values.to_fractions()) if not values.ndim else np.asarray(values.to_fractions(), dtype=object)
    if isinstance(values, (str, bytes, bytearray, np.generic)):
        return single(values)
    if hasattr(values, "__array__"):
        if type(values).__module__.partition(".")[0] == "pandas":  # whose arrays would make whole numbers float64
            values = values.to_numpy(dtype=object)
        values = np.asarray(values)
        if values.dtype.kind not in "iufUTO":
            raise TypeError(
                f"got an array of dtype {values.dtype}; needed integers, floats, strings, or "
                "objects that are numbers; convert it: a.astype(float)"
            )
        return values.astype(object)
    if isinstance(values, Sequence):
        components = [entries(value) for value in values]
        shapes = {part.shape for part in components}
        if len(shapes) > 1:
            raise ValueError(
                f"got nested lists with parts of shapes {', '.join(map(str, sorted(shapes)))}; needed "
                "parts of equal shape; pad or shorten the lists"
            )
        array = np.empty((len(components), *(shapes.pop() if components else ())), object)
        for i, part in enumerate(components):
            array[i] = part[()]  # for a single number, the number itself, not an array of it
        return array
    if isinstance(values, (Set, Mapping, Iterator)):
        raise TypeError(
            f"got a {type(values).__name__}; needed a number, list or array; make it a list first: list(...)"
        )
    return single(values)


def single(value: Any) -> NDArray[Any]:
    """Return an object array without axes that holds `value`, an object of any type."""
    array = np.empty(1, object)
    array[0] = value
    return array.reshape(())
