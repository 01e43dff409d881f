"""C99 from the list of operations of a step: one statement for each operation, in the order of the list."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction
from functools import cached_property
from itertools import takewhile
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from gpbnb.arithmetic.fixed import FixedFormat
from gpbnb.arithmetic.machine import CODES, NAMES, operands_of
from gpbnb.filters.program import Program
from gpbnb.filters.words import WordFormats
from gpbnb.wordlength.c_integers import LONGEST_SHIFT, Integers, Needs, modulus, radicand_bits, word_bits

_WORDS = (
    "auto break case char const continue default do double else enum extern float for goto if inline int long register "
    "restrict return short signed sizeof static struct switch typedef union unsigned void volatile while _Bool "
    "_Complex _Imaginary asm main wide input output state overflow status isfinite phase"
)
_KEYWORDS = frozenset(_WORDS.split())
"""Words of C and of the generated code, which are no names of coefficients or states."""

_NAME = re.compile(r"([A-Za-z][A-Za-z0-9_]*)((?:\[\d+\])*)")
_WHOLE = ("floor", "ceil", "trunc", "rint")
_ON_TWO = ("arctan2", "hypot", "float_power")
_ON_ONE = (
    "exp", "expm1", "exp2", "log", "log1p", "log2", "log10", "cbrt", "sin", "cos", "tan", "arcsin", "arccos", "arctan",
    "sinh", "cosh", "tanh", "arcsinh", "arccosh", "arctanh",
)  # fmt: skip
LIBRARY = dict.fromkeys(_ON_TWO, 2) | dict.fromkeys(_ON_ONE, 1)
"""Functions that C's library has, with other last digits than the emulation, and how many numbers they take."""
_IN_C = {"arctan2": "atan2", "float_power": "pow"}
_ORDERS = ("0", "{} < {}", "{} == {}", "{} <= {}", "{} > {}", "{} != {}", "{} >= {}", "1")
"""How two numbers are compared, by the orders that hold: 1 less, 2 equal, 4 greater."""
_AND, _OR, _NOT = 8, 14, 1
_FLOATING = {
    "add": "{0} + {1}", "subtract": "{0} - {1}", "multiply": "{0} * {1}", "divide": "{0} / {1}", "sqrt": "sqrt{f}({0})",
    "negative": "0 - {0}", "absolute": "{0} < 0 ? 0 - {0} : {0}", "choose": "{0} ? {1} : {2}",
    "fmod": "fmod{f}({0}, {1})", "remainder": "modulus({0}, {1})",
    **{name: name + "{f}({0})" for name in _WHOLE},
}  # fmt: skip
for _name, _values in LIBRARY.items():
    # An emulated zero has no sign; the sum takes it from that of C.
    _operands = "{0} + 0, {1} + 0" if _values == 2 else "{0}"
    _FLOATING[_name] = _IN_C.get(_name, _name.replace("arc", "a")) + "{f}(" + _operands + ")"
_INTEGER = {
    "add": "add({left}, {right}{o})", "subtract": "subtract({left}, {right}{o})", "divide": "divide({0}, {1}{o})",
    "multiply": "multiply({0}, {1}, {shift}{o})", "sqrt": "root({0}{o})", "negative": "subtract(0, {0}{o})",
    "absolute": "{0} < 0 ? subtract(0, {0}{o}) : {0}", "choose": "{0} ? {1} : {2}",
    "fmod": "modulo({0}, {1})", "remainder": "modulus({0}, {1})",
    **{name: f"whole_{name}({{0}}{{o}})" for name in _WHOLE},
}  # fmt: skip
"""How each operation is written in floating point, and by the functions for integers."""

_SUMMED = ("multiply", "add", "subtract")
"""Operations whose results are in the format of the sums."""

DIVISOR, RADICAND = range(2)
_STOPS = {DIVISOR: ("== 0", "a divisor is zero"), RADICAND: ("< 0", "a square root has a negative argument")}


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
    def is_statement(self) -> bool:
        """Whether its result is a number."""
        return self.name not in ("compare", "combine", "nonzero", "if", "end")

    @property
    def takes(self) -> tuple[Sequence[int], Sequence[int]]:
        """The numbers and the truth values that it takes."""
        code = CODES.get({"if": "skip"}.get(self.name, self.name))
        return (self.given, ()) if code is None else operands_of(code, *self.given)


def listed(program: Program) -> list[Operation]:
    """Return the operations and function calls of a program, in order."""
    found, ends, calls = list[Operation](), list[int](), list(program.calls)
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

    @property
    def stored(self) -> int:
        """Number of states that are kept from step to step."""
        return self.program.n - self.program.p

    @cached_property
    def operations(self) -> list[Operation]:
        """The operations of the step."""
        return listed(self.program)

    @cached_property
    def coefficient_at(self) -> dict[int, int]:
        """The number of the coefficient at each of their places."""
        return {place: i for i, place in enumerate(self.program.coefficients.tolist())}

    @cached_property
    def variables(self) -> dict[int, str]:
        """Names of all other places: states, inputs, results."""
        results = [each.out for each in self.operations if each.is_statement]
        places = [*self.program.states.tolist(), *self.program.inputs.tolist(), *results]
        return {place: f"r{i}" for i, place in enumerate(places)}

    @cached_property
    def used(self) -> Counter[int]:
        """How often each number is used."""
        taken = (place for each in self.operations for place in each.takes[0])
        return Counter([*taken, *self.program.after.tolist()])

    @cached_property
    def truths_used(self) -> Counter[int]:
        """How often each truth value is used."""
        taken = (place for each in self.operations for place in {*each.takes[1]})
        return Counter([*taken, self.program.definite])

    @cached_property
    def checks(self) -> list[tuple[int, int]]:
        """Places of numbers that must not be zero, or not be negative; conditions guard operations inside them."""
        found = list[tuple[int, int]]()
        for each in self.operations:
            if each.depth:
                continue
            if each.name == "sqrt":
                found.append((each.given[0], RADICAND))
            elif each.name in _DIVISIONS and self._may_be_zero(divisor := each.given[_DIVISIONS[each.name]]):
                found.append((divisor, DIVISOR))
        return list(dict.fromkeys(found))

    def _may_be_zero(self, place: int) -> bool:
        i = self.coefficient_at.get(place)
        return i is None or bool((self.coefficients[:, i] == 0).any())

    @cached_property
    def wide(self) -> set[int]:
        """Places of results that stay in the accumulator; for a linear program."""
        results = self.program.places[self.program.n + self.program.m :]
        return {*results[self.program.wide].tolist()}

    @cached_property
    def data(self) -> set[int]:
        """Places of numbers that something else than a product takes; coefficients among them are data."""
        return {place for each in self.operations if each.name != "multiply" for place in each.takes[0]}

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
            if each.name in CODES or each.name in ("if", "end") or each.name in _EXACT or (inexact and not exact):
                continue
            raise ValueError(
                f"got np.{each.name} in the step, for which C has no function with the digits of the emulation; needed "
                "+ - * /, comparisons, choices, np.sqrt, np.fmod, np.remainder, np.floor, np.ceil, np.trunc, np.rint; "
                + ("ask with exact=False, or " if inexact else "")
                + "write a polynomial or a table in its place"
            )


_DIVISIONS = {"nonzero": 0, "divide": 1, "fmod": 1, "remainder": 1}
"""Operations with a divisor, and which operand it is."""
_EXACT = ("fmod", "remainder", *_WHOLE)
"""Functions that C has with the digits of the emulation."""


@dataclass(frozen=True)
class CodeFloats:
    """Operations as the processor does them in ``float`` or ``double``."""

    number: str

    @property
    def value(self) -> str:
        """The same type, since the processor rounds each operation."""
        return self.number

    floating = may_overflow = True

    def constant(self, step: CodeStep, coefficient: int, member: int) -> str:
        """Return the hexadecimal constant that has exactly this value."""
        return self.number_text(step.coefficients[member, coefficient])

    def number_text(self, value: Fraction) -> str:
        """Return the hexadecimal constant that has exactly this value."""
        return self.vector_text(float(value)) + ("f" if self.number == "float" else "")

    def vector_text(self, value: float) -> str:
        """Return a float64 as ``fscanf`` reads it."""
        whole, _, power = float(value).hex().partition("p")
        head, _, tail = whole.partition(".")
        tail = tail.rstrip("0")
        return f"{head}{'.' + tail if tail else ''}p{power}"

    def operation(self, step: CodeStep, each: Operation, texts: Sequence[str]) -> str:
        """Return the expression for an operation on operands with some texts."""
        return _FLOATING[each.name].format(*texts, f="f" if self.number == "float" else "")

    def helpers(self, body: str) -> str:
        """Return the only function that C lacks, if it is used."""
        single = "f" if self.number == "float" else ""
        return modulus(self.number, f"fmod{single}(x, y)") if re.search(r"\bmodulus\b", body) else ""

    def finite(self, step: CodeStep) -> list[int]:
        """Return places that must be finite: no operation and no state hides an infinity."""
        found = dict.fromkeys(step.program.after.tolist())
        found |= dict.fromkeys(each.out for each in step.operations if each.is_statement and not step.used[each.out])
        for each in step.operations:
            if each.name in ("divide", "fmod", "remainder"):
                found[each.given[1]] = None
            elif each.name in ("compare", "choose") or each.name in LIBRARY:
                found |= dict.fromkeys(each.takes[0])
        return [place for place in found if place in step.variables]


@dataclass(frozen=True)
class CodeWords:
    """Operations on integers, by the functions of :mod:`gpbnb.wordlength.c_integers`."""

    words: WordFormats
    integers: Integers
    floating = False

    @property
    def number(self) -> str:
        """C type of the data."""
        return f"int{word_bits(self.words.data)}_t"

    @property
    def value(self) -> str:
        """C type of the results of operations."""
        return self.integers.value

    @property
    def may_overflow(self) -> bool:
        """Whether an overflow ends a run."""
        return self.integers.raises

    def constant(self, step: CodeStep, coefficient: int, member: int) -> str:
        """Return the integer of a coefficient, or of a limit in units of the data."""
        n, _ = _integer(step, coefficient, self.words, member)
        return self.integers.literal(n)

    def number_text(self, value: Fraction) -> str:
        """Return a number of the data in its units."""
        return self.integers.literal(int(value / self.words.data.unit))

    def vector_text(self, value: float) -> str:
        """Return an integer in units of the data as ``fscanf`` reads it."""
        return str(value)

    def operation(self, step: CodeStep, each: Operation, texts: Sequence[str]) -> str:
        """Return the expression for an operation on operands with some texts."""
        words, left, right = self.words, "", ""
        overflow = ", &overflow" if self.may_overflow else ""
        if each.name in ("add", "subtract"):
            left, right = (self._term(step, *given) for given in zip(each.given[:2], texts, strict=True))
        shift = _shift(step, each, words) if each.name == "multiply" else 0
        found = _INTEGER[each.name].format(*texts, left=left, right=right, shift=shift, o=overflow)
        is_stored = each.name in _SUMMED and words.sums is not None and each.out not in step.wide
        return f"store({found}{overflow})" if is_stored else found

    def _term(self, step: CodeStep, place: int, text: str) -> str:
        """Return a term of a sum in units of the accumulator."""
        is_sum = self.words.sums is None or place in step.wide
        return text if is_sum or self.words.gap == 0 else f"lifted({text})"

    def helpers(self, body: str) -> str:
        """Return the functions that the statements use."""
        return self.integers.text(body)

    def finite(self, step: CodeStep) -> list[int]:
        """Return no places: each operation notes its overflow."""
        return []


CodeNumbers = CodeFloats | CodeWords
"""How the operations of a program are written for a type of number."""


def _integer(step: CodeStep, coefficient: int, words: WordFormats, member: int = 0) -> tuple[int, int]:
    """Return the integer of a coefficient and its fraction bits."""
    value = step.coefficients[member, coefficient]
    is_data = int(step.program.coefficients[coefficient]) in step.data
    if isinstance(words.coefficients, int) and not is_data:
        point = int(value.denominator).bit_length() - 1
        return int(value * 2**point), point
    fmt = words.coefficients if isinstance(words.coefficients, FixedFormat) and not is_data else words.data
    return int(value / fmt.unit), fmt.fraction_bits


def _factor(step: CodeStep, each: Operation) -> int | None:
    """Return the coefficient by which an operation multiplies, if any."""
    return next((step.coefficient_at[place] for place in each.given[:2] if place in step.coefficient_at), None)


def _shift(step: CodeStep, each: Operation, words: WordFormats) -> int:
    """Return the fraction bits that a product loses on its way to the accumulator."""
    factor = _factor(step, each)
    point = words.data.fraction_bits if factor is None else _integer(step, factor, words)[1]
    return point + words.data.fraction_bits - words.accumulator.fraction_bits


def word_arithmetic(step: CodeStep, words: WordFormats) -> CodeWords:
    """Return how a step is written with integers."""
    for name, fmt in (("data", words.data), ("sums", words.accumulator)):
        if word_bits(fmt) is None:
            raise ValueError(
                f"got {name} of {1 + fmt.precision} bits; needed at most 64: C99 has no longer type for them"
            )
    data, gap = words.data.precision, words.gap
    most, shift = max(data + gap, words.accumulator.precision) + 1, 0
    for each in step.operations:
        if each.name == "multiply":
            moved, longest, factor = _shift(step, each, words), data, _factor(step, each)
            if factor is not None:
                sizes = [_integer(step, factor, words, member)[0] for member in range(len(step.coefficients))]
                longest = max(abs(size).bit_length() for size in sizes)
            if longest > 63:
                raise ValueError(f"got a coefficient of {longest} bits; needed at most 63 for a type of C99")
            most, shift = max(most, longest + data + max(-moved, 0)), max(shift, moved)
        elif each.name == "divide":
            most = max(most, data + abs(words.data.fraction_bits))
            if (longest := data - words.data.fraction_bits) > 63 and words.data.fraction_bits < 0:
                raise ValueError(f"got divisors of {longest} bits in units of 1; needed at most 63 for a type of C99")
        elif each.name in _WHOLE:
            most, shift = max(most, words.data.fraction_bits + 1), max(shift, words.data.fraction_bits)
        elif each.name == "sqrt":
            most = max(most, (radicand_bits(words.data) + 3) // 2)
    if max(most, shift) > LONGEST_SHIFT:
        raise ValueError(
            f"got products of {most} bits that lose up to {shift}; needed at most {LONGEST_SHIFT} of each for the "
            "integers of C99; use shorter words"
        )
    return CodeWords(words, Integers(words, Needs(most, shift)))


# -- names ------------------------------------------------------------------------------------------------------------


class Place(NamedTuple):
    """The name of an entry in C: an array with its indices, or a variable."""

    name: str
    at: tuple[int, ...]

    def __str__(self) -> str:
        return self.name + "".join(f"[{i}]" for i in self.at)


def places(names: tuple[str, ...], count: int, letter: str) -> list[Place]:
    """Return names as C can use them; if one is not such a name, all are numbered after a letter."""
    found = [_NAME.fullmatch(each) for each in names]
    used = [match[1] for match in found if match]
    fits = len(names) == count and all(found) and len(set(names)) == count
    kinds = {match[1]: len(match[2]) > 0 for match in found if match}
    mixed = any(match and kinds[match[1]] != (len(match[2]) > 0) for match in found)
    if not fits or mixed or any(each in _KEYWORDS or re.fullmatch(r"[rR]\d+|holds\d+", each) for each in used):
        return [Place(letter, (i,)) for i in range(count)]
    return [Place(match[1], tuple(int(i) for i in re.findall(r"\d+", match[2]))) for match in found if match]


def arrays(given: list[Place]) -> dict[str, tuple[int, ...]]:
    """Return the shape of each name, in the order of the names."""
    shapes: dict[str, tuple[int, ...]] = {}
    for name, index in given:
        before = shapes.get(name, (0,) * len(index))
        shapes[name] = tuple(max(a, i + 1) for a, i in zip(before, index, strict=True))
    return shapes


def declared(name: str, shape: tuple[int, ...]) -> str:
    """Return a name with the shape of its array."""
    return name + "".join(f"[{size}]" for size in shape)


def checked_identifier(name: str) -> str:
    """Return a name that C and file systems take."""
    if not isinstance(name, str) or not re.fullmatch(r"[A-Za-z][A-Za-z0-9_]{0,30}", name) or name in _KEYWORDS:
        raise ValueError(f"got name {name!r}; needed a name of C with up to 31 letters, digits and _, such as 'filter'")
    return name


# -- the step ---------------------------------------------------------------------------------------------------------


class Status(NamedTuple):
    """What a step may return: its name and value in C, and its meaning."""

    name: str
    value: int
    meaning: str


class CodeSource:
    """The text of a step in C.

    Parameters
    ----------
    step : the operations.
    arithmetic : how they are written.
    name : name of the files, and prefix of the public names.
    """

    def __init__(self, step: CodeStep, arithmetic: CodeNumbers, name: str) -> None:
        self.step, self.arithmetic, self.name = step, arithmetic, name
        program = step.program
        self.states = places(program.state_names[: step.stored], step.stored, "x")
        self.coefficients = places(program.coefficient_names, len(program.coefficients), "c")
        self.period = len(step.coefficients)
        self._members: dict[str, list[int]] = {}
        for i, each in enumerate(self.coefficients):
            self._members.setdefault(each.name, []).append(i)
        self._truths = {each.out: each for each in step.operations if each.name in ("compare", "combine")}
        #: Numbers of the coefficients that are used.
        self._used = set[int]()
        changes = np.any(step.coefficients != step.coefficients[0], axis=0)
        self._cycling = {each for each, members in self._members.items() if changes[members].any()}

    @property
    def statuses(self) -> list[Status]:
        """What a step may return."""
        name, step, kinds = self.name.upper(), self.step, {kind for _, kind in self.step.checks}
        found = [Status(f"{name}_OK", 0, "the step is done")]
        if step.may_be_indefinite:
            found.append(Status(f"{name}_INDEFINITE", 1, "the step is done, but a variance is not positive"))
        if kinds:
            reasons = [reason for kind, (_, reason) in _STOPS.items() if kind in kinds]
            found.append(Status(f"{name}_STOPPED", 2, f"{', or '.join(reasons)}; the state stays as it was"))
        if self.arithmetic.may_overflow:
            found.append(Status(f"{name}_OVERFLOW", 3, "a number is beyond the range; the state stays as it was"))
        return found

    @property
    def prototype(self) -> str:
        """The head of the function that takes a step."""
        program, number = self.step.program, f"{self.name}_number"
        output = f", {number} output[{program.p}]" if program.p else ""
        return f"int {self.name}_step({self.name}_state *state, const {number} input[{program.m}]{output})"

    def structure(self) -> str:
        """Return the declaration of the state."""
        fields = [f"    {self.name}_number {declared(*each)};" for each in arrays(self.states).items()]
        if self.period > 1:
            fields.append(f"    unsigned phase; /* of the {self.period} steps of a cycle */")
        return "\n".join(["typedef struct {", *(fields or ["    char nothing;"]), f"}} {self.name}_state;"])

    def constants(self, used: set[int]) -> str:
        """Return the coefficients that are used, those of a matrix together."""
        lines, shapes = list[str](), arrays(self.coefficients)
        for name in dict.fromkeys(self.coefficients[i].name for i in sorted(used)):
            shape, members = shapes[name], self._members[name]
            cycle = (self.period,) if name in self._cycling else ()
            tables = [
                _braced([self._text(j, k) for j in self._filled(members, shape)], shape)
                for k in range(self.period if cycle else 1)
            ]
            text = "{" + ",\n    ".join(tables) + "}" if cycle else tables[0]
            comment = "" if shape or cycle else f" /* {float(self.step.coefficients[0, members[0]]):.9g} */"
            whole = declared(name, cycle + shape)
            lines.append(f"static const {self.arithmetic.value} {whole} = {text};{comment}")
        return "\n".join(lines)

    def _filled(self, members: list[int], shape: tuple[int, ...]) -> list[int | None]:
        at = {self.coefficients[j].at: j for j in members}
        return [at.get(index) for index in np.ndindex(shape)]

    def _text(self, coefficient: int | None, member: int) -> str:
        return "0" if coefficient is None else self.arithmetic.constant(self.step, coefficient, member)

    def _coefficient(self, i: int) -> str:
        place = self.coefficients[i]
        phase = "[state->phase]" if place.name in self._cycling else ""
        return place.name + phase + "".join(f"[{j}]" for j in place.at)

    # -- expressions ----------------------------------------------------------------------------------------

    def _number(self, place: int) -> str:
        """Return the text of a number: a variable, a coefficient, or zero."""
        if place in self.step.variables:
            return self.step.variables[place]
        if place not in self.step.coefficient_at:
            return "0"
        i = self.step.coefficient_at[place]
        self._used.add(i)
        return self._coefficient(i)

    def _is_named(self, truth: int) -> bool:
        """Whether a truth value has a variable: it is used more than once, or a step may leave it out."""
        return self.step.truths_used[truth] > 1 or self._truths[truth].depth > 0

    def _truth(self, truth: int, negated: bool = False) -> str:
        """Return a truth value, or its opposite, as a variable or an expression."""
        if truth < 2:
            return str(int(truth != negated))
        if self._is_named(truth):
            return f"{'!' * negated}holds{truth}"
        return self._compared(truth, negated)

    def _compared(self, truth: int, negated: bool = False) -> str:
        """Return the expression for a truth value, or its opposite."""
        each = self._truths[truth]
        a, b, table = each.given
        if each.name == "compare":
            return _ORDERS[7 - table if negated else table].format(self._number(a), self._number(b))
        if (a == b, table) == (True, _NOT):
            return self._truth(a, not negated)
        left, right = (f"({text})" if " " in text else text for text in (self._truth(a), self._truth(b)))
        joint = {_AND: "&&", _OR: "||"}.get(table)
        found = f"{left} {joint} {right}" if joint else f"{table} >> (2 * {left} + {right}) & 1"
        return f"!({found})" if negated else found

    def _parts(self, truth: int) -> list[int]:
        """Return the truth values that must all hold for one to hold."""
        each = self._truths.get(truth)
        if each is None or self._is_named(truth) or (each.name, each.given[2]) != ("combine", _AND):
            return [truth]
        return [*self._parts(each.given[0]), *self._parts(each.given[1])]

    # -- statements -----------------------------------------------------------------------------------------

    def body(self) -> str:
        """Return the statements of a step."""
        program, step, value = self.step.program, self.step, self.arithmetic.value
        lines = list[str]()
        for place, state in zip(program.states.tolist(), self.states, strict=False):
            if step.used[place]:
                lines.append(f"const {value} {step.variables[place]} = state->{state};")
        taken = [(i, place) for i, place in enumerate(program.inputs.tolist()) if step.used[place]]
        lines += [f"const {value} {step.variables[place]} = input[{i}];" for i, place in taken]
        if not taken:
            lines.append("(void)input;")
        for o, each in enumerate(step.operations):
            lines += self._statements(each, o)
        return "\n".join(f"    {line}" for line in lines)

    def _statements(self, each: Operation, o: int) -> list[str]:
        """Return the lines of an operation."""
        inside = "    " * each.depth
        if each.name == "if":
            return [*(self._declared(o) if not each.depth else []), f"{inside}if ({self._truth(each.given[0])}) {{"]
        if each.name == "end":
            return [f"{inside}}}"]
        if each.name == "nonzero":
            return []
        if each.out in self._truths and not each.is_statement:
            named = self._is_named(each.out) and self.step.truths_used[each.out]
            kind = "" if each.depth else "const int "
            return [f"{inside}{kind}holds{each.out} = {self._compared(each.out)};"] if named else []
        numbers, truths = each.takes
        texts = [*map(self._truth, truths), *map(self._number, numbers)]
        name, kind = self.step.variables[each.out], "" if each.depth else f"const {self.arithmetic.value} "
        unused = [] if self.step.used[each.out] else [f"(void){name};"]
        return [f"{inside}{kind}{name} = {self.arithmetic.operation(self.step, each, texts)};", *unused]

    def _declared(self, o: int) -> list[str]:
        """Return declarations of all that a condition, and those in it, may leave out."""
        inside = list(takewhile(lambda each: each.depth, self.step.operations[o + 1 :]))
        numbers = [f"{self.step.variables[each.out]} = 0" for each in inside if each.is_statement]
        named = [each.out for each in inside if each.name in ("compare", "combine") and self.step.truths_used[each.out]]
        truths = [f"holds{truth} = 0" for truth in named]
        found = ((self.arithmetic.value, numbers), ("int", truths))
        return [f"{kind} {', '.join(names)};" for kind, names in found if names]

    def _conditions(self) -> list[str]:
        """Return the statements that find the status of a step."""
        step, name = self.step, self.name.upper()
        stops = [f"{self._number(place)} {_STOPS[kind][0]}" for place, kind in step.checks]
        lines = _when(stops, f"return {name}_STOPPED;") if stops else []
        if finite := self.arithmetic.finite(step):
            lines += _when([f"!isfinite({self._number(each)})" for each in finite], f"return {name}_OVERFLOW;")
        elif self.arithmetic.may_overflow:
            lines += ["if (overflow)", f"    return {name}_OVERFLOW;"]
        if step.may_be_indefinite:
            signs = [self._truth(each, negated=True) for each in self._parts(step.program.definite)]
            lines += _when(list(dict.fromkeys(signs)), f"status = {name}_INDEFINITE;")
        return lines

    def function(self) -> tuple[str, set[int]]:
        """Return the function that takes a step, and the coefficients that it uses."""
        after, body = self.step.program.after.tolist(), self.body()
        head = []
        if self.step.may_be_indefinite:
            head.append(f"int status = {self.name.upper()}_OK;")
        if self.arithmetic.may_overflow and not self.arithmetic.finite(self.step):
            head.append("int overflow = 0;")
        ends = [f"state->{place} = {self._stored(at)};" for place, at in zip(self.states, after, strict=False)]
        ends += [f"output[{i}] = {self._stored(at)};" for i, at in enumerate(after[self.step.stored :])]
        if self.period > 1:
            ends.append(f"state->phase = (state->phase + 1) % {self.period};")
        last = "status" if self.step.may_be_indefinite else f"{self.name.upper()}_OK"
        lines = [*(f"    {each}" for each in head), body, *(f"    {each}" for each in self._conditions())]
        lines += [*(f"    {each}" for each in ends), f"    return {last};"]
        return "\n".join([self.prototype, "{", *lines, "}", ""]), self._used

    def _stored(self, place: int) -> str:
        """Return a number as it is stored; a negative zero becomes zero, since the emulation has no other."""
        zero = {"float": " + 0.0f", "double": " + 0.0"}.get(self.arithmetic.number)
        text = self._number(place)
        return f"{text}{zero}" if zero else f"({self.name}_number){text}"

    def start(self) -> str:
        """Return the function that sets the first state."""
        lines = [
            f"    state->{place} = {self.arithmetic.number_text(value)};"
            for place, value in zip(self.states, self.step.start, strict=True)
        ]
        shapes = arrays(self.states)
        known = {(place.name, place.at) for place in self.states}
        zeros = [
            f"    state->{Place(name, index)} = 0;"
            for name, shape in shapes.items()
            for index in np.ndindex(shape)
            if (name, index) not in known
        ]
        if self.period > 1:
            zeros.append("    state->phase = 0;")
        lines = [*zeros, *lines] or ["    state->nothing = 0;"]
        return "\n".join([f"void {self.name}_start({self.name}_state *state)", "{", *lines, "}", ""])


def _when(conditions: list[str], then: str) -> list[str]:
    """Return an if, with as many conditions in a line as fit."""
    lines, line = list[str](), "if ("
    for i, each in enumerate(conditions):
        condition = each + (" || " if i + 1 < len(conditions) else ")")
        if len(line) + len(condition) > 110:
            lines.append(line.rstrip())
            line = "        "
        line += condition
    return [*lines, line, f"    {then}"]


def _braced(texts: list[str], shape: tuple[int, ...]) -> str:
    if not shape:
        return texts[0]
    if len(shape) == 1:
        return "{" + ", ".join(texts) + "}"
    size = len(texts) // shape[0]
    return "{" + ",\n    ".join(_braced(texts[i * size : (i + 1) * size], shape[1:]) for i in range(shape[0])) + "}"
