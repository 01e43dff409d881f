"""The files of a filter in C: header, source, test with its vectors, and Makefile.

A step is one statement for each operation, in the order of the list.
"""

from __future__ import annotations

import re
import textwrap
from collections.abc import Sequence
from fractions import Fraction
from math import floor
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from gpbnb.files import WRITTEN, is_written
from gpbnb.filters.program import flat
from gpbnb.wordlength.c_numbers import DIVISOR, RADICAND, CodeNumbers, Operation

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
        taken = zip(flat(program.states).tolist(), (f"state->{each}" for each in step.state_names), strict=False)
        read = [*taken, *((place, f"input[{i}]") for i, place in enumerate(flat(program.inputs).tolist()))]
        loads = [
            f"const {numbers.value} {step.variables[place]} = {text};" for place, text in read if place in step.used
        ]
        lines += loads if any(" = input[" in each for each in loads) else [*loads, "(void)input;"]
        lines += self._left_out()
        for each in step.operations:
            lines += self._statement(each)
        lines += self._ends()
        for after, place in zip(step.state_names, flat(program.after).tolist(), strict=False):
            lines.append(f"state->{after} = {numbers.stored(self._number(place))};")
        for i, place in enumerate(flat(program.after)[program.n - program.p :].tolist()):
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


# -- files -----------------------------------------------------------------------------------------------------------

FLAGS = "-std=c99 -Wall -Wextra -pedantic -ffp-contract=off"
"""Flags under which the code compiles without a warning and has the digits of the emulation."""


class Vectors(NamedTuple):
    """Inputs of some steps, and what the emulation makes of them, as float64 or as integers in units of the data.

    Parameters
    ----------
    inputs : (steps, m), as stored.
    states : (steps, n), states after each step, outputs last; a step in which the emulation ends keeps them.
    status : (steps,), 0 if all is well, 1 if a variance is not positive for the first time, -1 after that, -2 if the
        emulation ends.
    """

    inputs: NDArray[Any]
    states: NDArray[Any]
    status: NDArray[np.int64]


def checked_identifier(name: str) -> None:
    """Reject a name that C and file systems do not take as the beginning of others."""
    if not isinstance(name, str) or not re.fullmatch(r"[A-Za-z][A-Za-z0-9_]{0,30}", name):
        raise ValueError(f"got name {name!r}; needed a name of C with up to 31 letters, digits and _, such as 'filter'")


def refuse_others(folder: Path, name: str) -> None:
    """Reject a folder in which files of the names of a filter's code were not written by gpbnb."""
    test = f"test_{name}.c"
    marked = {each: each for each in (f"{name}.h", f"{name}.c", test, "Makefile")} | {f"{name}_vectors.txt": test}
    others = [each for each, marks in marked.items() if (folder / each).exists() and not is_written(folder / marks)]
    if others:
        raise ValueError(
            f"got the folder {folder}, in which {' and '.join(others)} {'were' if len(others) > 1 else 'was'} not "
            "written by gpbnb; needed a folder without files of these names; name another one"
        )


Sections = Sequence[tuple[Sequence[Fraction], Sequence[Fraction]]]
"""Coefficients b and a, without the leading 1 of a, of each section of a cascade."""


def written_files(
    source: CodeSource,
    what: str,
    bound: str,
    bounded: bool,
    sections: Sections,
    vectors: Vectors,
    tolerances: NDArray[np.float64] | None,
) -> dict[str, str]:
    """Return the text of each file by its name.

    `what` and `bound` are sentences; `tolerances`, (n,), is how far each state may be from its vectors.
    """
    name, functions = source.name, ""
    flags = ": compile with -ffp-contract=off, and never with -ffast-math." if source.numbers.floating else "."
    order = (
        "Each statement of the step is one operation, rounded once, in the order in which gpbnb emulates the filter"
        f"{' and bounds its errors' if bounded else ''}. Compilers keep this order unless told otherwise{flags}"
    )
    if tolerances is not None:
        functions = (
            "Functions of the platform may have other last digits than those of the emulation, which are correctly "
            f"rounded. The test allows each state at most {tolerances.max():.2g}: four times what it changes if every "
            "operation is rounded up, or every one down."
        )
    return {
        f"{name}.h": _header(source, _comment(f"{what}.", f"{WRITTEN}.", order, bound, functions), sections),
        f"{name}.c": _source(source),
        f"test_{name}.c": _test(source, tolerances),
        f"{name}_vectors.txt": _vectors(source, vectors),
        "Makefile": _makefile(name),
    }


def _comment(*paragraphs: str) -> str:
    """Return a comment; texts that could end it are changed."""
    lines = list[str]()
    for each in filter(None, paragraphs):
        text = " ".join(each.replace("*/", "* /").replace("/*", "/ *").replace("??/", "?? /").split())
        plain = "".join(c if 32 <= ord(c) < 127 else "?" for c in text)
        lines += [*([""] if lines else []), *textwrap.wrap(plain, 110, break_on_hyphens=False)]
    return "\n".join(["/*", *(f" * {line}".rstrip().rstrip("\\") for line in lines), " */", ""])


def _header(source: CodeSource, comment: str, sections: Sections) -> str:
    name, guard, program = source.name, f"{source.name.upper()}_H", source.step.program
    values = ",\n".join(f"    {status} = {value}" for status, value, _ in source.statuses)
    meanings = "\n".join(f" * {status}: {meaning}." for status, _, meaning in source.statuses)
    takes = f"input: {program.m}" + (f"; output: {program.p}" if program.p else "; the estimate is in the state")
    include = "" if source.numbers.floating else "#include <stdint.h>\n\n"
    return f"""{comment}
#ifndef {guard}
#define {guard}

{include}typedef {source.numbers.number} {name}_number;

{source.structure()}

enum {{
{values}
}};

/* Set the first state. */
void {name}_start({name}_state *state);

/*
 * Take a step ({takes}). Return one of:
{meanings}
 */
{source.prototype};
{_cmsis(source, sections)}
#endif
"""


def _cmsis(source: CodeSource, sections: Sections) -> str:
    """Return the coefficients of second-order sections in the order of CMSIS-DSP; empty if it does not hold them."""
    if not sections or any(len(b) > 3 or len(a) > 2 for b, a in sections):
        return ""
    zero, numbers = [Fraction(0)], source.numbers
    rows = [[*b, *zero * (3 - len(b)), *(-each for each in a), *zero * (2 - len(a))] for b, a in sections]
    if numbers.floating:
        order, how = "b0, b1, b2", "arm_biquad_cascade_df1_f32 and others"
        texts = [list(map(numbers.text, row)) for row in rows]
    else:
        bits = int(numbers.number[3:-2])
        lowest = Fraction(-1, 2 ** (bits - 1))
        shift = floor(max(max(each, lowest - each) for row in rows for each in row)).bit_length()
        integers = [[each * 2 ** (bits - 1 - shift) for each in row] for row in rows]
        if bits == 64 or any(each.denominator > 1 for row in integers for each in row):
            return ""
        gap = ["0"] if bits == 16 else []
        order = f"b0, {'0, ' if gap else ''}b1, b2"
        how = f"arm_biquad_cascade_df1_q{bits - 1} with postShift = {shift}; it rounds its sums otherwise"
        texts = [[str(row[0]), *gap, *map(str, row[1:])] for row in integers]
    lines = ", \\\n    ".join(map(", ".join, texts))
    what = f"{order}, -a1, -a2 of each section, as CMSIS-DSP takes them: {how}."
    return f"\n/* {what} */\n#define {source.name.upper()}_CMSIS {{ \\\n    {lines} }}\n"


_KEPT = """#include <float.h>
#include <math.h>
#include <string.h>

#if defined FLT_EVAL_METHOD && FLT_EVAL_METHOD != 0
#error "This processor rounds to more digits than the type has; use another mode, such as -msse2 -mfpmath=sse."
#endif
#if defined __FAST_MATH__ && !defined {guard}
#error "-ffast-math changes the order of operations; define {guard} to compile anyway."
#endif
#ifdef __clang__
#pragma STDC FP_CONTRACT OFF
#endif
"""


def _source(source: CodeSource) -> str:
    name, includes = source.name, "#include <string.h>\n"
    if source.numbers.floating:
        includes = _KEPT.format(guard=f"{name.upper()}_FAST_MATH")
    return f'/* {WRITTEN}. */\n#include "{name}.h"\n\n{includes}\n{source.text()}'


def _test(source: CodeSource, tolerances: NDArray[np.float64] | None) -> str:
    name, program = source.name, source.step.program
    number = f"{name}_number"
    fields = [f"&state.{place}" for place in source.step.state_names] + [f"&output[{i}]" for i in range(program.p)]
    listed = "\n".join(textwrap.wrap(", ".join(fields), 100, initial_indent=" " * 8, subsequent_indent=" " * 8))
    if source.numbers.floating:
        read, variable, include = '"%lf"', "double", "#include <math.h>\n"
        same = "a == b && !signbit(a) == !signbit(b)" if tolerances is None else "fabs(a - b) <= most"
    else:
        read, variable, include, same = '"%" SCNd64', "int64_t", "#include <inttypes.h>\n", "a == b"
    output = f"    {number} output[{program.p}] = {{0}};\n" if program.p else ""
    passed = ", output" if program.p else ""
    most, at, digits, table = "", "", "bit for bit", ""
    if tolerances is not None:
        texts = [f"{each:.9g}" for each in tolerances.tolist()]
        table = f"static const double tolerance[] = {{{', '.join(texts)}}};\n\n"
        most, at, digits = ", double most", ", tolerance[i]", "each within its tolerance"
    return f"""/* Compare {name}.c with the test vectors of its emulation, {digits}. {WRITTEN}. */
{include}#include <stdio.h>

#include "{name}.h"

{table}static int same({number} a, {number} b{most})
{{
    return {same};
}}

static int read_number(FILE *file, {number} *found)
{{
    {variable} value;
    if (fscanf(file, {read}, &value) != 1)
        return 0;
    *found = ({number})value;
    return 1;
}}

int main(int count, char **arguments)
{{
    FILE *file = fopen(count > 1 ? arguments[1] : "{name}_vectors.txt", "r");
    {name}_state state;
    {number} input[{program.m}], expected;
{output}    const {number} *const found[] = {{
{listed}
    }};
    int status, returned, i;
    long step = 0;

    if (!file) {{
        fprintf(stderr, "no test vectors\\n");
        return 2;
    }}
    {name}_start(&state);
    while (fscanf(file, "%d", &status) == 1) {{
        step++;
        for (i = 0; i < {program.m}; i++)
            if (!read_number(file, &input[i]))
                return 2;
        returned = {name}_step(&state, input{passed});
        if (status == -2 ? returned < 2 : status == -1 ? returned > 1 : returned != status) {{
            fprintf(stderr, "step %ld: status %d\\n", step, returned);
            return 1;
        }}
        for (i = 0; i < {program.n}; i++) {{
            if (!read_number(file, &expected))
                return 2;
            if (!same(*found[i], expected{at})) {{
                fprintf(stderr, "step %ld: number %d differs\\n", step, i);
                return 1;
            }}
        }}
    }}
    fclose(file);
    printf("%ld steps {"with the digits" if tolerances is None else "near those"} of the emulation\\n", step);
    return step == 0;
}}
"""


def _vectors(source: CodeSource, vectors: Vectors) -> str:
    """Return a line for each step: status, inputs, states and outputs."""
    rows = zip(*(each.tolist() for each in vectors), strict=True)
    text = source.numbers.vector_text
    lines = [" ".join([str(status), *map(text, [*inputs, *states])]) for inputs, states, status in rows]
    return "\n".join([*lines, ""])


def _makefile(name: str) -> str:
    return f"""# {WRITTEN}.
CC = cc
CFLAGS = {FLAGS} -O2
LDLIBS = -lm

test: test_{name}
	./test_{name} {name}_vectors.txt

test_{name}: test_{name}.c {name}.c {name}.h
	$(CC) $(CFLAGS) -o $@ test_{name}.c {name}.c $(LDLIBS)

clean:
	rm -f test_{name}

.PHONY: test clean
"""
