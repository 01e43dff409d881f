"""The five exceptions of IEEE 754, counted while a run lasts."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass
from typing import Any

from gpbnb.arithmetic.rounding import Rules


@dataclass
class Flags:
    """How often each exception of IEEE 754 occurred; a result that raises two of them counts in both.

    Attributes
    ----------
    invalid : operations without a meaning, such as 0/0, infinity minus infinity, or the root of a negative number.
    divide_by_zero : exact infinite results of finite numbers, such as 1/0.
    overflow : results that, rounded as if the exponent had no upper limit, are beyond the largest number.
    underflow : inexact results below the smallest normal number. In base 10 the exact result counts, in other bases
        the result rounded as if the exponent had no lower limit.
    inexact : results that differ from the exact ones.
    """

    invalid: int = 0
    divide_by_zero: int = 0
    overflow: int = 0
    underflow: int = 0
    inexact: int = 0


_counted: ContextVar[tuple[tuple[Rules, Flags], ...]] = ContextVar("formats whose exceptions are counted", default=())


@contextmanager
def flags(fmt: Any) -> Iterator[Flags]:
    """Count the IEEE 754 exceptions of all operations in one format inside a ``with`` block; blocks may be nested.

    Conversions into the format are operations, too. Comparisons, and the maximum and minimum that use them, are not
    counted.

    Parameters
    ----------
    fmt : a format with ``overflow="infinity"``; other formats raise Python's exceptions, and their compiled loops
        count nothing.

    Raises
    ------
    ValueError : another format.

    Examples
    --------
    >>> from dataclasses import replace
    >>> from gpbnb import BINARY32, flags
    >>> fmt = replace(BINARY32, overflow="infinity")
    >>> with flags(fmt) as seen:
    ...     y = 1 / fmt.array([0, 3, 4])
    >>> y.to_float().tolist()
    [inf, 0.3333333432674408, 0.25]
    >>> seen
    Flags(invalid=0, divide_by_zero=1, overflow=0, underflow=0, inexact=1)
    """
    if getattr(fmt, "overflow", "") != "infinity":
        raise ValueError(
            f"got {fmt}, whose exceptions are not counted; needed a format with infinity or NaN: "
            'dataclasses.replace(fmt, overflow="infinity")'
        )
    seen = Flags()
    token = _counted.set((*_counted.get(), (fmt.rules, seen)))
    try:
        yield seen
    finally:
        _counted.reset(token)


@contextmanager
def uncounted() -> Iterator[None]:
    """Count nothing, for roundings that are tried before the one that gives the result."""
    token = _counted.set(())
    try:
        yield
    finally:
        _counted.reset(token)


def signal(rules: Rules, name: str) -> None:
    """Count one exception of an operation in a format."""
    for counted, seen in _counted.get():
        if counted == rules:
            setattr(seen, name, getattr(seen, name) + 1)
