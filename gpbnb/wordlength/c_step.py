"""A step as its C code has it: operations and function calls in order, and what ends a step."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from gpbnb.arithmetic.machine import CODES, NAMES, operands_of
from gpbnb.filters.program import Program

WHOLE = ("floor", "ceil", "trunc", "rint")
"""Functions that return a whole number."""

_EXACT = ("fmod", "remainder", *WHOLE)
"""Functions that C has with the digits of the emulation."""

LIBRARY = dict.fromkeys(("arctan2", "hypot", "float_power"), 2) | dict.fromkeys(
    (
        "exp", "expm1", "exp2", "log", "log1p", "log2", "log10", "cbrt", "sin", "cos", "tan", "arcsin", "arccos",
        "arctan", "sinh", "cosh", "tanh", "arcsinh", "arccosh", "arctanh",
    ),
    1,
)  # fmt: skip
"""Functions that C's library has, with other last digits than the emulation, and how many numbers they take."""

DIVISIONS = {"nonzero": 0, "divide": 1, "fmod": 1, "remainder": 1}
"""Operations with a divisor, and which operand it is."""

DIVISOR, RADICAND = "== 0", "< 0"
"""What ends a step, as a condition on a number: a divisor, or the argument of a square root."""


class Operation(NamedTuple):
    """An operation of a step.

    Parameters
    ----------
    name : as the machine or NumPy names it; "if" and "end" are around those that run only if a truth value holds.
    given : places that it takes.
    out : the place of its result.
    depth : number of conditions around it.
    """

    name: str
    given: tuple[int, ...]
    out: int
    depth: int

    @property
    def gives_truth(self) -> bool:
        """Whether its result is a truth value."""
        return self.name in ("compare", "combine")

    @property
    def gives_number(self) -> bool:
        """Whether its result is a number."""
        return not self.gives_truth and self.name not in ("nonzero", "if", "end")

    @property
    def takes(self) -> tuple[Sequence[int], Sequence[int]]:
        """The numbers and the truth values that it takes."""
        code = CODES.get({"if": "skip"}.get(self.name, self.name))
        return (self.given, ()) if code is None else operands_of(code, *self.given)


@dataclass(frozen=True, eq=False)
class CodeStep:
    """A step as it is written in C.

    Parameters
    ----------
    program : its operations.
    coefficients : (p, c), exact stored coefficients of each step of a cycle.
    start : (n - p outputs,), exact first states, as stored.
    """

    program: Program
    coefficients: NDArray[Any]
    start: NDArray[Any]

    @cached_property
    def operations(self) -> list[Operation]:
        """The operations and function calls of the step, in order."""
        program, found, ends = self.program, list[Operation](), list[int]()
        calls = list(program.calls)
        for o, (code, *given, out) in enumerate([*program.rows.tolist(), [-1, 0]]):
            while ends and ends[-1] == o:
                ends.pop()
                found.append(Operation("end", (), 0, len(ends)))
            while calls and calls[0].at == o:
                call = calls.pop(0)
                for *taken, result in zip(*(each.tolist() for each in (*call.operands, call.results)), strict=True):
                    found.append(Operation(call.name, tuple(taken), result, len(ends)))
            if code < 0:
                break
            name = {"skip": "if"}.get(NAMES[code], NAMES[code])
            found.append(Operation(name, tuple(given), out, len(ends)))
            if name == "if":
                ends.append(o + 1 + given[1])
        return found

    @property
    def state_names(self) -> tuple[str, ...]:
        """Names of the states that are kept from step to step."""
        names, stored = self.program.state_names, self.program.n - self.program.p
        return names[:stored] if names else tuple(f"x[{i}]" for i in range(stored))

    @cached_property
    def coefficient_names(self) -> list[str]:
        """Names of the coefficients in C; an entry of a matrix has its indices after underscores."""
        names = self.program.coefficient_names or [f"c{i}" for i in range(len(self.program.coefficients))]
        return ["_".join(re.findall(r"\w+", name)) for name in names]

    @cached_property
    def coefficient_at(self) -> dict[int, int]:
        """The number of the coefficient at each of their places."""
        return {place: i for i, place in enumerate(self.program.coefficients.tolist())}

    @cached_property
    def changing(self) -> set[int]:
        """Numbers of the coefficients that differ from one step of a cycle to another."""
        return {*np.flatnonzero((self.coefficients != self.coefficients[0]).any(axis=0)).tolist()}

    @cached_property
    def variables(self) -> dict[int, str]:
        """Names of the other places: states, inputs, results."""
        results = [each.out for each in self.operations if each.gives_number]
        places = [*self.program.states.tolist(), *self.program.inputs.tolist(), *results]
        return {place: f"r{i}" for i, place in enumerate(places)}

    @cached_property
    def used(self) -> set[int]:
        """Places of the numbers that are used."""
        return {*(place for each in self.operations for place in each.takes[0]), *self.program.after.tolist()}

    @cached_property
    def truths_used(self) -> set[int]:
        """Places of the truth values that are used."""
        return {*(place for each in self.operations for place in each.takes[1]), self.program.definite}

    @cached_property
    def stops(self) -> list[tuple[int, str]]:
        """Places of numbers, each with the condition that ends the step; a test guards operations inside an "if"."""
        found = list[tuple[int, str]]()
        for each in self.operations:
            if each.depth:
                continue
            if each.name == "sqrt":
                found.append((each.given[0], RADICAND))
            elif each.name in DIVISIONS:
                divisor = each.given[DIVISIONS[each.name]]
                i = self.coefficient_at.get(divisor)
                if i is None or (self.coefficients[:, i] == 0).any():
                    found.append((divisor, DIVISOR))
        return list(dict.fromkeys(found))

    @property
    def is_exact(self) -> bool:
        """Whether it calls no function whose digits C's library does not guarantee."""
        return not any(each.name in LIBRARY for each in self.operations)

    @property
    def may_be_indefinite(self) -> bool:
        """Whether the step notes a covariance that is not definite."""
        return self.program.definite != 1

    def refuse_functions(self, exact: bool) -> None:
        """Refuse functions that C lacks or, if digits must be exact, whose digits its library does not guarantee."""
        for each in self.operations:
            inexact = each.name in LIBRARY
            if each.name in (*CODES, "if", "end", *_EXACT) or (inexact and not exact):
                continue
            raise ValueError(
                f"got np.{each.name} in the step, for which C has no function with the digits of the emulation; needed "
                "+ - * /, comparisons, choices, np.sqrt, np.fmod, np.remainder, np.floor, np.ceil, np.trunc, np.rint; "
                + ("ask with exact=False, or " if inexact else "")
                + "write a polynomial or a table in its place"
            )
