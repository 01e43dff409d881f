"""The search for the smallest precision that suffices."""

from __future__ import annotations

from bisect import bisect_left
from collections.abc import Callable
from functools import cache

from gpbnb.arithmetic.formats import FloatFormat, Rounding


def smallest_precision(
    meets: Callable[[FloatFormat], bool],
    base: int = 2,
    rounding: Rounding = Rounding.NEAREST,
    least: int = 1,
    largest: int | None = None,
    monotone: bool = False,
) -> FloatFormat | None:
    """Find the smallest precision with which a computation meets a requirement.

    Rounding errors do not shrink monotonically with the precision, so a precision qualifies only if the next higher one
    also meets the requirement. The search is a bisection: it assumes that all precisions above a qualifying one meet
    the requirement. Whether or not they do, the answer and the next higher precision were tried and meet it, and the
    next lower one was tried and does not qualify.

    Parameters
    ----------
    meets : whether a format meets the requirement; called at most once per format.
    base, rounding : of the formats.
    least, largest : range of the precisions. Without `largest`, the range doubles until a precision meets the
        requirement; use this only if some precision does.
    monotone : every precision above one that meets the requirement meets it too, as for a bound proportional to the
        unit roundoff; the next higher precision is then not tried.

    Returns
    -------
    fmt : the format, or None if no precision up to `largest` meets the requirement.

    Raises
    ------
    ValueError : `largest` is below `least`.

    Examples
    --------
    >>> from gpbnb.arithmetic.formats import FloatFormat
    >>> smallest_precision(lambda fmt: fmt.unit_roundoff < 1e-7).precision
    24
    """

    @cache
    def suffices(precision: int) -> bool:
        return meets(FloatFormat(base, precision, rounding))

    if largest is None:
        largest = least
        while not suffices(largest):
            largest *= 2
    if largest < least:
        raise ValueError(f"got precisions from {least} to {largest}; needed the largest to be at least the least")
    answer = least + bisect_left(range(least, largest), True, key=suffices)
    while answer < largest and not (suffices(answer) and (monotone or suffices(answer + 1))):
        answer += 1
    return FloatFormat(base, answer, rounding) if suffices(answer) else None
