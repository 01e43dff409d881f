"""Pass numbers from one format to another within one function."""

from __future__ import annotations

from typing import Any

from gpbnb.arithmetic.exits import lifted
from gpbnb.arithmetic.named import format_named


def convert(x: Any, fmt: Any) -> Any:
    """Round numbers of one format into another, also in a function whose precision is being searched.

    In a search, all numbers must stay in the format that the function is given, so that the answer is about this format
    alone. A function that also computes in a second format says so with this call wherever numbers pass from one to the
    other: a plant without rounding errors beside a rounded controller, or error feedback, which adds what the last
    rounding of a long sum lost to the next sum. Such a function runs operation by operation.

    Parameters
    ----------
    x : an array of any format and shape.
    fmt : the format of the result, in which each entry is rounded, or its name, such as "Q3.12".

    Raises
    ------
    TypeError : `x` is not an array of a format, or `fmt` is no format.
    ValueError : `fmt` is no name of a format.
    OverflowError : an entry is beyond the range of `fmt`.

    Examples
    --------
    A proportional controller in fixed point; the plant is not rounded, apart from its hundredth bit. If it were, the
    answer would be 13 bits:

    >>> from gpbnb import FloatFormat, convert, required_precision
    >>> exact = FloatFormat(2, 100)
    >>> def loop(fmt, target):
    ...     x, u = exact.array(0), []
    ...     for wanted in target:
    ...         u.append((wanted - convert(x, fmt)) * fmt.array("0.7"))
    ...         x = x + (convert(u[-1], exact) - x) * exact.array("0.1")
    ...     return u
    >>> print(str(required_precision(loop, [1] * 50, "1/1000", kind="fixed")).partition(":")[0])
    10 fraction bits in a word of 12 bits
    """
    if not hasattr(x, "backend"):
        raise TypeError(f"got a {type(x).__name__}; needed an array of a format; fmt.array(...) rounds other numbers")
    if x.backend.records:
        x.tape.refuse("it converts numbers to another format")
    into = format_named(fmt) if type(fmt) is str else fmt  # isinstance would ask a traced format for its class
    if not callable(getattr(into, "array", None)):
        raise TypeError(f'got the format {fmt!r}; needed a FloatFormat, a FixedFormat, or a name such as "Q3.12"')
    with lifted():
        return into.array(x.to_fractions())
