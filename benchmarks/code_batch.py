"""Compile the generated C code of several filters at once, and compare what each build computes with the emulation.

A program has two translation units, since starting a compiler takes longer than compiling a filter. One holds the code
of all filters, whose static names receive the name of the filter if there are several. The other holds the tests that
come with the code, and for each filter a loop that writes status, states and outputs of every step as binary numbers.
Python compares these bit for bit. After a step that overflows, or has a zero pivot, the filter starts again with the
next input. Smaller inputs would not help: in some formats, roundings alone drive a filter beyond its range.
"""

from __future__ import annotations

import re
import subprocess
import tempfile
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from gpbnb.wordlength.c_files import FLAGS, Vectors
from gpbnb.wordlength.c_source import CodeSource
from gpbnb.wordlength.code import VECTORS, prepared, write_code

_STATIC = re.compile(r"^static (?:const )?\w+ (\w+)|^typedef struct .*\} (\w+);", re.MULTILINE)
_TYPES = {"float": "f4", "double": "f8", "int16_t": "i2", "int32_t": "i4", "int64_t": "i8"}


class Case(NamedTuple):
    """A combination: what is written, in which format, and in which form or structure."""

    kind: str
    label: str
    given: Any
    fmt: Any
    form: Any


class Outcome(NamedTuple):
    """What was compared, in all builds together, and what differs or warns.

    Parameters
    ----------
    builds : builds that agree. steps : steps compared. numbers : states and outputs compared.
    """

    case: Case
    builds: int
    steps: int
    numbers: int
    faults: tuple[str, ...]

    @property
    def counts(self) -> tuple[int, int, int]:
        """What was compared."""
        return self.builds, self.steps, self.numbers


class _Written(NamedTuple):
    """A filter of a batch: its name, its code, and the bits that each step must give."""

    case: Case
    name: str
    source: CodeSource
    vectors: Vectors
    expected: NDArray[Any]


def level_of(case: Case) -> float:
    """Size of the inputs: small enough that few words overflow, so that filters seldom start again."""
    return 0.25 if case.kind in ("binary32", "binary64") else 1.0


def compare(cases: Sequence[Case], steps: int, settings: Sequence[str], seed: int = 0) -> list[Outcome]:
    """Write, compile and run some combinations.

    Parameters
    ----------
    settings : compilers with their flags, except those that the code asks for.
    """
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        batch = [_written(case, f"f{i}", folder, steps, seed) for i, case in enumerate(cases)]
        (folder / "main.c").write_text(_main(batch))
        (folder / "filters.c").write_text(_filters(folder, batch))
        faults: list[list[str]] = [[] for _ in batch]
        for setting in settings:
            fault = _built(folder, f"{setting} {FLAGS} -Werror")
            if fault and len(batch) > 1:  # which of them is at fault?
                return [compare([case], steps, settings, seed)[0] for case in cases]
            for each, found in zip(batch, faults, strict=True):
                if problem := fault or _difference(folder, each):
                    found.append(f"{each.case.kind} {each.case.label}: {setting}: {problem}"[:600])
    return [
        Outcome(
            each.case,
            builds := len(settings) - len(found),
            builds * len(each.expected),
            builds * each.expected.size,
            tuple(found),
        )
        for each, found in zip(batch, faults, strict=True)
    ]


def _written(case: Case, name: str, folder: Path, steps: int, seed: int) -> _Written:
    """Write the code of a combination, its inputs, and a loop over its steps."""
    found = prepared(case.given, case.fmt, case.form)
    z = level_of(case) * np.random.default_rng(seed).uniform(-1, 1, (steps, found.step.program.m))
    vectors = restarted(found.emulate, z)
    write_code(case.given, case.fmt, case.form, folder, name, inputs=z[:VECTORS])
    source = CodeSource(found.step, found.arithmetic, name)
    dtype = np.dtype(_TYPES[found.arithmetic.number])
    inputs, expected = (_exactly(each, dtype) for each in (vectors.inputs, vectors.states))
    inputs.tofile(folder / f"{name}.in")
    return _Written(case, name, source, vectors, expected)


def restarted(emulate: Callable[[Any], Vectors], z: NDArray[Any]) -> Vectors:
    """Return the vectors of a filter that starts again after each step that it does not finish, for all inputs."""
    found, done, count = list[Vectors](), 0, len(z)
    while done < len(z):
        run = emulate(z[done : done + count])
        ended = bool(run.status[-1] == -2)
        if not ended and done + count < len(z):
            count *= 2
            continue
        found.append(run)
        done += len(run.states)
        count = 2 * len(run.states)  # the next run is probably about as long
    return Vectors(*(np.concatenate(parts) for parts in zip(*found, strict=True)))


def _exactly(numbers: NDArray[Any], dtype: np.dtype[Any]) -> NDArray[Any]:
    """Return numbers in a type that holds each of them exactly."""
    found = numbers.astype(dtype)
    if not np.array_equal(found.astype(numbers.dtype), numbers):
        raise ValueError(f"got numbers that do not fit in {dtype}")
    return found


def _loop(source: CodeSource) -> str:
    """Return C code with the test that comes with the filter, and with a loop over steps with binary numbers."""
    name, program = source.name, source.step.program
    fields = [f"state.{place}" for place in source.states] + [f"output[{i}]" for i in range(program.p)]
    copies = "\n".join(f"        row[{i}] = {field};" for i, field in enumerate(fields))
    output = f"    {name}_number output[{program.p}] = {{0}};\n" if program.p else ""
    again = "            memset(output, 0, sizeof output);\n" if program.p else ""
    return f"""{_included(f"test_{name}.c", name, ["main", "same", "read_number"])}
static void run_{name}(FILE *in, FILE *out)
{{
    {name}_state state;
    {name}_number input[{program.m}], row[{program.n}];
{output}    int status;

    {name}_start(&state);
    while (fread(input, sizeof input, 1, in) == 1) {{
        status = {name}_step(&state, input{", output" if program.p else ""});
{copies}
        fwrite(&status, sizeof status, 1, out);
        fwrite(row, sizeof row, 1, out);
        if (status >= 2) {{
            {name}_start(&state);
{again}        }}
    }}
}}
"""


def _included(file: str, name: str, renamed: Sequence[str]) -> str:
    """Return lines that include a file, in which some names receive the name of its filter."""
    before = [f"#define {each} {each}_{name}" for each in renamed]
    return "\n".join([*before, f'#include "{file}"', *(f"#undef {each}" for each in renamed), ""])


def _filters(folder: Path, batch: Sequence[_Written]) -> str:
    """Return a translation unit with the code of all filters."""
    if len(batch) == 1:
        return f'#include "{batch[0].name}.c"\n'
    parts = ["#include <float.h>\n#include <math.h>\n#include <stdint.h>\n"]
    for each in batch:
        found = _STATIC.findall((folder / f"{each.name}.c").read_text())
        parts.append(_included(f"{each.name}.c", each.name, sorted({name for pair in found for name in pair if name})))
    return "\n".join(parts)


def _main(batch: Sequence[_Written]) -> str:
    """Return a program that runs the test and the loop of each filter."""
    loops = "\n".join(_loop(each.source) for each in batch)
    listed = ",\n".join(f'    {{"{each.name}", main_{each.name}, run_{each.name}}}' for each in batch)
    return f"""#include <string.h>
{loops}
static const struct {{
    const char *name;
    int (*test)(int, char **);
    void (*run)(FILE *, FILE *);
}} filters[] = {{
{listed}
}};

int main(void)
{{
    unsigned i;
    for (i = 0; i < sizeof filters / sizeof *filters; i++) {{
        char vectors[64], input[64], output[64], *arguments[2] = {{vectors, vectors}};
        FILE *in, *out;
        sprintf(vectors, "%s_vectors.txt", filters[i].name);
        sprintf(input, "%s.in", filters[i].name);
        sprintf(output, "%s.out", filters[i].name);
        in = fopen(input, "rb");
        out = fopen(output, "wb");
        if (!in || !out || filters[i].test(2, arguments))
            return 1;
        filters[i].run(in, out);
        fclose(in);
        fclose(out);
    }}
    return 0;
}}
"""


def _built(folder: Path, setting: str) -> str:
    """Compile and run a batch; return what went wrong."""
    for file in (*folder.glob("*.out"), folder / "run"):
        file.unlink(missing_ok=True)
    for command in ([*setting.split(), "-o", "run", "main.c", "filters.c", "-lm"], ["./run"]):
        done = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)
        if done.returncode or done.stderr:
            return done.stderr or done.stdout or f"exit status {done.returncode}"
    return ""


def _difference(folder: Path, written: _Written) -> str:
    """Compare the steps of a build with the emulation; return where they differ first."""
    expected, status = written.expected, written.vectors.status
    bits = np.dtype([("status", "i4"), ("row", f"u{expected.itemsize}", expected.shape[1:])])
    found = np.fromfile(folder / f"{written.name}.out", bits)
    if len(found) != len(expected):
        return f"{len(found)} steps in place of {len(expected)}"
    returned = found["status"]
    good = np.where(
        status == -2, returned >= 2, np.where(status == -1, (returned == 0) | (returned == 1), returned == status)
    )
    same = (found["row"] == expected.view(f"u{expected.itemsize}")).all(axis=1)
    wrong = np.flatnonzero(~(good & same))
    if not len(wrong):
        return ""
    k = int(wrong[0])
    if not good[k]:
        return f"step {k + 1}: status {returned[k]}"
    numbers = np.flatnonzero(found["row"][k] != expected[k].view(f"u{expected.itemsize}"))
    return f"step {k + 1}: number {numbers[0]} differs"
