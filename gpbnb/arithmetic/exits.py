"""Keep the numbers of a function in one format while its precision is searched.

A function answers "how many digits do I need?" only if it computes every step in the format that it is given. NumPy,
SciPy and ``math`` convert arrays of a format to float64 on their own, and then compute in 53 bits, whatever the format.
:func:`kept_in` therefore refuses every conversion of an array to other numbers, to text, or to another format while the
function runs. Comparisons are allowed: their results are truth values.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import replace
from functools import wraps
from typing import Any, NamedTuple, ParamSpec, TypeVar

P = ParamSpec("P")
Result = TypeVar("Result")


_STEPS = (
    "write the steps with + - * / @, comparisons, and NumPy's functions for arrays of a format, collect results in a "
    "list, and join them with np.stack"
)
INSTEAD = {
    "a NumPy array": f"write fmt.array([a, b]) in place of np.array([a, b]), and {_STEPS}",
    "astype()": _STEPS,
    "to_float()": _STEPS,
    "to_fractions()": _STEPS,
    "to_pairs()": _STEPS,
    "to_bits()": _STEPS,
    "tolist()": "write x[i] for an entry, which stays in the format",
    "item()": "write x[i] for an entry, which stays in the format",
    "float()": "write np.sqrt(x), np.exp(x) and so on instead of functions of math, compare x itself, and collect "
    "results in a list",
    "int()": "choose by comparisons, np.where, np.argmax or np.argsort",
    "an index": "choose by comparisons, np.where, np.argmax or np.argsort",
    "round()": "round into the format with its own operations",
    "text": "compute with x itself",
    "pickle": "compute in one process",
}
"""What to write instead of each exit."""


class _Run(NamedTuple):
    """A run of a function: its format, and the objects to show when it has ended."""

    fmt: Any
    peeked: list[tuple[Callable[[Any], Any], Any]]


class _State(NamedTuple):
    """The run of this thread, if any; the format to which conversion is allowed; or whether all exits are open."""

    run: _Run | None = None
    into: Any = None
    lifted: bool = False


_state: ContextVar[_State] = ContextVar("the run of a function in one format", default=_State())  # noqa: B039
# Threads that a function starts have a context of their own, but their arrays have the format object of the run.
_running: dict[int, _Run] = {}


@contextmanager
def kept_in(fmt: Any) -> Iterator[Any]:
    """Refuse to convert numbers while a function runs; yield a format equal to `fmt`, for this run only.

    Runs may be nested, and other threads are not affected.
    """
    outer = _state.get()
    if outer.run is not None and outer.run.fmt is fmt:  # as of a function that calls another one
        yield fmt
        return
    own = replace(fmt)
    run = _Run(own, [])
    token = _state.set(_State(run))
    _running[id(own)] = run
    try:
        yield own
    finally:
        _state.reset(token)
        del _running[id(own)]
        if outer.run is not None:
            outer.run.peeked.extend(run.peeked)
        else:
            for see, what in run.peeked:
                see(what)


@contextmanager
def unseen(fmt: Any) -> Iterator[list[Any]]:
    """Refuse all conversions, and show nothing; yield a list of what the function wanted to show."""
    shown: list[Any] = []
    token = _state.set(_State(_Run(fmt, shown)))
    try:
        yield shown
    finally:
        _state.reset(token)


@contextmanager
def entering(fmt: Any) -> Iterator[None]:
    """Allow arrays of `fmt`, and no others, to be read into `fmt`."""
    token = _state.set(_state.get()._replace(into=fmt))
    try:
        yield
    finally:
        _state.reset(token)


@contextmanager
def lifted() -> Iterator[None]:
    """Allow all conversions, for code whose results are numbers of the format, truth values or indices."""
    token = _state.set(_state.get()._replace(lifted=True))
    try:
        yield
    finally:
        _state.reset(token)


def stays(function: Callable[P, Result]) -> Callable[P, Result]:
    """Mark a function whose results are numbers of the format, truth values or indices; it may convert numbers."""

    @wraps(function)
    def within(*args: P.args, **kwargs: P.kwargs) -> Result:
        with lifted():
            return function(*args, **kwargs)

    return within


def check_exit(x: Any, exit: str) -> None:
    """Refuse to convert the array `x` while the precision of a function is searched."""
    fmt, state = x.format, _state.get()
    run = state.run or _running.get(id(fmt))
    if run is None or state.lifted or state.into == fmt:
        return
    if state.into is not None:
        raise TypeError(
            f"got a conversion from {fmt} to {state.into} in a function whose precision is searched; needed all "
            f"numbers in {run.fmt}; make constants with fmt.array(...), of the format that the function is given, and "
            "for sums with more digits use linalg.matmul(..., sums=...)"
        )
    raise TypeError(
        f"got {exit} of a {type(x).__name__} in a function whose precision is searched; needed all numbers in "
        f"{run.fmt}, or the answer would be that of other arithmetic; {INSTEAD[exit]}; to look at x, write "
        "gpbnb.peek(x, print)"
    )


def peek(what: Any, see: Callable[[Any], Any]) -> None:
    """Show intermediate values of a function whose precision is being searched, without changing its results.

    While the function runs, its values cannot be converted or printed. ``peek(x, see)`` calls ``see(x)`` as soon as the
    run has ended, with no restrictions. Outside a search, ``see(x)`` is called at once.

    Parameters
    ----------
    what : an array, or any other object, such as a tuple of arrays.
    see : a function of one argument, such as ``print`` or the ``append`` of a list. The searched function runs once in
        each precision, so a list collects the values of all these runs.

    Examples
    --------
    >>> from gpbnb import FloatFormat, peek, required_precision
    >>> def halved(fmt, z):
    ...     peek(z[0] / 3, lambda x: seen.append((x.format.precision, float(x.to_float()))))
    ...     return z / 2
    >>> seen: list[tuple[int, float]] = []
    >>> required_precision(halved, [1, 2, 3], 0.01).digits
    2
    >>> min(seen)
    (2, 0.375)
    """
    run = _state.get().run or _running.get(id(getattr(what, "format", None)))
    if run is None:
        see(what)
    else:
        run.peeked.append((see, what))
