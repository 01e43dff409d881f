"""One step of a linear program in plain Python, with numbers of any type; nothing is taken from the package."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

OPERATIONS: dict[str, Callable[..., Any]] = {
    "MULTIPLY": lambda coefficients, values, a, b: coefficients[a] * values[b],
    "ADD": lambda coefficients, values, a, b: values[a] + values[b],
    "SUBTRACT": lambda coefficients, values, a, b: values[a] - values[b],
}


def steps_in_python(
    operations: Sequence[tuple[str, int, int]],
    outputs: Sequence[int],
    round_: Callable[[Any], Any],
    coefficients: Any,
    given: Sequence[Any],
) -> list[Any]:
    """Take one step from states and measurements: an operation has a name and two places, and is rounded."""
    values = [*given]
    for name, a, b in operations:
        values.append(round_(OPERATIONS[name](coefficients, values, a, b)))
    return [values[i] for i in outputs]
