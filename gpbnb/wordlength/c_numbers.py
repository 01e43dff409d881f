"""A step as its C code has it, and how C computes with its numbers: in floating point, or on integers as words."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from gpbnb.arithmetic.fixed import FixedFormat
from gpbnb.arithmetic.machine import CODES, NAMES, operands_of
from gpbnb.filters.program import Program, flat
from gpbnb.filters.word_formats import WordFormats
from gpbnb.wordlength.c_integers import Integers, literal, modulus, used_functions, word_bits

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
        names = self.program.coefficient_names or [f"c{i}" for i in range(len(flat(self.program.coefficients)))]
        return ["_".join(re.findall(r"\w+", name)) for name in names]

    @cached_property
    def coefficient_at(self) -> dict[int, int]:
        """The number of the coefficient at each of their places."""
        return {place: i for i, place in enumerate(flat(self.program.coefficients).tolist())}

    @cached_property
    def changing(self) -> set[int]:
        """Numbers of the coefficients that differ from one step of a cycle to another."""
        return {*np.flatnonzero((self.coefficients != self.coefficients[0]).any(axis=0)).tolist()}

    @cached_property
    def variables(self) -> dict[int, str]:
        """Names of the other places: states, inputs, results."""
        results = [each.out for each in self.operations if each.gives_number]
        places = [*flat([*self.program.states, *self.program.inputs]).tolist(), *results]
        return {place: f"r{i}" for i, place in enumerate(places)}

    @cached_property
    def used(self) -> set[int]:
        """Places of the numbers that are used."""
        return {*(place for each in self.operations for place in each.takes[0]), *flat(self.program.after).tolist()}

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


# -- kinds of numbers ------------------------------------------------------------------------------------------------

LONGEST_SHIFT = 126
"""Fraction bits that the helpers for 128 bits can take from a product."""

LONGEST_RADICAND = 122
"""Bits of an argument whose square root the helpers find."""

_IN_C = {"arctan2": "atan2", "float_power": "pow"}
_FLOATING = {
    "add": "{0} + {1}", "subtract": "{0} - {1}", "multiply": "{0} * {1}", "divide": "{0} / {1}", "sqrt": "sqrt{f}({0})",
    "negative": "0 - {0}", "absolute": "{0} < 0 ? 0 - {0} : {0}", "choose": "{0} ? {1} : {2}",
    "fmod": "fmod{f}({0}, {1})", "remainder": "modulus({0}, {1})",
    **{name: name + "{f}({0})" for name in WHOLE},
    # An emulated zero has no sign; the sum takes it from that of C.
    **{
        name: _IN_C.get(name, name.replace("arc", "a")) + ("{f}({0} + 0, {1} + 0)" if values == 2 else "{f}({0})")
        for name, values in LIBRARY.items()
    },
}  # fmt: skip
_INTEGER = {
    "add": "add({left}, {right}{o})", "subtract": "subtract({left}, {right}{o})", "divide": "divide({0}, {1}{o})",
    "multiply": "multiply({0}, {1}, {shift}{o})", "sqrt": "root({0}{o})", "negative": "subtract(0, {0}{o})",
    "absolute": "{0} < 0 ? subtract(0, {0}{o}) : {0}", "choose": "{0} ? {1} : {2}",
    "fmod": "modulo({0}, {1})", "remainder": "modulus({0}, {1})",
    **{name: f"whole_{name}({{0}}{{o}})" for name in WHOLE},
}  # fmt: skip
"""How each operation is written in floating point, and by the functions for integers."""


@dataclass(frozen=True)
class CodeFloats:
    """Operations as the processor does them in ``float`` or ``double``, the type of all numbers."""

    step: CodeStep
    number: str

    floating = may_overflow = True

    @property
    def value(self) -> str:
        """Type of the results of operations."""
        return self.number

    @property
    def single(self) -> str:
        """What C appends to constants and names of functions for ``float``."""
        return "f" if self.number == "float" else ""

    def constant(self, coefficient: int, member: int) -> str:
        """Return a coefficient in a step of a cycle."""
        return self.text(self.step.coefficients[member, coefficient])

    def text(self, value: Any) -> str:
        """Return the hexadecimal constant that has exactly this value."""
        return self.vector_text(float(value)) + self.single

    def vector_text(self, value: float) -> str:
        """Return a float64 as ``fscanf`` reads it."""
        whole, _, power = float(value).hex().partition("p")
        head, _, tail = whole.partition(".")
        tail = tail.rstrip("0")
        return f"{head}{'.' + tail if tail else ''}p{power}"

    def operation(self, each: Operation, texts: Sequence[str]) -> str:
        """Return the expression for an operation on operands with some texts."""
        return _FLOATING[each.name].format(*texts, f=self.single)

    def stored(self, text: str) -> str:
        """Return a number as it is stored; a negative zero becomes zero, since the emulation has no other."""
        return f"{text} + 0.0{self.single}"

    def helpers(self, body: str) -> str:
        """Return the only function that C lacks, if it is used."""
        return used_functions({"modulus": modulus(self.number, f"fmod{self.single}(x, y)")}, body)

    @cached_property
    def finite(self) -> list[int]:
        """Places that must be finite: no operation and no state hides an infinity."""
        step = self.step
        found = dict.fromkeys(flat(step.program.after).tolist())
        found |= dict.fromkeys(each.out for each in step.operations if each.gives_number and each.out not in step.used)
        for each in step.operations:
            if each.name in ("divide", "fmod", "remainder"):
                found[each.given[1]] = None
            elif each.name in ("compare", "choose", *LIBRARY):
                found |= dict.fromkeys(each.takes[0])
        return [place for place in found if place in step.variables]


@dataclass(frozen=True)
class CodeWords:
    """Operations on integers, by the functions of :mod:`gpbnb.wordlength.c_integers`."""

    step: CodeStep
    words: WordFormats

    floating = False
    finite = ()  # each operation notes its overflow

    @property
    def number(self) -> str:
        """Type of the data."""
        return f"int{word_bits(self.words.data)}_t"

    @property
    def value(self) -> str:
        """Type of the results of operations."""
        return self.integers.value

    @property
    def may_overflow(self) -> bool:
        """Whether an overflow ends a run."""
        return self.integers.raises

    def constant(self, coefficient: int, member: int) -> str:
        """Return the integer of a coefficient, or of a limit in units of the data, in a step of a cycle."""
        return literal(self._integer(coefficient, member)[0])

    def text(self, value: Any) -> str:
        """Return a number of the data in its units."""
        return literal(int(value / self.words.data.unit))

    def vector_text(self, value: Any) -> str:
        """Return an integer in units of the data as ``fscanf`` reads it."""
        return str(value)

    def operation(self, each: Operation, texts: Sequence[str]) -> str:
        """Return the expression for an operation on operands with some texts."""
        words, given = self.words, {"o": ", &overflow" if self.may_overflow else ""}
        if each.name in ("add", "subtract"):
            short = words.sums is not None and words.gap > 0
            terms = [
                f"lifted({text})" if short and place not in self._wide else text
                for place, text in zip(each.given[:2], texts, strict=True)
            ]
            given |= dict(zip(("left", "right"), terms, strict=True))
        elif each.name == "multiply":
            given["shift"] = str(self._shift(each))
        found = _INTEGER[each.name].format(*texts, **given)
        is_sum = each.name in ("multiply", "add", "subtract") and words.sums is not None
        return f"store({found}{given['o']})" if is_sum and each.out not in self._wide else found

    def stored(self, text: str) -> str:
        """Return a number as it is stored."""
        return f"({self.number}){text}"

    def helpers(self, body: str) -> str:
        """Return the functions that the statements use."""
        return used_functions(self.integers.functions(), body)

    @cached_property
    def _wide(self) -> set[int]:
        """Places of results that stay in the accumulator; for a linear program."""
        program = self.step.program
        return {*program.places[program.n + program.m :][program.wide].tolist()}

    @cached_property
    def _data(self) -> set[int]:
        """Places of numbers that something else than a product takes; coefficients among them are data."""
        return {place for each in self.step.operations if each.name != "multiply" for place in each.takes[0]}

    def _integer(self, coefficient: int, member: int = 0) -> tuple[int, int]:
        """Return the integer of a coefficient and its fraction bits."""
        value, fmt = self.step.coefficients[member, coefficient], self.words.coefficients
        is_data = int(flat(self.step.program.coefficients)[coefficient]) in self._data
        if isinstance(fmt, int) and not is_data:
            point = int(value.denominator).bit_length() - 1
            return int(value * 2**point), point
        fmt = fmt if isinstance(fmt, FixedFormat) and not is_data else self.words.data
        return int(value / fmt.unit), fmt.fraction_bits

    def _factor(self, each: Operation) -> int | None:
        """Return the coefficient by which an operation multiplies, if any."""
        at = self.step.coefficient_at
        return next((at[place] for place in each.given[:2] if place in at), None)

    def _shift(self, each: Operation) -> int:
        """Return the fraction bits that a product loses on its way to the accumulator."""
        factor, point = self._factor(each), self.words.data.fraction_bits
        return (point if factor is None else self._integer(factor)[1]) + point - self.words.accumulator.fraction_bits

    @cached_property
    def integers(self) -> Integers:
        """The functions for the bits that the operations need; ValueError if C99 has no type for these."""
        step, words = self.step, self.words
        for name, fmt in (("data", words.data), ("sums", words.accumulator)):
            if word_bits(fmt) is None:
                raise ValueError(
                    f"got {name} of {1 + fmt.precision} bits; needed at most 64: C99 has no longer type for them"
                )
        data, point = words.data.precision, words.data.fraction_bits
        most, shift = max(data + words.gap, words.accumulator.precision) + 1, 0
        for each in step.operations:
            if each.name == "multiply":
                moved, longest, factor = self._shift(each), data, self._factor(each)
                if factor is not None:
                    sizes = [self._integer(factor, member)[0] for member in range(len(step.coefficients))]
                    longest = max(abs(size).bit_length() for size in sizes)
                if longest > 63:
                    raise ValueError(f"got a coefficient of {longest} bits; needed at most 63 for a type of C99")
                most, shift = max(most, longest + data + max(-moved, 0)), max(shift, moved)
            elif each.name == "divide":
                most = max(most, data + abs(point))
                if data - point > 63 and point < 0:
                    raise ValueError(
                        f"got divisors of {data - point} bits in units of 1; needed at most 63 for a type of C99"
                    )
            elif each.name in WHOLE:
                most, shift = max(most, point + 1), max(shift, point)
            elif each.name == "sqrt":
                if point < 0 or data + point > LONGEST_RADICAND:
                    raise ValueError(
                        f"got a square root of {1 + data} bits with {point} after the point; needed at least none, and "
                        f"at most {LONGEST_RADICAND} together with those of the word"
                    )
                most = max(most, (data + point + 3) // 2)
        if max(most, shift) > LONGEST_SHIFT:
            raise ValueError(
                f"got products of {most} bits that lose up to {shift}; needed at most {LONGEST_SHIFT} of each for the "
                "integers of C99; use shorter words"
            )
        return Integers(words, max(most, shift))


CodeNumbers = CodeFloats | CodeWords
"""How the operations of a step are written for a kind of number."""
