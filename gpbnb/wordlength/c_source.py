"""The C99 text of a step: one statement for each operation, in the order of the list."""

from __future__ import annotations

import re
import textwrap
from collections.abc import Sequence

from gpbnb.wordlength.c_numbers import CodeNumbers
from gpbnb.wordlength.c_step import DIVISOR, RADICAND, Operation

_ORDERS = ("0", "{} < {}", "{} == {}", "{} <= {}", "{} > {}", "{} != {}", "{} >= {}", "1")
"""How two numbers are compared, by the orders that hold: 1 less, 2 equal, 4 greater."""

_OF_TWO, _OF_ONE = {8: "{0} && {1}", 14: "{0} || {1}"}, {1: "!{0}"}
"""How two truth values, or one with itself, are combined, by the table of the results."""

_STOPS = {DIVISOR: "a divisor is zero", RADICAND: "a square root has a negative argument"}

WIDTH = 110
"""Length of a line."""


class CodeSource:
    """The text of a step in C.

    Parameters
    ----------
    numbers : the step, for a kind of number.
    name : name of the files, and prefix of the public names.
    """

    def __init__(self, numbers: CodeNumbers, name: str) -> None:
        self.numbers, self.step, self.name = numbers, numbers.step, name
        self.period = len(self.step.coefficients)
        #: Numbers of the coefficients that are used.
        self._used = set[int]()

    @property
    def statuses(self) -> list[tuple[str, int, str]]:
        """What a step may return: name, value and meaning."""
        name, ends = self.name.upper(), {condition for _, condition in self.step.stops}
        found = [(f"{name}_OK", 0, "the step is done")]
        if self.step.may_be_indefinite:
            found.append((f"{name}_INDEFINITE", 1, "the step is done, but a variance is not positive"))
        if ends:
            reasons = ", or ".join(why for condition, why in _STOPS.items() if condition in ends)
            found.append((f"{name}_STOPPED", 2, f"{reasons}; the state stays as it was"))
        if self.numbers.may_overflow:
            found.append((f"{name}_OVERFLOW", 3, "a number is beyond the range; the state stays as it was"))
        return found

    @property
    def prototype(self) -> str:
        """The head of the function that takes a step."""
        program, number = self.step.program, f"{self.name}_number"
        output = f", {number} output[{program.p}]" if program.p else ""
        return f"int {self.name}_step({self.name}_state *state, const {number} input[{program.m}]{output})"

    def structure(self) -> str:
        """Return the declaration of the state."""
        shapes = dict[str, list[int]]()
        for each in self.step.state_names:
            name, *at = re.findall(r"\w+", each)
            before = shapes.get(name, [0] * len(at))
            shapes[name] = [max(size, int(i) + 1) for size, i in zip(before, at, strict=True)]
        number = f"    {self.name}_number"
        fields = [f"{number} {name}{''.join(f'[{size}]' for size in shape)};" for name, shape in shapes.items()]
        if self.period > 1:
            fields.append(f"    unsigned phase; /* of the {self.period} steps of a cycle */")
        return "\n".join(["typedef struct {", *(fields or ["    char nothing;"]), f"}} {self.name}_state;"])

    def text(self) -> str:
        """Return constants and functions."""
        step = self._step()
        parts = [self._constants(), self.numbers.helpers(step), self._start(), step]
        return "\n".join(f"{part.rstrip()}\n" for part in parts if part)

    def _constants(self) -> str:
        """Return the coefficients that are used; those that differ in the steps of a cycle are arrays."""
        step, lines = self.step, list[str]()
        for i in sorted(self._used):
            head = f"static const {self.numbers.value} {step.coefficient_names[i]}"
            texts = [self.numbers.constant(i, k) for k in range(self.period)]
            if i in step.changing:
                lines += wrapped(f"{head}[{self.period}] = {{", texts, ", ", "};")
            else:
                lines.append(f"{head} = {texts[0]}; /* {float(step.coefficients[0, i]):.9g} */")
        return "\n".join(lines)

    def _start(self) -> str:
        """Return the function that sets the first state."""
        values = zip(self.step.state_names, self.step.start, strict=True)
        lines = [f"    state->{name} = {self.numbers.text(value)};" for name, value in values if value]
        lines = ["    memset(state, 0, sizeof *state);", *lines]
        return "\n".join([f"void {self.name}_start({self.name}_state *state)", "{", *lines, "}", ""])

    # -- statements -----------------------------------------------------------------------------------------

    def _number(self, place: int) -> str:
        """Return the text of a number: a variable, a coefficient, or zero."""
        if place in self.step.variables:
            return self.step.variables[place]
        if place not in self.step.coefficient_at:
            return "0"
        i = self.step.coefficient_at[place]
        self._used.add(i)
        return self.step.coefficient_names[i] + ("[state->phase]" if i in self.step.changing else "")

    def _truth(self, place: int) -> str:
        return str(place) if place < 2 else f"holds{place}"

    def _step(self) -> str:
        """Return the function that takes a step."""
        step, numbers, program, name = self.step, self.numbers, self.step.program, self.name.upper()
        lines = [f"int status = {name}_OK;"] if step.may_be_indefinite else []
        if numbers.may_overflow and not numbers.floating:
            lines.append("int overflow = 0;")
        taken = zip(program.states.tolist(), (f"state->{each}" for each in step.state_names), strict=False)
        read = [*taken, *((place, f"input[{i}]") for i, place in enumerate(program.inputs.tolist()))]
        loads = [
            f"const {numbers.value} {step.variables[place]} = {text};" for place, text in read if place in step.used
        ]
        lines += loads if any(" = input[" in each for each in loads) else [*loads, "(void)input;"]
        lines += self._left_out()
        for each in step.operations:
            lines += self._statement(each)
        lines += self._ends()
        for after, place in zip(step.state_names, program.after.tolist(), strict=False):
            lines.append(f"state->{after} = {numbers.stored(self._number(place))};")
        for i, place in enumerate(program.after[program.n - program.p :].tolist()):
            lines.append(f"output[{i}] = {numbers.stored(self._number(place))};")
        if self.period > 1:
            lines.append(f"state->phase = (state->phase + 1) % {self.period};")
        lines.append("return status;" if step.may_be_indefinite else f"return {name}_OK;")
        return "\n".join([self.prototype, "{", *(f"    {each}" for each in lines), "}", ""])

    def _has_variable(self, each: Operation) -> bool:
        """Whether something uses the result of an operation."""
        if each.gives_truth:
            return each.out in self.step.truths_used
        return each.gives_number and (each.out in self.step.used or each.out in self.numbers.finite)

    def _left_out(self) -> list[str]:
        """Return declarations of all that a condition may leave out."""
        inside = [each for each in self.step.operations if each.depth and self._has_variable(each)]
        values = [f"{self.step.variables[each.out]} = 0" for each in inside if each.gives_number]
        truths = [f"{self._truth(each.out)} = 0" for each in inside if each.gives_truth]
        found = ((self.numbers.value, values), ("int", truths))
        return [line for kind, names in found if names for line in wrapped(f"{kind} ", names, ", ", ";")]

    def _statement(self, each: Operation) -> list[str]:
        """Return the line of an operation, if it has one."""
        inside, named = "    " * each.depth, self._has_variable(each)
        if each.name == "if":
            return [f"{inside}if ({self._truth(each.given[0])}) {{"]
        if each.name == "end":
            return [f"{inside}}}"]
        if not named and not each.gives_number:
            return []
        numbers, truths = each.takes
        texts = [*map(self._truth, truths), *map(self._number, numbers)]
        if each.name == "compare":
            text = _ORDERS[each.given[2]].format(*texts)
        elif each.name == "combine":
            same = each.given[0] == each.given[1]
            text = (
                (_OF_ONE if same else _OF_TWO)
                .get(each.given[2], "{2} >> (2 * {0} + {1}) & 1")
                .format(*texts, each.given[2])
            )
        else:
            text = self.numbers.operation(each, texts)
        if not named:
            return [f"{inside}(void)({text});"]
        kind, name = self.numbers.value, self.step.variables.get(each.out, "")
        if each.gives_truth:
            kind, name = "int", self._truth(each.out)
        return [f"{inside}{'' if each.depth else f'const {kind} '}{name} = {text};"]

    def _ends(self) -> list[str]:
        """Return the statements that find the status of a step."""
        step, name = self.step, self.name.upper()
        lines = _when([f"{self._number(place)} {end}" for place, end in step.stops], f"return {name}_STOPPED;")
        infinite = [f"!isfinite({self._number(each)})" for each in self.numbers.finite]
        overflow = ["overflow"] if self.numbers.may_overflow and not self.numbers.floating else infinite
        lines += _when(overflow, f"return {name}_OVERFLOW;")
        if step.may_be_indefinite:
            lines += _when([f"!{self._truth(step.program.definite)}"], f"status = {name}_INDEFINITE;")
        return lines


def _when(conditions: list[str], then: str) -> list[str]:
    """Return an if; nothing without conditions."""
    return [*wrapped("if (", conditions, " || ", ")"), f"    {then}"] if conditions else []


def wrapped(start: str, parts: Sequence[str], separator: str, end: str) -> list[str]:
    """Return parts in lines that are no longer than others."""
    text = separator.join(each.replace(" ", "\0") for each in parts)
    lines = textwrap.wrap(f"{start}{text}{end}", WIDTH, subsequent_indent="    ", break_on_hyphens=False)
    return [line.replace("\0", " ") for line in lines]
