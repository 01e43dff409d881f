"""Read numbers from text files: ASCII digits only, without the underscores and non-ASCII digits that Python accepts."""

from __future__ import annotations

import re

from gpbnb.arithmetic.conversion import shown

_INTEGER = re.compile(r"[+-]?[0-9]+")
_NUMBER = re.compile(r"[+-]?([0-9]+(?:\.[0-9]*)?|\.[0-9]+)([eE][+-]?[0-9]+)?|[+-]?inf|nan", re.ASCII)


def plain_integer(text: str) -> int:
    """Read a whole number in ASCII digits.

    Examples
    --------
    >>> plain_integer("-12")
    -12
    """
    if not _INTEGER.fullmatch(text):
        raise ValueError(f"got {shown(text)}; needed a whole number such as 12, in the digits 0 to 9")
    return int(text)


def plain_number(text: str) -> float:
    """Read a decimal number in ASCII digits, ``inf`` or ``nan``; reject a finite number that overflows float64.

    Examples
    --------
    >>> plain_number("1.5e-3")
    0.0015
    """
    if not _NUMBER.fullmatch(text):
        raise ValueError(f"got {shown(text)}; needed a number such as -1.5 or 2e-3, in the digits 0 to 9")
    value = float(text)
    if abs(value) == float("inf") and "inf" not in text:
        raise ValueError(f"got {shown(text)}; needed a number that float64 holds, below 1.8e308")
    return value
