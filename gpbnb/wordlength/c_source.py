"""C99 from the list of operations of a step: one statement for each operation, in the order of the list."""

from __future__ import annotations

import re
from dataclasses import dataclass
from fractions import Fraction
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from gpbnb.arithmetic.fixed import FixedFormat
from gpbnb.filters.program import (
    ADD,
    AT_LEAST,
    AT_MOST,
    CEILING,
    CHOOSE,
    CONSTANT,
    DIVIDE,
    DIVISOR,
    EQUAL,
    FLOOR,
    FUNCTIONS,
    IN_RANGE,
    LESS,
    MODULO,
    MULTIPLY,
    NEAREST,
    NOT_NEGATIVE,
    POSITIVE,
    PRODUCT,
    RADICAND,
    ROOT,
    SUBTRACT,
    TRUNCATE,
    Program,
    values_of,
)
from gpbnb.filters.words import WordFormats
from gpbnb.wordlength.c_integers import LONGEST_SHIFT, Integers, Needs, radicand_bits, word_bits

_WORDS = (
    "auto break case char const continue default do double else enum extern float for goto if inline int long register "
    "restrict return short signed sizeof static struct switch typedef union unsigned void volatile while _Bool "
    "_Complex _Imaginary asm main wide input output state overflow status isfinite phase"
)
_KEYWORDS = frozenset(_WORDS.split())
"""Words of C and of the generated code, which are no names of coefficients or states."""

_NAME = re.compile(r"([A-Za-z][A-Za-z0-9_]*)((?:\[\d+\])*)")
_WHOLE = {FLOOR: "floor", CEILING: "ceil", TRUNCATE: "trunc", NEAREST: "rint"}
_EITHER = {
    CONSTANT: "{c}", LESS: "{a} < {b}", EQUAL: "{a} == {b}", AT_LEAST: "{b} < {c} ? {c} : {b}",
    AT_MOST: "{b} > {c} ? {c} : {b}",
}  # fmt: skip
_FLOATING = _EITHER | {
    ADD: "{a} + {b}", SUBTRACT: "{a} - {b}", PRODUCT: "{a} * {b}", DIVIDE: "{a} / {b}", MULTIPLY: "{c} * {b}",
    ROOT: "sqrt{f}({b})", MODULO: "fmod{f}({a}, {b})", **{code: name + "{f}({b})" for code, name in _WHOLE.items()},
}  # fmt: skip
_IN_C = {"arctan2": "atan2", "float_power": "pow"}
for _name, _code in FUNCTIONS.items():
    # An emulated zero has no sign; the sum takes it from that of C.
    _operands = "{a} + 0, {b} + 0" if len(values_of(_code, 0, 0)) > 1 else "{b}"
    _FLOATING[_code] = _IN_C.get(_name, _name.replace("arc", "a")) + "{f}(" + _operands + ")"
_INTEGER = _EITHER | {
    ADD: "add({left}, {right}{o})", SUBTRACT: "subtract({left}, {right}{o})", PRODUCT: "multiply({a}, {b}, {shift}{o})",
    DIVIDE: "divide({a}, {b}{o})", MULTIPLY: "multiply({c}, {b}, {shift}{o})", ROOT: "root({b}{o})",
    MODULO: "modulo({a}, {b})", **{code: f"whole_{name}({{b}}{{o}})" for code, name in _WHOLE.items()},
}  # fmt: skip
"""How each operation is written, for any number, in floating point, and by the functions for integers."""

_SUMMED = (MULTIPLY, PRODUCT, ADD, SUBTRACT)
"""Operations whose results are in the format of the sums."""

_STOPS = {DIVISOR: ("== 0", "a divisor is zero"), RADICAND: ("< 0", "a square root has a negative argument")}


class CodeStep(NamedTuple):
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

    @property
    def may_stop(self) -> bool:
        """Whether a divisor may be zero, or the argument of a square root negative."""
        return any(kind in _STOPS for _, kind in self.program.checks)

    @property
    def is_exact(self) -> bool:
        """Whether it calls no function whose digits C's library does not guarantee."""
        return not np.isin(self.program.operations[:, 0], list(FUNCTIONS.values())).any()

    @property
    def may_be_indefinite(self) -> bool:
        """Whether the step notes a covariance that is not definite."""
        return any(kind in (POSITIVE, NOT_NEGATIVE) for _, kind in self.program.checks)


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

    def operation(self, step: CodeStep, o: int, coefficient: str) -> str:
        """Return the expression for an operation."""
        code, a, b = step.program.operations[o].tolist()
        single = "f" if self.number == "float" else ""
        return _FLOATING[code].format(a=f"r{a}", b=f"r{b}", c=coefficient, f=single)

    def helpers(self, body: str) -> str:
        """Return nothing: C has these operations."""
        return ""

    def finite(self, step: CodeStep) -> list[str]:
        """Return conditions under which no result is infinite: no operation and no state hides an infinity."""
        program, first = step.program, step.program.n + step.program.m
        found = dict.fromkeys(program.outputs.tolist())
        found |= dict.fromkeys(value for value, kind in program.checks if kind == IN_RANGE)
        found |= dict.fromkeys(each for each in program.guards if each >= 0)
        for code, a, b in program.operations.tolist():
            if code in (DIVIDE, MODULO, AT_LEAST, AT_MOST):
                found[b] = None
            elif code in FUNCTIONS.values():
                found |= dict.fromkeys(values_of(code, a, b))
            elif code in (LESS, EQUAL, CHOOSE):
                found |= {a: None, b: None}
        always = (CONSTANT, LESS, EQUAL)
        return [f"isfinite(r{i})" for i in found if i < first or program.operations[i - first, 0] not in always]


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

    def operation(self, step: CodeStep, o: int, coefficient: str) -> str:
        """Return the expression for an operation."""
        program, words = step.program, self.words
        code, a, b = program.operations[o].tolist()
        overflow = ", &overflow" if self.may_overflow else ""
        left, right = (self._term(program, a), self._term(program, b)) if code in (ADD, SUBTRACT) else ("", "")
        shift = _shift(step, o, words) if code in (MULTIPLY, PRODUCT) else 0
        found = _INTEGER[code].format(
            a=f"r{a}", b=f"r{b}", c=coefficient, left=left, right=right, shift=shift, o=overflow
        )
        is_stored = code in _SUMMED and words.sums is not None and not program.wide[o]
        return f"store({found}{overflow})" if is_stored else found

    def _term(self, program: Program, value: int) -> str:
        """Return a term of a sum in units of the accumulator."""
        o = value - program.n - program.m
        is_sum = self.words.sums is None or (o >= 0 and bool(program.wide[o]))
        return f"r{value}" if is_sum or self.words.gap == 0 else f"lifted(r{value})"

    def helpers(self, body: str) -> str:
        """Return the functions that the statements use."""
        return self.integers.text(body)

    def finite(self, step: CodeStep) -> list[str]:
        """Return no conditions: each operation notes its overflow."""
        return []


CodeNumbers = CodeFloats | CodeWords
"""How the operations of a program are written for a type of number."""


def _limits_of(program: Program) -> set[int]:
    return {a for code, a, _ in program.operations.tolist() if code in (AT_LEAST, AT_MOST, CONSTANT)}


def _integer(step: CodeStep, coefficient: int, words: WordFormats, member: int = 0) -> tuple[int, int]:
    """Return the integer of a coefficient and its fraction bits."""
    value = step.coefficients[member, coefficient]
    if isinstance(words.coefficients, int) and coefficient not in _limits_of(step.program):
        point = int(value.denominator).bit_length() - 1
        return int(value * 2**point), point
    fmt = words.coefficients if isinstance(words.coefficients, FixedFormat) else words.data
    if coefficient in _limits_of(step.program):
        fmt = words.data
    return int(value / fmt.unit), fmt.fraction_bits


def _shift(step: CodeStep, o: int, words: WordFormats) -> int:
    """Return the fraction bits that a product loses on its way to the accumulator."""
    code, a, _ = step.program.operations[o].tolist()
    point = words.data.fraction_bits if code == PRODUCT else _integer(step, a, words)[1]
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
    for o, (code, a, _) in enumerate(step.program.operations.tolist()):
        if code in (MULTIPLY, PRODUCT):
            moved = _shift(step, o, words)
            longest = data
            if code == MULTIPLY:
                sizes = [_integer(step, a, words, member)[0] for member in range(len(step.coefficients))]
                longest = max(abs(each).bit_length() for each in sizes)
            if longest > 63:
                raise ValueError(f"got a coefficient of {longest} bits; needed at most 63 for a type of C99")
            most, shift = max(most, longest + data + max(-moved, 0)), max(shift, moved)
        elif code == DIVIDE:
            most = max(most, data + abs(words.data.fraction_bits))
            if (longest := data - words.data.fraction_bits) > 63 and words.data.fraction_bits < 0:
                raise ValueError(f"got divisors of {longest} bits in units of 1; needed at most 63 for a type of C99")
        elif code in _WHOLE:
            most, shift = max(most, words.data.fraction_bits + 1), max(shift, words.data.fraction_bits)
        elif code == ROOT:
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
    if not fits or mixed or any(each in _KEYWORDS or re.fullmatch(r"[rR]\d+", each) for each in used):
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
        self.coefficients = places(program.coefficient_names, program.coefficients, "c")
        self.period = len(step.coefficients)
        self._members: dict[str, list[int]] = {}
        for i, each in enumerate(self.coefficients):
            self._members.setdefault(each.name, []).append(i)
        changes = np.any(step.coefficients != step.coefficients[0], axis=0)
        self._cycling = {each for each, members in self._members.items() if changes[members].any()}

    @property
    def statuses(self) -> list[Status]:
        """What a step may return."""
        name, step, checks = self.name.upper(), self.step, self.step.program.checks
        found = [Status(f"{name}_OK", 0, "the step is done")]
        if step.may_be_indefinite:
            found.append(Status(f"{name}_INDEFINITE", 1, "the step is done, but a variance is not positive"))
        if step.may_stop:
            reasons = [reason for kind, (_, reason) in _STOPS.items() if any(kind == each for _, each in checks)]
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

    def body(self) -> tuple[str, set[int]]:
        """Return the statements of a step, and the coefficients that they use."""
        program, value = self.step.program, self.arithmetic.value
        first, lines, used = program.n + program.m, list[str](), set[int]()
        needed = {*program.outputs.tolist(), *(value for value, kind in program.checks if kind != IN_RANGE)}
        for code, a, b in program.operations.tolist():
            needed |= {*values_of(code, a, b)}
        needed |= {*program.guards} - {-1}
        needed |= {int(each) for each in re.findall(r"\d+", " ".join(self.arithmetic.finite(self.step)))}
        for i in range(self.step.stored):
            if i in needed:
                lines.append(f"const {value} r{i} = state->{self.states[i]};")
        for i in range(program.m):
            if program.n + i in needed:
                lines.append(f"const {value} r{program.n + i} = input[{i}];")
        if not any(program.n + i in needed for i in range(program.m)):
            lines.append("(void)input;")
        guards = program.guards or (-1,) * len(program.operations)
        inside = -1
        for o, (code, a, b) in enumerate(program.operations.tolist()):
            guard = guards[o] if code != CHOOSE else -1
            if guard != inside:
                if inside >= 0:
                    lines.append("}")
                if guard >= 0:
                    block = self._block(o, guard)
                    lines += [f"{value} {', '.join(f'r{first + each} = 0' for each in block)};"] if block else []
                    lines.append(f"if (r{guard} != 0) {{")
                inside = guard
            if code == CHOOSE:
                expression = f"r{guards[o]} != 0 ? r{a} : r{b}"
            else:
                coefficient = ""
                if code in (MULTIPLY, AT_LEAST, AT_MOST, CONSTANT):
                    used.add(a)
                    coefficient = self._coefficient(a)
                expression = self.arithmetic.operation(self.step, o, coefficient)
            declaration = "    " if guard >= 0 else f"const {value} "
            lines.append(f"{declaration}r{first + o} = {expression};")
            if first + o not in needed:
                lines.append(f"(void)r{first + o};")
        if inside >= 0:
            lines.append("}")
        return "\n".join(f"    {line}" for line in lines), used

    def _block(self, o: int, guard: int) -> list[int]:
        """Return the operations from o on that run under the same guard, without a gap."""
        program, found = self.step.program, []
        while o < len(program.operations) and program.guards[o] == guard and program.operations[o, 0] != CHOOSE:
            found.append(o)
            o += 1
        return found

    def _conditions(self) -> list[str]:
        """Return the statements that find the status of a step."""
        program, name = self.step.program, self.name.upper()
        lines = []
        if self.step.may_stop:
            stops = [f"r{value} {_STOPS[kind][0]}" for value, kind in program.checks if kind in _STOPS]
            lines += _when(stops, f"return {name}_STOPPED;")
        if conditions := self.arithmetic.finite(self.step):
            lines += _when([f"!{each}" for each in conditions], f"return {name}_OVERFLOW;")
        elif self.arithmetic.may_overflow:
            lines += ["if (overflow)", f"    return {name}_OVERFLOW;"]
        if self.step.may_be_indefinite:
            signs = [
                f"!(r{value} {'>' if kind == POSITIVE else '>='} 0)"
                for value, kind in program.checks
                if kind in (POSITIVE, NOT_NEGATIVE)
            ]
            lines += _when(list(dict.fromkeys(signs)), f"status = {name}_INDEFINITE;")
        return lines

    def function(self) -> tuple[str, set[int]]:
        """Return the function that takes a step, and the coefficients that it uses."""
        program = self.step.program
        body, used = self.body()
        head = []
        if self.step.may_be_indefinite:
            head.append(f"int status = {self.name.upper()}_OK;")
        if self.arithmetic.may_overflow and not self.arithmetic.finite(self.step):
            head.append("int overflow = 0;")
        ends = [
            f"state->{place} = {self._stored(value)};"
            for place, value in zip(self.states, program.outputs.tolist(), strict=False)
        ]
        ends += [f"output[{i}] = {self._stored(value)};" for i, value in enumerate(program.outputs[self.step.stored :])]
        if self.period > 1:
            ends.append(f"state->phase = (state->phase + 1) % {self.period};")
        last = "status" if self.step.may_be_indefinite else f"{self.name.upper()}_OK"
        lines = [*(f"    {each}" for each in head), body, *(f"    {each}" for each in self._conditions())]
        lines += [*(f"    {each}" for each in ends), f"    return {last};"]
        return "\n".join([self.prototype, "{", *lines, "}", ""]), used

    def _stored(self, value: int) -> str:
        """Return a value as it is stored; a negative zero becomes zero, since the emulation has no other."""
        zero = {"float": " + 0.0f", "double": " + 0.0"}.get(self.arithmetic.number)
        return f"r{value}{zero}" if zero else f"({self.name}_number)r{value}"

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
