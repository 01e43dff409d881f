"""The files of a filter in C: header, source, test with its vectors, and Makefile."""

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
from gpbnb.wordlength.c_source import CodeSource

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
