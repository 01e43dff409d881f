"""Read arguments as users write them: whole numbers and names; name the argument in an error."""

from __future__ import annotations

import operator
import re
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from fractions import Fraction
from typing import Any

from gpbnb.arithmetic.kernels.exact import size_text


def whole_number(name: str, value: Any, least: int = 1, most: int | None = None) -> int:
    """Return a whole number from `least` to `most`; True and False are not numbers."""
    if not isinstance(value, bool):
        try:
            number = operator.index(value)
        except TypeError:
            pass
        else:
            if number >= least and (most is None or number <= most):
                return number
    limit = "" if most is None else f" and at most {most:,}"
    raise ValueError(f"got {name} {value!r}; needed a whole number, at least {least}{limit}")


@contextmanager
def naming(argument: str) -> Iterator[None]:
    """Put the name of an argument before the message of an error in reading or storing it."""
    try:
        yield
    except (TypeError, ValueError, OverflowError) as error:
        raise type(error)(f"{argument}: {error}") from None


def checked_name(name: Any) -> str:
    """Check that the name of a model is text, and return it."""
    if isinstance(name, str):
        return name
    raise TypeError(f"got name {name!r} of type {type(name).__name__}; needed text")


def checked_names(what: str, given: Any, count: int) -> tuple[str, ...]:
    """Check the names of the states, measurements, inputs or outputs of a model, and return them as a tuple.

    A name may end with a unit, as in "rate (°/s)".
    """
    if given is None:
        return ()
    names = tuple(given) if isinstance(given, (list, tuple)) else (given,)
    if not all(isinstance(name, str) for name in names):
        raise TypeError(f"got {what} {given!r}; needed a list of {count} names")
    if not names:
        return ()
    if len(names) != count:
        raise ValueError(f"got {len(names)} {what}, {', '.join(map(repr, names))}; needed {count} names")
    if not all(name.strip() for name in names) or len(set(names)) < count:
        raise ValueError(f"got {what} {', '.join(map(repr, names))}; needed {count} different names that are not empty")
    return names


def named(kind: str, i: int, names: tuple[str, ...]) -> str:
    """Name one of several states, measurements, inputs or outputs in a message: its name without unit, or its index.

    Examples
    --------
    >>> named("state", 1, ("tilt (°)", "rate (°/s)")), named("state", 1, ())
    ('state "rate"', 'state 1')
    """
    return f'{kind} "{_UNIT.sub("", names[i])}"' if names else f"{kind} {i}"


_UNIT = re.compile(r"\s*(\([^()]*\)|\[[^][]*\])\s*$")


def sized(count: int, kind: str, names: tuple[str, ...]) -> str:
    """Count states, measurements, inputs or outputs, and list their names.

    Examples
    --------
    >>> sized(2, "state", ("tilt (°)", "rate (°/s)")), sized(1, "input", ())
    ('2 states: tilt (°), rate (°/s)', '1 input')
    """
    return f"{count} {kind}{'s' * (count != 1)}{': ' * bool(names)}{', '.join(names)}"


def range_text(numbers: Iterable[Fraction]) -> str:
    """Describe the sizes of the numbers that are not zero.

    Examples
    --------
    >>> from fractions import Fraction
    >>> range_text([Fraction(0), Fraction(-1, 4), Fraction(3)])
    '0.25 … 3'
    """
    sizes = {abs(number) for number in numbers if number}
    if not sizes:
        return "0"
    low, high = size_text(min(sizes)), size_text(max(sizes))
    return low if low == high else f"{low} … {high}"
